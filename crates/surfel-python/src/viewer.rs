//! The viewer, on a thread beside the interpreter.

use crate::errors::{exception, invalid_setting, refuse_others};
use crate::scene::{PyScene, check_is_not_empty};
use crate::work;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::{PyCFunction, PyDict, PyTuple};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;
use surfel::description::Invalid;
use surfel_cli::{FrameAncestors, RunningViewer};

/// Time between two looks for Ctrl-C.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// A running viewer. It stops with `close()`, at the end of a `with` block, or with the interpreter.
#[pyclass(frozen, module = "surfel", name = "Viewer")]
pub struct PyViewer {
    url: String,
    frame_ancestors: FrameAncestors,
    running: Slot,
}

/// A viewer, until it is stopped.
type Slot = Arc<Mutex<Option<RunningViewer>>>;

/// The viewers that were started, also those that no variable holds any more.
static STARTED: Mutex<Vec<Slot>> = Mutex::new(Vec::new());

/// Stops all viewers when the interpreter ends, so that their temporary files go.
pub fn stop_at_exit(py: Python<'_>) -> PyResult<()> {
    let stop_all = |arguments: &Bound<'_, PyTuple>, _: Option<&Bound<'_, PyDict>>| {
        let stop_all = || {
            let slots = std::mem::take(&mut *lock(&STARTED));
            let running: Vec<_> = slots.iter().filter_map(|slot| lock(slot).take()).collect();
            running.into_iter().for_each(|viewer| drop(viewer.stop()));
        };
        // Fails in a process that was forked, which has none of their threads.
        let _ = work::detached(arguments.py(), stop_all);
    };
    let stop_all = PyCFunction::new_closure(py, None, None, stop_all)?;
    py.import("atexit")?.call_method1("register", (stop_all,))?;
    Ok(())
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl PyViewer {
    /// The address of its page, on this machine.
    #[getter]
    fn url(&self) -> &str {
        &self.url
    }

    /// Stops the viewer. Raises `InvalidScene` if its files could not be read.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let running = lock(&self.running).take();
        let ended = py.detach(|| running.map_or(Ok(()), RunningViewer::stop));
        ended.map_err(|error| exception(py, "InvalidScene", &error.to_string()))
    }

    /// Waits until the viewer ends: by Ctrl-C, which stops it, or by `close()` of another thread. A script whose last line this
    /// is shows the scene until then.
    ///
    /// Raises `InvalidScene` if its files could not be read.
    fn wait(&self, py: Python<'_>) -> PyResult<()> {
        let is_running =
            || lock(&self.running).as_ref().is_some_and(|running| !running.is_finished());
        while is_running() {
            match py.check_signals() {
                Err(raised) if raised.is_instance_of::<PyKeyboardInterrupt>(py) => break,
                checked => checked?,
            }
            py.detach(|| thread::sleep(POLL_INTERVAL));
        }
        self.close(py)
    }

    fn __enter__(viewer: Py<Self>) -> Py<Self> {
        viewer
    }

    #[pyo3(signature = (*_reason))]
    fn __exit__(&self, py: Python<'_>, _reason: Vec<Bound<'_, PyAny>>) -> PyResult<()> {
        self.close(py)
    }

    /// Lets pages of an origin, as `http://localhost:8888`, show the page in a frame; no others may. A notebook's cell does
    /// so by itself.
    ///
    /// Raises `InvalidSetting` for anything but a scheme, a host and a port.
    fn allow_frame(&self, py: Python<'_>, origin: &str) -> PyResult<()> {
        let allowed = self.frame_ancestors.allow(origin);
        allowed.map_err(|error| invalid_setting(py, Invalid::new(error.to_string())))
    }

    /// The link in a cell of a notebook.
    fn _repr_html_(&self) -> String {
        format!("<a href=\"{0}\" target=\"_blank\">{0}</a>", self.url)
    }

    /// The page in a cell of a notebook, where anywidget is installed, and the link.
    #[pyo3(signature = (**_options))]
    fn _repr_mimebundle_<'py>(
        viewer: &Bound<'py, Self>,
        _options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        viewer.py().import("surfel._widget")?.call_method1("mimebundle", (viewer,))
    }

    fn __repr__(&self) -> String {
        format!("<surfel.Viewer {}>", self.url)
    }
}

/// Starts the viewer of a scene as it is now, on this machine alone, and returns at once; `wait()` of the result keeps a
/// script from ending. Other users of this machine can open the page, too.
///
/// `port`: 0 to 65535; 0 takes any free one. `open=True` opens the page in a browser. In a notebook the result shows the page
/// where anywidget is installed, else a link to it.
///
/// Raises `InvalidSetting` for other ports, `Error` if the system refuses the port.
#[pyfunction]
#[pyo3(
    signature = (scene, *, port = 0, open = false, **others),
    text_signature = "(scene, *, port=0, open=False)"
)]
pub fn view(
    py: Python<'_>,
    scene: &Bound<'_, PyScene>,
    port: i64,
    open: bool,
    others: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyViewer> {
    refuse_others("view", others, &["port", "open"])?;
    let port = u16::try_from(port).map_err(|_| {
        let message = format!("found {port}, expected 0 to 65535");
        invalid_setting(py, Invalid::at("port", message))
    })?;
    let description = scene.get().description();
    check_is_not_empty(py, &description)?;
    let running = work::detached(py, || RunningViewer::start(description, port))?
        .map_err(|error| exception(py, "Error", &error.to_string()))?;
    let (url, frame_ancestors) = (running.link.clone(), running.frame_ancestors.clone());
    let running = Arc::new(Mutex::new(Some(running)));
    let mut started = lock(&STARTED);
    started.retain(|slot| lock(slot).is_some());
    started.push(running.clone());
    drop(started);
    if open {
        py.import("webbrowser")?.call_method1("open", (&url,))?;
    }
    Ok(PyViewer { url, frame_ancestors, running })
}
