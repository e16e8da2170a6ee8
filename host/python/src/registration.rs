//! Registration of two clouds, and what it found.

use std::borrow::Cow;

use echoloop_clouds::pose::to_rows;
use echoloop_clouds::{Pose, Recorded};
use echoloop_parameters::Kind;
use echoloop_registration::config::given::Given as Settings;
use echoloop_registration::pair::{self, PreparedTarget, Request};
use echoloop_registration::{FgrMode, Method, setting as known_setting};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{motion, value};
use crate::cloud::Given;
use crate::threads::detached;

/// Request of keyword arguments.
fn request(
    method: &str,
    (refine, check): (bool, bool),
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Request> {
    let known = |name: &&Method| name.name() == method;
    let found = Method::ALL.iter().find(known).copied().ok_or_else(|| {
        value("method", format!("expected one of {}, found {method:?}", Method::NAMES.join(", ")))
    })?;
    let mut given = Settings::default();
    for (key, setting) in settings.iter().flat_map(|settings| settings.iter()) {
        let key: String = key.extract()?;
        let bad = |error: PyErr| PyTypeError::new_err(format!("{key}: expected a number: {error}"));
        match &*key {
            _ if setting.is_none() => (), // chosen from the clouds
            "mode" => given.mode = Some(mode(&setting)?),
            "seed" => given.seed = Some(setting.extract().map_err(bad)?),
            _ => {
                let number: f64 = setting.extract().map_err(bad)?;
                let is_whole = known_setting(&key).is_some_and(|own| own.kind == Kind::Whole);
                if is_whole && number.fract() != 0.0 {
                    return Err(value(&key, format!("expected a whole number, found {number}")));
                }
                given.set(&key, number).map_err(|key| {
                    PyTypeError::new_err(format!("{key} is no setting of any method"))
                })?;
            }
        }
    }
    Ok(Request { method: found, refine, given, tuned: None, unchecked: !check })
}

fn mode(given: &Bound<'_, PyAny>) -> PyResult<FgrMode> {
    let name: String = given.extract()?;
    let known = FgrMode::ALL.into_iter().find(|mode| mode.name() == name);
    let expected = || format!("expected one of {}, found {name:?}", FgrMode::NAMES.join(", "));
    known.ok_or_else(|| value("mode", expected()))
}

fn refused(error: impl std::fmt::Display) -> PyErr {
    pyo3::exceptions::PyValueError::new_err(error.to_string())
}

/// The source in one frame with the target; a copy where it has to be moved.
fn in_one_frame<'a>(target: &Recorded, source: &'a Recorded) -> Cow<'a, Recorded> {
    if source.exact.is_none() || source.shift_m == target.shift_m {
        return Cow::Borrowed(source);
    }
    let mut moved = source.clone();
    pair::in_one_frame(target, &mut moved);
    Cow::Owned(moved)
}

/// Registers two clouds: finds the motion that brings `source` onto `target`.
///
/// Clouds are `(N, 3)` arrays of float32 or float64, m, in the frame of their sensor, a `Cloud`,
/// or an object with `points`. `method` is "auto", which needs no initial guess, "icp", "gicp",
/// "fgr" or "mac"; `initial` a `(4, 4)` guess of target_from_source; `refine` finishes what "fgr"
/// or "mac" find with "icp". Keywords are the settings of the method, as `voxel_m=0.2`; the others
/// are chosen from the clouds. The same numbers as of `echoloop register`.
///
/// Both clouds are asked whether the motion is right. Without the `check` that costs nothing, and
/// the result is true wherever the method came to rest; "auto" always has it.
///
/// Raises ValueError or TypeError that names the argument. A pair that does not register is no
/// error: the result is false, and `stop` says why.
#[pyfunction]
#[pyo3(signature = (
    target, source, method = "auto", *, initial = None, refine = false, check = true, **settings
))]
#[expect(clippy::too_many_arguments, reason = "keywords of a call in Python")]
pub(crate) fn register(
    py: Python<'_>,
    target: &Bound<'_, PyAny>,
    source: &Bound<'_, PyAny>,
    method: &str,
    initial: Option<&Bound<'_, PyAny>>,
    refine: bool,
    check: bool,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Registration> {
    let request = request(method, (refine, check), settings)?;
    request.check(initial.is_some()).map_err(refused)?;
    let initial = motion("initial", initial)?;
    let (target, source) = (Given::new("target", target)?, Given::new("source", source)?);
    let (target, source) = (target.recorded(), source.recorded());
    let registered = detached(py, || {
        let source = in_one_frame(target, source);
        request.register(target, &source, &initial)
    });
    Ok(Registration { registered: registered.map_err(refused)? })
}

/// A target prepared once for many sources, by "icp" or "gicp".
///
/// Settings are chosen from the target alone where they are not given. `check` is that of
/// `register`.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Target {
    prepared: PreparedTarget,
}

#[pymethods]
impl Target {
    #[new]
    #[pyo3(signature = (points, method = "icp", *, check = true, **settings))]
    fn new(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        method: &str,
        check: bool,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let request = request(method, (false, check), settings)?;
        let target = Given::new("points", points)?.recorded().clone();
        let prepared = detached(py, || PreparedTarget::new(&request, target));
        Ok(Self { prepared: prepared.map_err(refused)? })
    }

