//! Work on a stream by all cores, the results in the order of the stream.

use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread;

/// Results, for each thread, that may wait for an earlier one.
const AHEAD: usize = 16;

/// Hands `work` of every item to `sink`, in order and as soon as it is there; an error of the sink ends it. Items are taken
/// on the thread of the caller, no more of them than a few for each thread ahead of the sink. Zero threads are as many as there are
/// cores.
pub(crate) fn in_order<T: Send, R: Send, E: Send>(
    threads: usize,
    items: impl Iterator<Item = T>,
    work: impl Fn(T) -> R + Sync,
    mut sink: impl FnMut(R) -> Result<(), E> + Send,
) -> Result<(), E> {
    let threads = if threads == 0 { thread::available_parallelism().map_or(1, usize::from) } else { threads };
    let (to_workers, jobs) = mpsc::sync_channel::<(T, SyncSender<R>)>(threads);
    let (to_sink, results) = mpsc::sync_channel::<Receiver<R>>(AHEAD * threads);
    let jobs = Mutex::new(jobs);
    let next = || jobs.lock().ok()?.recv().ok();
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((item, result)) = next() {
                    // Nobody waits for it any more after an error.
                    let _ = result.send(work(item));
                }
            });
        }
        let writer = scope.spawn(move || {
            results.into_iter().filter_map(|result| result.recv().ok()).try_for_each(&mut sink)
        });
        for item in items {
            let (result, receiver) = mpsc::sync_channel(1);
            if to_sink.send(receiver).is_err() || to_workers.send((item, result)).is_err() {
                break;
            }
        }
        drop((to_workers, to_sink));
        writer.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_keep_the_order_of_the_items() {
        let mut all = Vec::new();
        let slow_first = |i: u64| {
            let spins = if i.is_multiple_of(7) { 20_000 } else { 1 };
            (0..spins).fold(i, |x, _| std::hint::black_box(x))
        };
        let done: Result<(), ()> = in_order(0, 0..1_000, slow_first, |i| {
            all.push(i);
            Ok(())
        });
        assert_eq!((done, all), (Ok(()), (0..1_000).collect()));
    }

    #[test]
    fn an_error_of_the_sink_ends_it() {
        let mut seen = 0;
        let done = in_order(
            3,
            0..,
            |i: u64| i,
            |i| {
                seen += 1;
                if i == 41 { Err(i) } else { Ok(()) }
            },
        );
        assert_eq!((done, seen), (Err(41), 42));
    }
}
