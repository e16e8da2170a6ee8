//! The detector's instructions, as they were counted on the microcontroller.

use std::collections::BTreeMap;

use echoloop_dsp::{DetectorConfig, Hardware, Settings};

/// `cargo xtask cost --update` writes it.
const TABLE: &str = include_str!("../../../../firmware/image/cost.tsv");

/// Whose instructions a search counts: processor and loops.
pub(super) const REFERENCE: [&str; 2] = ["cortex-m4", "dual_multiply"];

/// A waveform that was counted.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Case {
    /// As the table has it: `800x12 four echoes, near gain`.
    pub(super) name: &'static str,
    /// What it hangs on.
    pub(super) load: Load,
    /// Instructions of each stage.
    pub(super) stages: BTreeMap<&'static str, f64>,
}

/// What the instructions of a waveform hang on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Load {
    /// Samples.
    pub(super) samples: f64,
    /// Taps of the filter.
    pub(super) taps: f64,
    /// Samples before the gain is full.
    pub(super) near_samples: f64,
    /// Echoes found.
    pub(super) echoes: f64,
    /// Those of them before the gain is full.
    pub(super) near_echoes: f64,
    /// Whether more than one echo is kept: what others hide is then looked for.
    pub(super) several: bool,
    /// Shots.
    pub(super) shots: f64,
}

impl Load {
    /// That of settings, with so many echoes a waveform; `None` of settings that are refused.
    pub(super) fn new(
        settings: &Settings,
        hardware: &Hardware,
        [echoes, near_echoes]: [f64; 2],
    ) -> Option<Self> {
        let config = DetectorConfig::new(settings, hardware).ok()?;
        Some(Self {
            samples: f64::from(settings.bins) + f64::from(settings.pre_trigger_samples()),
            taps: config.template().taps().len() as f64,
            near_samples: config.ramp().map_or(0.0, |ramp| ramp.samples() as f64),
            echoes,
            near_echoes,
            several: settings.echoes > 1,
            shots: f64::from(settings.shots),
        })
    }
}

/// Echoes nearer than that, in mm, are detected at a gain that still rises; 0: it never does.
pub(super) fn near_mm(settings: &Settings) -> u32 {
    match settings.gain_slope_mdb_m {
        0 => 0,
        _ => settings.gain_range_mm as u32,
    }
}

/// What was counted on a processor with its loops, waveform by waveform.
pub(super) fn cases(of: [&str; 2]) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in TABLE.lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        let [processor, loops, name, stage, instructions] = fields[..] else { continue };
        let (true, Ok(instructions)) = ([processor, loops] == of, instructions.parse()) else {
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

/// What the name of a case says: `256x16 one echo` are 256 samples and 16 taps.
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

/// Of the case with a gain that rises to 40 m: 39 of 119 m are before, and the first of four
/// echoes.
const NEAR_SAMPLES: f64 = 800.0 * 39.0 / 119.0;
