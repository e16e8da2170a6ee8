//! Counts of the detector's instructions on microcontrollers.

use std::collections::BTreeMap;

use echoloop_dsp::{DetectorConfig, Hardware, Settings};

use super::Processor;

/// Counts that `cargo xtask cost --update` writes.
const TABLE: &str = include_str!("../../../../firmware/image/cost.tsv");

/// Counted waveform.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Case {
    /// Name in the table: `800x12 four echoes, near gain`.
    pub(super) name: &'static str,
    /// Size of the waveform.
    pub(super) load: Load,
    /// Instructions of each stage.
    pub(super) stages: BTreeMap<&'static str, f64>,
}

/// Quantities that the instructions of a waveform depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Load {
    /// Number of samples.
    pub(super) samples: f64,
    /// Number of taps of the filter.
    pub(super) taps: f64,
    /// Number of samples before the gain is full.
    pub(super) near_samples: f64,
    /// Number of echoes found.
    pub(super) echoes: f64,
    /// Number of echoes before the gain is full.
    pub(super) near_echoes: f64,
    /// True when more than one echo is kept: hidden echoes are then searched for.
    pub(super) several: bool,
    /// Number of shots.
    pub(super) shots: f64,
}

impl Load {
    /// Load of settings with these echoes a waveform; `None` for settings that are refused.
    pub(super) fn new(
        settings: &Settings,
        hardware: &Hardware,
        [echoes, near_echoes]: [f64; 2],
    ) -> Option<Self> {
        let config = DetectorConfig::new(settings, hardware).ok()?;
        Some(Self {
            samples: f64::from(settings.bins) + f64::from(settings.pre_trigger_samples()),
            taps: config.template.taps().len() as f64,
            near_samples: config.ramp.as_ref().map_or(0.0, |ramp| ramp.samples() as f64),
            echoes,
            near_echoes,
            several: settings.echoes > 1,
            shots: f64::from(settings.shots),
        })
    }
}

/// Range below which the gain still rises, mm; 0 for a constant gain.
pub(super) fn near_mm(settings: &Settings) -> u32 {
    match settings.gain_slope_mdb_m {
        0 => 0,
        _ => settings.gain_range_mm as u32,
    }
}

/// Counted waveforms of a processor with its loops.
pub(super) fn cases(of: &Processor) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in TABLE.lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        let [processor, loops, name, stage, instructions] = fields[..] else { continue };
        let (true, Ok(instructions)) =
            ([processor, loops] == [of.name, of.loops], instructions.parse())
        else {
            continue;
        };
        match cases.iter_mut().find(|case| case.name == name) {
            Some(case) => drop(case.stages.insert(stage, instructions)),
            None => cases.extend(load(name).map(|load| Case {
                name,
                load,
                stages: BTreeMap::from([(stage, instructions)]),
            })),
        }
    }
    cases
}

/// Load by the name of a case: `256x16 one echo` has 256 samples and 16 taps.
fn load(name: &str) -> Option<Load> {
    let (size, rest) = name.split_once(' ')?;
    let (samples, taps) = size.split_once('x')?;
    let (echoes, near) = (rest.split(',').next()?, rest.ends_with("near gain"));
    let [found, kept] = match echoes {
        "noise" => [0.0, 1.0],
        "one echo" => [1.0, 1.0],
        "one echo of four" => [1.0, 4.0],
        "four echoes" => [4.0, 4.0],
        _ => return None,
    };
    let [near_samples, near_echoes] = if near { [NEAR_SAMPLES, 1.0] } else { [0.0, 0.0] };
    Some(Load {
        samples: samples.parse().ok()?,
        taps: taps.parse().ok()?,
        near_samples,
        echoes: found,
        near_echoes,
        several: kept > 1.0,
        shots: 1.0,
    })
}

/// Samples before 40 m, where the gain of the near case is full: 39 of 119 m. One of its four
/// echoes is nearer.
const NEAR_SAMPLES: f64 = 800.0 * 39.0 / 119.0;
