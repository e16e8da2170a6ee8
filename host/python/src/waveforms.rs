//! Echoes of waveforms: the sensor's detector, and the finder for recordings of other instruments.

use std::path::Path;

use echoloop_closed_loop::config::parse;
use echoloop_dsp::{Echo, Pipeline, Scratch};
use echoloop_instruments::response::LEAST_ECHOES;
use echoloop_instruments::{
    Finder, Kind, Noise, Options, Polarity, Response, Rows, Selection, parse_waveforms,
};
use numpy::{PyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;

use crate::arguments::{array, shape_error, value};
use crate::threads::detached;

/// Waveforms that a thread takes at a time.
const AT_A_TIME: usize = 64;

/// The sensor's detector: codes of its converter to echoes, bit by bit as the firmware has them.
///
/// Keywords are the parameters of `echoloop config --parameters` without `lidar.`, as `gain=20` or
/// `echo_choice="last"`; the others keep their defaults. `shots` is 1.
#[pyclass(frozen, module = "echoloop")]
pub(crate) struct Detector {
    pipeline: Pipeline,
    bins: usize,
}

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (**settings))]
    fn new(settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut section = "[lidar]\n".to_owned();
        for (key, setting) in settings.iter().flat_map(|settings| settings.iter()) {
            let key: String = key.extract()?;
            let line = format!("{key} = {}\n", toml_value(&key, &setting)?);
            parse(&format!("[lidar]\n{line}")).map_err(|problem| {
                // The lines before it show where in the text.
                value(&key, problem.lines().last().unwrap_or(&problem))
            })?;
            section += &line;
        }
        let config = parse(&section).map_err(PyValueError::new_err)?;
        let settings = config.lidar.0;
        if settings.shots != 1 {
            return Err(value("shots", "expected 1: each waveform is of one shot"));
        }
        let pipeline = Pipeline::new(&settings, &config.hardware());
        let pipeline = pipeline.map_err(|refusal| PyValueError::new_err(refusal.to_string()))?;
        Ok(Self { pipeline, bins: settings.bins as usize })
    }

    /// Number of samples of a waveform: those before the trigger, then the range window.
    #[getter]
    fn samples(&self) -> usize {
        self.pipeline.config().codes()
    }

    /// Echoes of waveforms, `(N, samples)` uint16, as columns of equal length.
    ///
    /// waveform (row, uint32), range_m, amplitude (of full scale), width_ns, snr, range_sd_m,
    /// reflectivity (1 is white) and flags (a tuple of words for each echo).
    fn process<'py>(
        &self,
        py: Python<'py>,
        codes: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (codes, length) = crate::arguments::codes("codes", codes)?;
        let expected = self.samples();
        if length != expected {
            let problem = format!("expected {expected} samples a waveform, found {length}");
            return Err(value("codes", problem));
        }
        let found: Vec<Vec<Echo>> = detached(py, || {
            let rows = codes.par_chunks_exact(length).with_min_len(AT_A_TIME);
            let find = |scratch: &mut Box<Scratch>, row: &[u16]| {
                echoloop_kernels::process(&self.pipeline, row, scratch).to_vec()
            };
            rows.map_init(|| Box::new(Scratch::new()), find).collect()
        });
        let echoes =
            || (0_u32..).zip(&found).flat_map(|(row, of)| of.iter().map(move |e| (row, e)));
        let columns = PyDict::new(py);
        let column = |name: &str, of: fn(&Echo) -> f64| {
            columns.set_item(
                name,
                PyArray1::from_iter(py, echoes().map(|(_, echo)| of(echo)).collect::<Vec<f64>>()),
            )
        };
        columns
            .set_item("waveform", PyArray1::from_vec(py, echoes().map(|(row, _)| row).collect()))?;
        column("range_m", Echo::range_m)?;
        column("amplitude", |echo| echo.amplitude_fraction().to_num())?;
        column("width_ns", |echo| echo.width_ns().to_num())?;
        column("snr", |echo| echo.snr_ratio().to_num())?;
        column("range_sd_m", |echo| echo.deviation_mm().to_num::<f64>() / 1e3)?;
        column("reflectivity", |echo| echo.reflectivity_ratio().to_num())?;
        let flags =
            echoes().map(|(_, echo)| PyTuple::new(py, echo.flags.names().collect::<Vec<_>>()));
        columns.set_item("flags", flags.collect::<PyResult<Vec<_>>>()?)?;
        Ok(columns)
    }

    fn __repr__(&self) -> String {
        format!("<Detector of {} bins>", self.bins)
    }
}

