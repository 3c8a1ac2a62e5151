//! Work on a stream by all cores, the results in the order of the stream.

use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread;

use quest_core::robust::STACK_SIZE;

/// Results, for each thread, that may wait for an earlier one.
const AHEAD: usize = 16;

/// Hands `work` of every item to `sink`, in order and as soon as it is there; an error of the sink ends it. Items are taken
/// on the thread of the caller, no more of them than a few for each thread ahead of the sink. Zero threads are as many as there are
/// cores. Where the system refuses threads, those that it gives do the work, and the thread of the caller where it gives none.
pub(crate) fn in_order<T: Send, R: Send, E: Send>(
    threads: usize,
    mut items: impl Iterator<Item = T>,
    work: impl Fn(T) -> R + Sync,
    mut sink: impl FnMut(R) -> Result<(), E> + Send,
) -> Result<(), E> {
    let threads = if threads == 0 { thread::available_parallelism().map_or(1, usize::from) } else { threads };
    match by_threads(threads, &mut items, &work, &mut sink) {
        Some(done) => done,
        None => items.try_for_each(|item| sink(work(item))),
    }
}

/// The same; `None`, and no item taken, where the system gives no thread.
fn by_threads<T: Send, R: Send, E: Send>(
    threads: usize,
    items: &mut impl Iterator<Item = T>,
    work: &(impl Fn(T) -> R + Sync),
    sink: &mut (impl FnMut(R) -> Result<(), E> + Send),
) -> Option<Result<(), E>> {
    let (to_workers, jobs) = mpsc::sync_channel::<(T, SyncSender<R>)>(threads);
    let (to_sink, results) = mpsc::sync_channel::<Receiver<R>>(AHEAD * threads);
    let jobs = Mutex::new(jobs);
    let next = || jobs.lock().ok()?.recv().ok();
    let worker = || {
        while let Some((item, result)) = next() {
            // Nobody waits for it any more after an error.
            let _ = result.send(work(item));
        }
    };
    thread::scope(|scope| {
        let writer = thread::Builder::new().spawn_scoped(scope, move || {
            results.into_iter().filter_map(|result| result.recv().ok()).try_for_each(sink)
        });
        let start = |_| thread::Builder::new().stack_size(STACK_SIZE).spawn_scoped(scope, worker).ok();
        let workers = (0..threads).map_while(start).count();
        let Some(writer) = writer.ok().filter(|_| workers > 0) else {
            drop((to_workers, to_sink));
            return None;
        };
        for item in items {
            let (result, receiver) = mpsc::sync_channel(1);
            if to_sink.send(receiver).is_err() || to_workers.send((item, result)).is_err() {
                break;
            }
        }
        drop((to_workers, to_sink));
        Some(writer.join().unwrap_or_else(|panic| resume_unwind(panic)))
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
