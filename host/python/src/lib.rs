//! Python module `echoloop`: what its functions and classes do is said in `python/echoloop`.
//!
//! Each call reads its arguments while it holds the interpreter's lock, and computes without it.

use pyo3::prelude::*;

mod arguments;
mod cloud;
mod configuration;
mod features;
mod objective;
mod registration;
mod scan;
mod threads;
mod tuner;
mod waveforms;

/// The compiled half of the package `echoloop`.
#[pymodule]
mod _native {
    use echoloop_closed_loop::dataset::fingerprint::of_library;
    use pyo3::prelude::*;

    /// The journal of a run names the build by this library, not by Python.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::threads::loaded();
        module.setattr("__version__", env!("CARGO_PKG_VERSION"))?;
        if let Ok(file) = module.filename() {
            of_library(file.extract()?);
        }
        Ok(())
    }

    #[pymodule_export]
    use crate::cloud::{Cloud, read_cloud, write_cloud};
    #[pymodule_export]
    use crate::features::{estimate_normals, fpfh, match_features, voxel_downsample};
    #[pymodule_export]
    use crate::objective::{Infeasible, Objective};
    #[pymodule_export]
    use crate::registration::{Registration, Target, register};
    #[pymodule_export]
    use crate::scan::{Scene, Sensor, scan};
    #[pymodule_export]
    use crate::tuner::{Tuner, Worker};
    #[pymodule_export]
    use crate::waveforms::{Detector, find_echoes};
}
