//! Scenes, sensors, and scans of them.

use std::path::PathBuf;
use std::sync::Arc;

use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::source::Source;
use echoloop_closed_loop::dataset::{Place, place, respond_at, single_viewpoint, towns};
use echoloop_closed_loop::prepared::ConfiguredSensor;
use echoloop_clouds::Pose;
use echoloop_clouds::pose::to_rows;
use echoloop_sensors::sensor::{Model, Sensors};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{failed, motion, value};
use crate::cloud::Cloud;
use crate::configuration::configuration;
use crate::threads::detached;

/// Scene to scan: surfaces, and what they are made of.
///
/// `settings` are keys of the configuration, laid over those of the file `config`: `scene.source`
/// is a kind of scene ("structured", "semi-structured", "unstructured"), or a file of a mesh or of
/// roads. `town` is one of the seeds of `scene.towns`, the first if left out.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Scene {
    config: RunConfig,
    place: Arc<Place>,
    town: u64,
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (settings = None, *, config = None, town = None))]
    fn new(
        py: Python<'_>,
        settings: Option<&Bound<'_, PyDict>>,
        config: Option<PathBuf>,
        town: Option<u64>,
    ) -> PyResult<Self> {
        let config = configuration(settings, config.as_deref())?;
        if Source::is_recording(&config.scene.source) {
            let problem = "expected a scene, found recorded scans: read_cloud reads them";
            return Err(value("scene.source", problem));
        }
        let all = towns(&config);
        let town = town.unwrap_or(config.scene.towns[0]);
        if !all.contains(&town) {
            let all: Vec<String> = all.iter().map(u64::to_string).collect();
            return Err(value("town", format!("expected one of {}, found {town}", all.join(", "))));
        }
        let place = detached(py, || place(&config, town)).map_err(failed)?;
        Ok(Self { config, place: Arc::new(place), town })
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.place.scene.name
    }

    /// Corners of the triangles, `(V, 3)` float32, m: x ahead, y left, z up.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let vertices = &self.place.scene.mesh.vertices;
        let numbers = vertices.iter().flatten().copied();
        PyArray1::from_iter(py, numbers).reshape([vertices.len(), 3])
    }

    /// Indices of the corners of each triangle, `(T, 3)` uint32.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let triangles = &self.place.scene.mesh.triangles;
        let corners = triangles.iter().flatten().copied();
        PyArray1::from_iter(py, corners).reshape([triangles.len(), 3])
    }

    fn __repr__(&self) -> String {
        let triangles = self.place.scene.mesh.triangles.len();
        format!("<Scene {}, {triangles} triangles>", self.place.scene.name)
    }
}

/// Sensor whose firmware runs in this process: settings in, echoes out.
///
/// `settings` are keys of the configuration, laid over those of the file `config`: `lidar.*` of the
/// firmware, `scanner.*`, `receiver.*`, `motion.*` of the hardware, and `weather.*`.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Sensor {
    config: RunConfig,
    sensor: ConfiguredSensor,
}

#[pymethods]
impl Sensor {
    #[new]
    #[pyo3(signature = (settings = None, *, config = None))]
    fn new(
        py: Python<'_>,
        settings: Option<&Bound<'_, PyDict>>,
        config: Option<PathBuf>,
    ) -> PyResult<Self> {
        let config = configuration(settings, config.as_deref())?;
        detached(py, || {
            let sensors = Sensors::in_process(Model::from(&config));
            let sensor = ConfiguredSensor::new(&config, sensors, &|_| ()).map_err(failed)?;
            Ok(Self { config, sensor })
        })
    }

    fn __repr__(&self) -> String {
        let pattern = self.sensor.device.pattern;
        format!("<Sensor {}: {} beams, {pattern}>", self.sensor.name, pattern.beams())
    }
}

/// Scans a scene: a Cloud in the sensor's frame, and the sensor's pose.
///
/// `world_from_sensor` is a `(4, 4)` motion, m; left out, the first viewpoint that training has in
/// the scene. `seed` is that of the noise, the configuration's of the sensor if left out. The same
/// points as of `echoloop scan`. Raises ValueError if the scan detects nothing.
#[pyfunction]
#[pyo3(signature = (scene, sensor, world_from_sensor = None, *, seed = None))]
pub(crate) fn scan<'py>(
    py: Python<'py>,
    scene: &Scene,
    sensor: &Sensor,
    world_from_sensor: Option<&Bound<'py, PyAny>>,
    seed: Option<u64>,
) -> PyResult<(Cloud, Bound<'py, PyArray2<f64>>)> {
    let given = world_from_sensor.map(|given| motion("world_from_sensor", Some(given)));
    let given = given.transpose()?;
    let config = RunConfig {
        scene: scene.config.scene.clone(),
        data: scene.config.data,
        ..sensor.config.clone()
    };
    let (cloud, pose) = detached(py, || scanned(config, scene, &sensor.sensor, (given, seed)))?;
    let pose = PyArray1::from_iter(py, to_rows(&pose)).reshape([4, 4])?;
    Ok((cloud, pose))
}

fn scanned(
    mut config: RunConfig,
    scene: &Scene,
    sensor: &ConfiguredSensor,
    (given, seed): (Option<Pose>, Option<u64>),
) -> PyResult<(Cloud, Pose)> {
    let pose = match given {
        Some(pose) => pose,
        None => single_viewpoint(&config, &scene.place, scene.town, &|_| ()).map_err(failed)?.0,
    };
    config.seed = seed.unwrap_or(config.seed); // only now: the viewpoint is not of the noise
    let config = &config;
    let beams = config.scanner.beams();
    let beams = beams.aimed(&sensor.start.settings).map_err(failed)?;
    let response = Arc::new(respond_at(config, &scene.place, &pose, 1, &beams));
    let (_, recorded) = sensor.scan(config, &beams, &response).map_err(failed)?;
    match recorded.cloud.points.is_empty() {
        true => Err(value("sensor", "the scan has no detection")),
        false => Ok((Cloud { recorded }, pose)),
    }
}
