//! Arguments of calls: arrays of points, motions and settings, and what is said of bad ones.

use std::fmt::Display;

use echoloop_clouds::{Coordinates, Pose, pose::from_rows};
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// `ValueError` of an argument.
pub(crate) fn value(argument: &str, problem: impl Display) -> PyErr {
    PyValueError::new_err(format!("{argument}: {problem}"))
}

/// `ValueError` of what a library says.
pub(crate) fn failed(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Array of an argument, by `numpy.asarray`.
pub(crate) fn array<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let numpy = given.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (given,));
    let array = array.map_err(|error| value(argument, format!("expected an array: {error}")))?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

/// Rows of `(N, columns)` float32 or float64.
pub(crate) enum Rows<const COLUMNS: usize> {
    Single(Vec<[f32; COLUMNS]>),
    Double(Vec<[f64; COLUMNS]>),
}

impl<const COLUMNS: usize> Rows<COLUMNS> {
    /// Rows of an array of any strides, copied.
    pub(crate) fn of(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = array(argument, given)?;
        if array.shape().len() != 2 || array.shape()[1] != COLUMNS {
            let shape = array.getattr("shape")?;
            let turned = match array.shape() {
                [rows, _] if *rows == COLUMNS => ": transpose it",
                _ => "",
            };
            let problem = format!("expected shape (N, {COLUMNS}), found {shape}{turned}");
            return Err(value(argument, problem));
        }
        if let Ok(array) = array.cast::<PyArrayDyn<f32>>() {
            return Ok(Self::Single(copied(array)?));
        }
        match array.cast::<PyArrayDyn<f64>>() {
            Ok(array) => Ok(Self::Double(copied(array)?)),
            Err(_) => Err(dtype(argument, "float32 or float64", &array)),
        }
    }

    /// The same as float32, each number rounded to the nearest.
    pub(crate) fn single(self) -> Vec<[f32; COLUMNS]> {
        match self {
            Self::Single(rows) => rows,
            Self::Double(rows) => rows.into_iter().map(|row| row.map(|v| v as f32)).collect(),
        }
    }
}

/// `ValueError` of an array of another shape.
pub(crate) fn shape_error(
    argument: &str,
    expected: &str,
    found: &Bound<'_, PyUntypedArray>,
) -> PyErr {
    let shape = found.getattr("shape").map(|shape| shape.to_string()).unwrap_or_default();
    value(argument, format!("expected shape {expected}, found {shape}"))
}

/// `TypeError` of an array of another type.
fn dtype(argument: &str, expected: &str, found: &Bound<'_, PyUntypedArray>) -> PyErr {
    PyTypeError::new_err(format!("{argument}: expected {expected}, found {}", found.dtype()))
}

/// Rows of an array, in their order, by one copy where it is C-contiguous.
fn copied<T: numpy::Element + Copy + Default, const COLUMNS: usize>(
    array: &Bound<'_, PyArrayDyn<T>>,
) -> PyResult<Vec<[T; COLUMNS]>> {
    let array = array.try_readonly().map_err(|error| PyValueError::new_err(error.to_string()))?;
    // A slice of an array in Fortran's order has its columns one after the other.
    if let Some(numbers) = array.as_slice().ok().filter(|_| array.is_c_contiguous()) {
        return Ok(numbers.as_chunks().0.to_vec());
    }
    let mut rows = vec![[T::default(); COLUMNS]; array.shape()[0]];
    for (number, to) in array.as_array().iter().zip(rows.as_flattened_mut()) {
        *to = *number;
    }
    Ok(rows)
}

/// Codes of a converter, `(N, samples)` uint16 or of one row.
pub(crate) fn codes(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<(Vec<u16>, usize)> {
    let array = array(argument, given)?;
    let length = match *array.shape() {
        [length] | [_, length] if length > 0 => length,
        _ => {
            return Err(shape_error(argument, "(N, samples)", &array));
        }
    };
    let Ok(array) = array.cast::<PyArrayDyn<u16>>() else {
        return Err(dtype(argument, "uint16", &array));
    };
    let array = array.try_readonly().map_err(|error| value(argument, error))?;
    Ok((array.as_array().iter().copied().collect(), length))
}

/// Coordinates of an array, or of an object with `points`, an array or a method that returns one.
pub(crate) fn coordinates(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Coordinates> {
    let is_array = given.is_instance_of::<PyUntypedArray>();
    let own = if is_array { None } else { given.getattr_opt("points")? };
    let points = match own {
        None => given.clone(),
        Some(points) if points.is_callable() => points.call0()?,
        Some(points) => points,
    };
    // small_gicp has (N, 4), of which the last is 1.
    let shape = if is_array { None } else { points.getattr_opt("shape")? };
    let homogeneous = match shape {
        Some(shape) => shape.extract::<(usize, usize)>().is_ok_and(|s| s.1 == 4),
        _ => false,
    };
    let rows = match homogeneous {
        true => points.call_method1("__getitem__", (first_three(given.py())?,))?,
        false => points,
    };
    Ok(match Rows::<3>::of(argument, &rows)? {
        Rows::Single(points) => Coordinates::Single(points),
        Rows::Double(points) => Coordinates::Double(points),
    })
}

/// The index `[:, :3]`.
fn first_three(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let slice = |stop: Option<usize>| py.import("builtins")?.call_method1("slice", (stop,));
    Ok((slice(None)?, slice(Some(3))?).into_pyobject(py)?.into_any())
}

/// A motion of a (4, 4) or (3, 4) array; the identity of `None`.
pub(crate) fn motion(argument: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    let Some(given) = given else { return Ok(Pose::identity()) };
    let rows: Vec<[f64; 4]> = match Rows::<4>::of(argument, given)? {
        Rows::Single(rows) => rows.into_iter().map(|row| row.map(f64::from)).collect(),
        Rows::Double(rows) => rows,
    };
    let last = [0.0, 0.0, 0.0, 1.0];
    let rows: [[f64; 4]; 4] = match *rows {
        [a, b, c] => [a, b, c, last],
        [a, b, c, d] => [a, b, c, d],
        _ => {
            return Err(value(
                argument,
                format!("expected shape (4, 4), found ({}, 4)", rows.len()),
            ));
        }
    };
    let flat: [f64; 16] = std::array::from_fn(|i| rows[i / 4][i % 4]);
    from_rows(&flat).map_err(|error| value(argument, error))
}
