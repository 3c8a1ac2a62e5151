//! Signals and progress while the core works: the calling thread asks Python every few hundredths of a second.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use quest_core::robust::STACK_SIZE;

use crate::errors::QuestError;

/// How often Python is asked: often enough for a signal to be answered within two tenths of a second.
const PERIOD: Duration = Duration::from_millis(50);

/// Runs work that does not ask whether it is to end on a thread of its own. A signal ends the call; the thread goes on alone to the
/// end of its work, whose result nobody gets. Python's lock must not be held.
pub(crate) fn apart<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    // Kept here too, since a thread that is refused takes what it was given with it.
    let work = Arc::new(Mutex::new(Some(work)));
    let take = |work: &Mutex<Option<_>>| work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let (sender, result) = mpsc::sync_channel(1);
    let theirs = Arc::clone(&work);
    let start = thread::Builder::new().stack_size(STACK_SIZE).spawn(move || {
        if let Some(work) = take(&theirs) {
            // Nobody waits for it any more after a signal.
            let _ = sender.send(work());
        }
    });
    let ended = || QuestError::new_err("the thread of the work ended early");
    let Ok(worker) = start else { return take(&work).map(|work| work()).ok_or_else(ended) };
    loop {
        match result.recv_timeout(PERIOD) {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => Python::attach(signals)?,
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Err(panic) => resume_unwind(panic),
                Ok(()) => return Err(ended()),
            },
        }
    }
}

/// The error of a signal that has come. A closure would be called redundant, and the method itself has too short a lifetime.
fn signals(py: Python<'_>) -> PyResult<()> {
    py.check_signals()
}

/// Ends work that a signal, or the callable that is told of its progress, wants ended.
pub(crate) struct Supervisor<'a> {
    progress: Option<&'a Py<PyAny>>,
    total: AtomicUsize,
    done: AtomicUsize,
    asked: Mutex<Instant>,
    failure: Mutex<Option<PyErr>>,
    cancelled: AtomicBool,
}

impl<'a> Supervisor<'a> {
    /// A supervisor of work on `total` things. The callable is told how many are done, and how many there are.
    pub(crate) fn new(progress: Option<&'a Py<PyAny>>, total: usize) -> Self {
        Self {
            progress,
            total: AtomicUsize::new(total),
            done: AtomicUsize::new(0),
            asked: Mutex::new(Instant::now()),
            failure: Mutex::new(None),
            cancelled: AtomicBool::new(false),
        }
    }

    /// Runs work on the calling thread, which has to call [`poll`](Self::poll) often; Python's lock must not be held.
    pub(crate) fn run_here<T>(&self, work: impl FnOnce() -> T) -> PyResult<T> {
        let result = work();
        self.finish()?;
        Ok(result)
    }

    /// Runs work on other threads, which have to ask [`is_cancelled`](Self::is_cancelled) often; Python's lock must not be held.
    /// Where the system refuses a thread, this one does the work, and cannot ask Python meanwhile.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> PyResult<T> {
        let caller = thread::current();
        // Not moved into the thread, which takes what it was given with it where it is refused.
        let work = Mutex::new(Some(work));
        let take = || work.lock().unwrap_or_else(PoisonError::into_inner).take();
        let result = thread::scope(|scope| {
            let start = thread::Builder::new().stack_size(STACK_SIZE).spawn_scoped(scope, || {
                let result = take().map(|work| work());
                caller.unpark();
                result
            });
            let Ok(worker) = start else { return take().map(|work| work()) };
            while !worker.is_finished() {
                thread::park_timeout(PERIOD);
                self.poll();
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        });
        self.finish()?;
        result.ok_or_else(|| QuestError::new_err("the work was not begun"))
    }

    /// Sets how many things are done, and how many there are.
    pub(crate) fn set(&self, done: usize, total: usize) {
        self.total.store(total, Ordering::Relaxed);
        self.done.store(done, Ordering::Relaxed);
    }

    /// One more is done.
    pub(crate) fn add_one(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Asks Python, unless it has been asked just now; whether the work is to end. On the calling thread alone.
    pub(crate) fn poll(&self) -> bool {
        {
            let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
            if asked.elapsed() < PERIOD || self.is_cancelled() {
                return self.is_cancelled();
            }
            *asked = Instant::now();
        }
        Python::attach(|py| {
            if let Err(error) = py.check_signals().and_then(|()| self.tell(py)) {
                *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                self.cancelled.store(true, Ordering::Relaxed);
            }
        });
        self.is_cancelled()
    }

    fn tell(&self, py: Python<'_>) -> PyResult<()> {
        let Some(progress) = self.progress else { return Ok(()) };
        let (done, total) = (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed));
        progress.call1(py, (done, total))?;
        Ok(())
    }

    /// What ended the work, or the last word on its progress.
    fn finish(&self) -> PyResult<()> {
        if let Some(error) = self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(error);
        }
        if self.progress.is_some() {
            return Python::attach(|py| self.tell(py));
        }
        Ok(())
    }
}
