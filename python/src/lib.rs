//! The native part of the Python package: commands, cameras and pictures. What users see is in `camsplat/`.

mod cameras;
mod command;
mod pictures;
mod surface;

use std::process;
use std::sync::atomic::{AtomicU32, Ordering};

use pyo3::create_exception;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

create_exception!(camsplat, Error, PyRuntimeError, "What is wrong, where, and what to do, in one line.");

/// An error of the library as Python has it.
fn failed(error: camsplat::Error) -> PyErr {
    Error::new_err(error.to_string().replace('`', ""))
}

/// Refuses what would wait for ever: a process that was forked after the first use has the locks of that use, and not its threads.
fn unless_forked() -> PyResult<()> {
    /// Of the process that used the package first; 0 before.
    static USED_BY: AtomicU32 = AtomicU32::new(0);
    let own = process::id();
    match USED_BY.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(other) if other != own => Err(Error::new_err(
            "this process was forked after camsplat had been used, whose threads it lacks; start processes with the method \"spawn\" of \
             multiprocessing",
        )),
        _ => Ok(()),
    }
}

#[pymodule]
fn _camsplat(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", module.py().get_type::<Error>())?;
    module.add_function(wrap_pyfunction!(command::main, module)?)?;
    module.add_function(wrap_pyfunction!(command::run, module)?)?;
    module.add_function(wrap_pyfunction!(cameras::read_cameras, module)?)?;
    module.add_function(wrap_pyfunction!(cameras::write_cameras, module)?)?;
    module.add_function(wrap_pyfunction!(cameras::write_capture, module)?)?;
    module.add_function(wrap_pyfunction!(surface::read_surface, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::render, module)?)?;
    Ok(())
}
