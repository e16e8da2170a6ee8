//! Clouds: their points, files, and clouds as arguments.

use std::path::PathBuf;

use echoloop_clouds::{
    CloudError, Column, Coordinates, NumberType, Recorded, read_recorded, write_recorded,
};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arguments::{coordinates, value};
use crate::threads::detached;

/// Points of a LiDAR scan in the frame of its sensor, metres, and what its file says of each.
///
/// `points`: `(N, 3)` float32 or float64, or an object that has them as `points`. `range_sd_m`:
/// standard deviation of each range, m. Points that are not finite, and those at the origin, are no
/// echo and are left out. Far from the origin coordinates are kept as float64.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Cloud {
    pub(crate) recorded: Recorded,
}

/// A cloud that is given as such, or by its points.
pub(crate) enum Given<'py> {
    Cloud(Bound<'py, Cloud>),
    Points(Box<Recorded>),
}

impl<'py> Given<'py> {
    pub(crate) fn new(argument: &str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        match given.cast::<Cloud>() {
            Ok(cloud) => Ok(Self::Cloud(cloud.clone())),
            Err(_) => Ok(Self::Points(Box::new(recorded(argument, given, None)?))),
        }
    }

    pub(crate) fn recorded(&self) -> &Recorded {
        match self {
            Self::Cloud(cloud) => &cloud.get().recorded,
            Self::Points(recorded) => recorded,
        }
    }
}

/// Points of an argument, without those that are no echo.
fn recorded(
    argument: &str,
    given: &Bound<'_, PyAny>,
    range_sd_m: Option<Vec<f32>>,
) -> PyResult<Recorded> {
    let coordinates = coordinates(argument, given)?;
    let count = match &coordinates {
        Coordinates::Single(points) => points.len(),
        Coordinates::Double(points) | Coordinates::Wide(points) => points.len(),
    };
    if let Some(sds) = range_sd_m.as_ref().filter(|sds| sds.len() != count) {
        let problem = format!("expected {count} values, one a point, found {}", sds.len());
        return Err(value("range_sd_m", problem));
    }
    let found = given.py().detach(|| Recorded::from_coordinates(coordinates, range_sd_m));
    let (recorded, dropped) = found.map_err(|problem| value(argument, problem))?;
    if recorded.cloud.points.is_empty() {
        let found = match dropped.total() {
            0 => "found none".to_owned(),
            _ => format!("found only {dropped}"),
        };
        return Err(value(argument, format!("expected a point that is an echo, {found}")));
    }
    Ok(recorded)
}

/// Points as float32, or as float64 where float32 would round them.
fn points<'py>(py: Python<'py>, recorded: &Recorded) -> PyResult<Bound<'py, PyAny>> {
    Ok(match &recorded.exact {
        None => {
            let points = recorded.cloud.points.iter().flat_map(|p| p.coords.data.0[0]);
            PyArray1::from_iter(py, points).reshape([recorded.cloud.points.len(), 3])?.into_any()
        }
        Some(exact) => {
            let points = exact.at_m.iter().flat_map(|p| p.coords.data.0[0]);
            PyArray1::from_iter(py, points).reshape([exact.at_m.len(), 3])?.into_any()
        }
    })
}

/// Numbers of a column, in the type of its file; the array is read-only.
fn numbers<'py>(py: Python<'py>, column: &Column) -> PyResult<Bound<'py, PyAny>> {
    let dtype = match column.kind() {
        NumberType::I8 => "<i1",
        NumberType::U8 => "<u1",
        NumberType::I16 => "<i2",
        NumberType::U16 => "<u2",
        NumberType::I32 => "<i4",
        NumberType::U32 => "<u4",
        NumberType::I64 => "<i8",
        NumberType::U64 => "<u8",
        NumberType::F32 => "<f4",
        NumberType::F64 => "<f8",
    };
    let bytes: Vec<u8> = column.parts().flatten().copied().collect();
    py.import("numpy")?.call_method1("frombuffer", (PyBytes::new(py, &bytes), dtype))
}

#[pymethods]
impl Cloud {
    #[new]
    #[pyo3(signature = (points, *, range_sd_m = None))]
    fn new(points: &Bound<'_, PyAny>, range_sd_m: Option<Vec<f32>>) -> PyResult<Self> {
        Ok(Self { recorded: recorded("points", points, range_sd_m)? })
    }

    /// Coordinates, m: `(N, 3)` float32, or float64 where float32 would round them.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        points(py, &self.recorded)
    }

    /// Standard deviation of each range, m: `(N,)` float32, or None.
    #[getter]
    fn range_sd_m<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f32>>> {
        self.recorded.cloud.range_sd_m.as_ref().map(|sds| PyArray1::from_slice(py, sds))
    }

    /// Everything else that the file has of each point, by name: arrays `(N,)`, read-only.
    #[getter]
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for column in &self.recorded.columns {
            columns.set_item(&column.name, numbers(py, column)?)?;
        }
        Ok(columns)
    }

    /// The cloud moved by a `(4, 4)` motion, in another frame.
    fn transformed(&self, py: Python<'_>, target_from_source: &Bound<'_, PyAny>) -> PyResult<Self> {
        let motion = crate::arguments::motion("target_from_source", Some(target_from_source))?;
        let mut recorded = self.recorded.clone();
        detached(py, || recorded.transform(&motion));
        Ok(Self { recorded })
    }

    fn __len__(&self) -> usize {
        self.recorded.cloud.points.len()
    }

    fn __repr__(&self) -> String {
        let columns = self.recorded.columns.iter().map(|column| &*column.name);
        let columns: Vec<&str> = columns.collect();
        let columns = if columns.is_empty() { String::new() } else { format!(", {columns:?}") };
        format!("<Cloud of {} points{columns}>", self.__len__())
    }
}

/// Cloud of a file, PLY, PCD, VTK, KITTI .bin or XYZ, m, with all that it says of each point.
///
/// Raises ValueError that names the file and what was expected of it.
#[pyfunction]
pub(crate) fn read_cloud(py: Python<'_>, path: PathBuf) -> PyResult<Cloud> {
    let read = detached(py, || read_recorded(&path));
    let (recorded, _) =
        read.map_err(|error: CloudError| PyValueError::new_err(error.to_string()))?;
    Ok(Cloud { recorded })
}

/// Writes a cloud, or an `(N, 3)` array, as PLY or PCD by the extension of `path`.
#[pyfunction]
pub(crate) fn write_cloud(py: Python<'_>, path: PathBuf, cloud: &Bound<'_, PyAny>) -> PyResult<()> {
    let cloud = Given::new("cloud", cloud)?;
    let recorded = cloud.recorded();
    let written = detached(py, || write_recorded(&path, recorded));
    written.map_err(|error| PyValueError::new_err(error.to_string()))
}