/// A number or a word, as a configuration has it.
fn toml_value(key: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(whole) = given.extract::<i64>() {
        return Ok(whole.to_string());
    }
    if let Ok(number) = given.extract::<f64>() {
        return Ok(format!("{number:?}").to_lowercase()); // TOML has nan and inf
    }
    let is_word = |word: &String| word.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    let word = given.extract::<String>().ok().filter(is_word);
    let expected = || PyTypeError::new_err(format!("{key}: expected a number or a word"));
    Ok(format!("\"{}\"", word.ok_or_else(expected)?))
}

/// Rows of an array, as those of a file of it ([`parse_waveforms`]).
fn rows(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<Rows> {
    let array = array(argument, given)?;
    if !matches!(array.shape().len(), 1 | 2) {
        return Err(shape_error(argument, "(N, samples)", &array));
    }
    let py = given.py();
    let file = py.import("io")?.getattr("BytesIO")?.call0()?;
    py.import("numpy")?.call_method1("save", (&file, array))?;
    let bytes: Vec<u8> = file.call_method0("getvalue")?.extract()?;
    let from = Selection { name: None, kind: Kind::Received };
    let rows = detached(py, || parse_waveforms(Path::new(argument), bytes, &from));
    rows.map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Echoes of recorded waveforms, `(N, samples)` of any numbers, as columns of equal length.
///
/// Finds what `echoloop echoes` finds in a `.npy` of the same array; missing samples are NaN.
/// `sample_ns` is the time between samples, `outgoing` the emitted pulse of each row, or one for
/// all, `polarity` "positive" or "negative", `snr` the least height over the noise, `floor` the
/// least height over the highest of the row. With `response`, tops that the instrument makes after
/// its strong echoes are left out.
///
/// waveform (row, uint32), time_ns (after the row's first sample), amplitude (in the samples'
/// units), width_ns, snr and flags (a tuple of words for each echo).
#[pyfunction]
#[pyo3(signature = (
    waves, sample_ns, *, outgoing = None, polarity = None, snr = 5.0, floor = 0.05,
    max_echoes = 32, min_separation_ns = 0.0, response = true,
))]
#[expect(clippy::too_many_arguments, reason = "keywords of a call in Python")]
pub(crate) fn find_echoes<'py>(
    py: Python<'py>,
    waves: &Bound<'py, PyAny>,
    sample_ns: f64,
    outgoing: Option<&Bound<'py, PyAny>>,
    polarity: Option<&str>,
    snr: f64,
    floor: f64,
    max_echoes: usize,
    min_separation_ns: f64,
    response: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let options = Options { sample_ns, snr, floor, max_echoes, min_separation_ns };
    options.check().map_err(|error| PyValueError::new_err(error.to_string()))?;
    let polarity = match polarity {
        None => None,
        Some("positive") => Some(Polarity::Positive),
        Some("negative") => Some(Polarity::Negative),
        Some(other) => {
            let problem = format!("expected positive or negative, found {other:?}");
            return Err(value("polarity", problem));
        }
    };
    let waves = rows("waves", waves)?;
    let outgoing = outgoing.map(|outgoing| rows("outgoing", outgoing)).transpose()?;
    if let Some(found) = outgoing.as_ref().map(Rows::len).filter(|&n| n != 1 && n != waves.len()) {
        let problem = format!("expected 1 row or {}, as waves has, found {found}", waves.len());
        return Err(value("outgoing", problem));
    }
    let found = detached(py, || {
        let waves = waves.with_polarity(polarity);
        let outgoing = outgoing.map(|outgoing| outgoing.with_polarity(polarity));
        let noise = Noise::of_rows(&waves);
        let shape =
            || Response::of_rows(&waves, LEAST_ECHOES, outgoing.as_ref(), noise.clone()).ok();
        let known = if response { shape() } else { None };
        let finder = Finder::new(options).with_noise(noise.clone()).with_response(known);
        finder.find_some(&waves, outgoing.as_ref(), 0..waves.len())
    });
    let echoes = || found.iter().flat_map(|of| of.echoes.iter().map(|echo| (of.waveform, echo)));
    let columns = PyDict::new(py);
    let rows = echoes().map(|(row, _)| row as u32).collect();
    columns.set_item("waveform", PyArray1::<u32>::from_vec(py, rows))?;
    for (name, of) in [
        ("time_ns", (|echo| echo.time_ns) as fn(&echoloop_instruments::Echo) -> f64),
        ("amplitude", |echo| echo.amplitude),
        ("width_ns", |echo| echo.width_ns),
        ("snr", |echo| echo.snr),
    ] {
        let column = echoes().map(|(_, echo)| of(echo)).collect();
        columns.set_item(name, PyArray1::<f64>::from_vec(py, column))?;
    }
    let flags = echoes().map(|(_, echo)| PyTuple::new(py, &echo.flags));
    columns.set_item("flags", flags.collect::<PyResult<Vec<_>>>()?)?;
    Ok(columns)
}
