//! Parts of registration: voxels, normals, features, matches.

use echoloop_registration::Cloud;
use echoloop_registration::features::{DIMENSIONS, Features, fpfh as histograms, matching};
use echoloop_registration::geometry::neighbours::Neighbours;
use echoloop_registration::geometry::{normals, voxel};
use nalgebra::{Point3, Vector3};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arguments::{Rows, value};
use crate::cloud::Given;
use crate::threads::detached;

type Rows3<'py> = Bound<'py, PyArray2<f32>>;

fn rows3<'py>(py: Python<'py>, rows: impl IntoIterator<Item = [f32; 3]>) -> PyResult<Rows3<'py>> {
    let rows: Vec<[f32; 3]> = rows.into_iter().collect();
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), 3])
}

/// Finite rows, as they are.
fn finite(argument: &str, rows: Vec<[f32; 3]>) -> PyResult<Vec<Point3<f32>>> {
    let points: Vec<Point3<f32>> = rows.into_iter().map(Point3::from).collect();
    match points.iter().position(|point| !echoloop_clouds::is_finite(point)) {
        Some(row) => Err(value(argument, format!("expected finite numbers, row {row} has others"))),
        None => Ok(points),
    }
}

fn positive(argument: &str, given: f64) -> PyResult<f64> {
    match given > 0.0 && given.is_finite() {
        true => Ok(given),
        false => Err(value(argument, format!("expected a length above 0 m, found {given}"))),
    }
}

fn neighbours(argument: &str, given: usize) -> PyResult<usize> {
    match (1..=1000).contains(&given) {
        true => Ok(given),
        false => Err(value(argument, format!("expected 1 to 1000, found {given}"))),
    }
}

/// Means of the points in each voxel of edge `voxel_m`: `(M, 3)` float32, or float64 where float32
/// would round the coordinates.
#[pyfunction]
pub(crate) fn voxel_downsample<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    voxel_m: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let voxel_m = positive("voxel_m", voxel_m)?;
    let given = Given::new("points", points)?;
    let recorded = given.recorded();
    let cloud = &recorded.cloud;
    let thinned = detached(py, || voxel::downsample(cloud, voxel_m));
    let thinned = thinned.map_err(|error| value("voxel_m", error))?;
    if recorded.exact.is_some() {
        let there = |point: &Point3<f32>| point.cast::<f64>() + recorded.shift_m;
        let numbers = thinned.points.iter().flat_map(|point| <[f64; 3]>::from(there(point)));
        let numbers = PyArray1::from_iter(py, numbers.collect::<Vec<f64>>());
        return Ok(numbers.reshape([thinned.points.len(), 3])?.into_any());
    }
    Ok(rows3(py, thinned.points.iter().map(|point| point.coords.into()))?.into_any())
}

/// Distance from the origin from which coordinates are to be moved first, m: float32 rounds to a
/// millimetre there.
const FAR_M: f64 = 16_384.0;

/// Points as float32, unless it would round them: distances between them are all that counts.
fn near(points: Rows<3>) -> PyResult<Vec<[f32; 3]>> {
    if let Rows::Double(rows) = &points {
        let is_far = |row: &[f64; 3]| row.iter().any(|at| at.is_finite() && at.abs() > FAR_M);
        if let Some(row) = rows.iter().position(is_far) {
            let problem = format!("expected them within {FAR_M} m of the origin, row {row} is not");
            return Err(value("points", problem + ": subtract their centre first"));
        }
    }
    Ok(points.single())
}

/// Unit normals of `(N, 3)` points, turned to the sensor at the origin: `(N, 3)` float32.
///
/// Each is that of the plane through the nearest `max_neighbours` within `radius_m`, the point
/// itself included. It is zero where these are fewer than three or on a line, and for a point that
/// is not finite.
#[pyfunction]
#[pyo3(signature = (points, radius_m, max_neighbours = 30))]
pub(crate) fn estimate_normals<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    radius_m: f64,
    max_neighbours: usize,
) -> PyResult<Rows3<'py>> {
    let radius_m = positive("radius_m", radius_m)?;
    let most = neighbours("max_neighbours", max_neighbours)?;
    let points = near(Rows::<3>::of("points", points)?)?;
    let found = detached(py, || {
        let mut cloud = Cloud::new(points.into_iter().map(Point3::from).collect());
        normals::estimate(&mut cloud, radius_m, most);
        cloud.normals.unwrap_or_default()
    });
    rows3(py, found.into_iter().map(Into::into))
}

/// Fast point feature histograms of `(N, 3)` points with normals: `(N, 33)` float32.
///
/// Over the nearest `max_neighbours` within `radius_m`, as Open3D has them. A point whose normal is
/// zero has a row of zeros.
#[pyfunction]
#[pyo3(signature = (points, normals, radius_m, max_neighbours = 100))]
pub(crate) fn fpfh<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    normals: &Bound<'py, PyAny>,
    radius_m: f64,
    max_neighbours: usize,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let radius_m = positive("radius_m", radius_m)?;
    let most = neighbours("max_neighbours", max_neighbours)?;
    let points = finite("points", near(Rows::<3>::of("points", points)?)?)?;
    let normals: Vec<Vector3<f32>> =
        finite("normals", Rows::<3>::of("normals", normals)?.single())?
            .into_iter()
            .map(|normal| normal.coords)
            .collect();
    if normals.len() != points.len() {
        let problem =
            format!("expected {} rows, one a point, found {}", points.len(), normals.len());
        return Err(value("normals", problem));
    }
    let features = detached(py, || {
        let neighbours = Neighbours::within(&points, radius_m, most);
        histograms::describe(&points, &normals, &neighbours)
    });
    let rows = &features.rows;
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), DIMENSIONS])
}

/// Pairs of features that are each other's nearest: `(M, 2)` uint32, row of target and of source.
///
/// Features are `(N, 33)`; rows of zeros match nothing.
#[pyfunction]
pub(crate) fn match_features<'py>(
    py: Python<'py>,
    target: &Bound<'py, PyAny>,
    source: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let rows = |argument, given| -> PyResult<Features> {
        Ok(Features { rows: Rows::<DIMENSIONS>::of(argument, given)?.single() })
    };
    let (target, source) = (rows("target", target)?, rows("source", source)?);
    let matches = detached(py, || matching::mutual(&source, &target));
    let indices: Vec<u32> = matches.iter().flat_map(|of| [of.target, of.source]).collect();
    PyArray1::from_slice(py, &indices).reshape([matches.len(), 2])
}