    /// Registers a source to this target, as `register` does with the same settings.
    #[pyo3(signature = (source, *, initial = None))]
    fn register(
        &self,
        py: Python<'_>,
        source: &Bound<'_, PyAny>,
        initial: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Registration> {
        let initial = motion("initial", initial)?;
        let source = Given::new("source", source)?;
        let source = source.recorded();
        let registered = detached(py, || {
            let source = in_one_frame(self.prepared.target(), source);
            self.prepared.register(&source, &initial)
        });
        Ok(Registration { registered: registered.map_err(refused)? })
    }

    /// Settings in use.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        settings(py, &self.prepared.config)
    }

    fn __len__(&self) -> usize {
        self.prepared.len()
    }

    fn __repr__(&self) -> String {
        let method = self.prepared.config.method().name();
        format!("<Target of {} points, for {method}>", self.prepared.len())
    }
}

fn settings<'py>(
    py: Python<'py>,
    config: &echoloop_registration::MethodConfig,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = PyDict::new(py);
    for (setting, _) in config.method().settings() {
        settings.set_item(setting.key, config.get(setting.key))?;
    }
    Ok(settings)
}

/// Outcome of a registration. True if its motion can be trusted, as far as the clouds tell.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Registration {
    registered: pair::Registered,
}

fn matrix<'py>(py: Python<'py>, motion: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, &to_rows(motion)).reshape([4, 4])
}

#[pymethods]
impl Registration {
    /// Motion that brings the source onto the target, `(4, 4)` float64, m.
    #[getter]
    fn target_from_source<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.registered.target_from_source())
    }

    /// True if the motion can be trusted, as far as the clouds tell.
    #[getter]
    fn converged(&self) -> bool {
        self.registered.outcome.stop.is_success()
    }

    /// Why it ended, in words.
    #[getter]
    fn stop(&self) -> String {
        self.registered.outcome.stop.to_string()
    }

    /// Name of the method.
    #[getter]
    fn method(&self) -> &'static str {
        self.registered.config.method().name()
    }

    /// Settings in use, given or chosen.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        settings(py, &self.registered.config)
    }

    /// Steps taken.
    #[getter]
    fn iterations(&self) -> usize {
        self.registered.outcome.iterations
    }

    /// Pairs of points, or of matches, in the last step.
    #[getter]
    fn pairs(&self) -> usize {
        self.registered.outcome.pairs
    }

    /// Share of the thinned source, or of the matches, in those pairs, 0 to 1.
    #[getter]
    fn inlier_fraction(&self) -> f64 {
        self.registered.outcome.inlier_fraction
    }

    /// Root mean square distance of those pairs, m.
    #[getter]
    fn rmse_m(&self) -> f64 {
        self.registered.outcome.rmse_m
    }

    /// Covariance of the motion, `(6, 6)`: turns about x, y, z of the target, rad, then shifts, m;
    /// None for "fgr" and "mac".
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let covariance = self.registered.frames.covariance(&self.registered.outcome);
        let rows =
            |rows: [[f64; 6]; 6]| PyArray1::from_slice(py, rows.as_flattened()).reshape([6, 6]);
        covariance.map(|covariance| rows(covariance.to_rows())).transpose()
    }

    /// Point of the target about which the covariance has its turns, m; the origin unless the
    /// clouds are far from theirs.
    #[getter]
    fn covariance_about_m(&self) -> [f64; 3] {
        let frames = &self.registered.frames;
        let centre = frames.about_centre(&self.registered.target_from_source());
        centre.map_or([0.0; 3], |centre| centre.to_m)
    }

    /// Share of the points whose place the other cloud knows, 0 to 1; None if not checked.
    #[getter]
    fn overlap(&self) -> Option<f64> {
        self.registered.outcome.overlap.map(|overlap| overlap.known())
    }

    /// Share of those that lie on the other cloud, 0 to 1; None if not checked.
    #[getter]
    fn supported(&self) -> Option<f64> {
        self.registered.outcome.overlap.map(|overlap| overlap.supported())
    }

    /// Lead over the same motion slid by a little, standard deviations of chance.
    #[getter]
    fn lead(&self) -> Option<f64> {
        self.registered.outcome.lead
    }

    /// Lead over the best other motion, standard deviations of chance; None where none fits.
    #[getter]
    fn margin(&self) -> Option<f64> {
        let outcome = &self.registered.outcome;
        outcome.rival.map(|rival| rival.lead)
    }

    /// That other motion, `(4, 4)`; None where none fits.
    #[getter]
    fn rival<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let frames = &self.registered.frames;
        let rival = self.registered.outcome.rival;
        rival.map(|rival| matrix(py, &frames.outside(&rival.target_from_source))).transpose()
    }

    /// Small motions that the clouds do not notice, `(k, 6)`: turns, rad, then shifts, m, as
    /// the covariance has them. Each moves the points by 1 m in the mean.
    #[getter]
    fn unobservable_directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let open = self.registered.frames.open(&self.registered.outcome);
        let numbers = open.iter().flat_map(|open| [open.turn_rad, open.shift_m].concat());
        PyArray1::from_iter(py, numbers.collect::<Vec<f64>>()).reshape([open.len(), 6])
    }

    fn __bool__(&self) -> bool {
        self.converged()
    }

    fn __repr__(&self) -> String {
        let motion = self.registered.target_from_source();
        let [x, y, z]: [f64; 3] = motion.translation.vector.into();
        let turn_deg = motion.rotation.angle().to_degrees();
        let supported =
            self.supported().map(|s| format!(", {:.1} % of the overlap agrees", 100.0 * s));
        let supported = supported.unwrap_or_default();
        let (method, stop) = (self.method(), &self.registered.outcome.stop);
        format!(
            "<Registration by {method}: {stop}; shift {x:.3} {y:.3} {z:.3} m, turn {turn_deg:.3}°\
             {supported}>"
        )
    }
}
