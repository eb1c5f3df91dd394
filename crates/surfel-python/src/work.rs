//! Work without the interpreter. Long work runs on a thread of its own, while the caller's thread reports progress, notes
//! and warnings, and looks for Ctrl-C.

use crate::errors::{panicked, to_exception};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::PyBool;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;
use surfel_core::progress::{Progress, with_keys};

/// Time between two looks for Ctrl-C, and between two reports of progress.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Bytes of the stack of the thread that works, as many as a program's main thread has.
const STACK_BYTES: usize = 8 << 20;

/// Runs `work`. `callback` is called as `callback(stage, done, total)` on the caller's thread; `True` shows a bar. There,
/// too, warnings become a `UserWarning`, and notes and choices messages of the logger `surfel`.
///
/// # Errors
///
/// Fails as `work` does, with what `callback` raises, with warnings that are errors to the interpreter, and with
/// `KeyboardInterrupt` upon Ctrl-C.
pub fn run<T: Send>(
    py: Python<'_>,
    callback: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> surfel::Result<T> + Send,
) -> PyResult<T> {
    check_process()?;
    let bar = match callback.and_then(|callback| callback.extract::<bool>().ok()) {
        Some(true) => Some(py.import("surfel._progress")?.call_method0("bar")?),
        _ => None,
    };
    let callback = match callback {
        Some(flag) if flag.is_instance_of::<PyBool>() => bar.as_ref(),
        other => other,
    };
    let result = run_reporting(py, callback, work);
    bar.map_or(Ok(()), |bar| bar.call_method0("close").map(drop))?;
    result
}

fn run_reporting<T: Send>(
    py: Python<'_>,
    callback: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Progress) -> surfel::Result<T> + Send,
) -> PyResult<T> {
    let listener = Listener::default();
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        let work = || catch_unwind(AssertUnwindSafe(|| work(&listener)));
        let worker = thread::Builder::new().stack_size(STACK_BYTES);
        worker.spawn_scoped(scope, move || sender.send(work()))?;
        let mut raised = None;
        // Only the thread that waits receives, yet a receiver cannot be lent to a closure without the interpreter.
        let receiver = Mutex::new(receiver);
        loop {
            let received = py.detach(|| {
                let receiver = receiver.lock().unwrap_or_else(PoisonError::into_inner);
                receiver.recv_timeout(POLL_INTERVAL)
            });
            match received {
                Ok(Ok(result)) => {
                    if let Some(raised) = raised {
                        return Err(raised);
                    }
                    // Work that ends between two reports is reported, too.
                    let delivered = listener.deliver(py);
                    let result = result.map_err(|error| to_exception(py, &error))?;
                    delivered.and_then(|()| listener.report(callback))?;
                    return Ok(result);
                }
                Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => return Err(panicked()),
                Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                    let reported = py.check_signals().and_then(|()| listener.deliver(py));
                    raised = reported.and_then(|()| listener.report(callback)).err();
                    listener.is_cancelled.store(raised.is_some(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    })
}

/// Runs `work` on the caller's thread without the interpreter: short work, which reports nothing and is not stopped.
///
/// # Errors
///
/// Fails in a process that was forked after the threads of surfel were started.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    check_process()?;
    Ok(py.detach(work))
}

/// Fails in a process that was forked after the threads of surfel were started: they do not exist there, and waiting
/// for them would never end.
fn check_process() -> PyResult<()> {
    static FIRST: AtomicU32 = AtomicU32::new(0);
    let own = std::process::id();
    match FIRST.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != own => Err(PyRuntimeError::new_err(
            "this process was forked after surfel had started its threads, which it lacks; start processes with \
             multiprocessing.get_context(\"spawn\") or \"forkserver\"",
        )),
        _ => Ok(()),
    }
}

/// The progress of the work, as far as it was reported.
#[derive(Default)]
struct Listener {
    is_cancelled: AtomicBool,
    stage: Mutex<(String, u64)>,
    n_done: AtomicU64,
    /// Lines that the interpreter does not know yet.
    messages: Mutex<Vec<Message>>,
}

enum Message {
    Note(String),
    Warning(String),
}

impl Listener {
    fn report(&self, callback: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let Some(callback) = callback else { return Ok(()) };
        let (stage, total) = self.stage.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if !stage.is_empty() {
            callback.call1((stage, self.n_done.load(Ordering::Relaxed), total))?;
        }
        Ok(())
    }

    /// Hands warnings to the module `warnings`, and notes to the module `logging`.
    fn deliver(&self, py: Python<'_>) -> PyResult<()> {
        let messages = std::mem::take(&mut *self.messages());
        for message in messages {
            match message {
                Message::Note(line) => {
                    let logger = py.import("logging")?.call_method1("getLogger", ("surfel",))?;
                    logger.call_method1("info", (line,))?;
                }
                Message::Warning(line) => {
                    // Names of columns may hold anything, but a C string ends at its first 0.
                    let line = CString::new(line.replace('\0', " "))?;
                    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &line, 1)?;
                }
            }
        }
        Ok(())
    }

    fn messages(&self) -> MutexGuard<'_, Vec<Message>> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Listener {
    fn begin(&self, stage: &str, total: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = (stage.to_owned(), total);
        self.n_done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, units: u64) {
        self.n_done.fetch_add(units, Ordering::Relaxed);
    }

    fn note(&self, line: &str) {
        self.messages().push(Message::Note(line.to_owned()));
    }

    fn warning(&self, line: &str, keys: &[&str]) {
        self.messages().push(Message::Warning(with_keys(line, keys)));
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}
