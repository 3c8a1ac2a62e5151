//! One value for each index, computed on several threads.

use std::ops::Range;
use std::thread;

/// `f` of `0..count`, in order: the result does not depend on the number of threads.
///
/// # Errors
/// The error of the smallest index that has one in its thread's share.
///
/// # Panics
/// Where `f` does.
pub fn map<T: Send, E: Send>(
    count: u64,
    threads: usize,
    f: impl Fn(u64) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let share = count.div_ceil(threads.max(1) as u64).max(1);
    let run = |range: Range<u64>| range.map(&f).collect::<Result<Vec<T>, E>>();
    thread::scope(|scope| {
        let starts = (0..count).step_by(usize::try_from(share).unwrap_or(usize::MAX));
        let workers: Vec<_> = starts
            .map(|start| {
                let range = start..count.min(start + share);
                let run = &run;
                scope.spawn(move || run(range))
            })
            .collect();
        let mut all = Vec::new();
        for worker in workers {
            match worker.join() {
                Ok(part) => all.extend(part?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok(all)
    })
}

/// The number of threads that this machine runs at once.
#[must_use]
pub fn all_cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        for count in [0, 1, 2, 7, 100] {
            let expected: Vec<u64> = (0..count).map(|i| i * i).collect();
            for threads in [0, 1, 2, 3, 8, 200] {
                let found = map(count, threads, |i| Ok::<_, ()>(i * i)).unwrap();
                assert_eq!(found, expected);
            }
        }
        assert_eq!(map(10, 3, |i| if i > 4 { Err(i) } else { Ok(i) }), Err(5));
    }
}
