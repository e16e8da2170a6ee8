//! Processors whose instructions were counted.

use std::sync::LazyLock;

use echoloop_dsp::{Hardware, Settings};
use serde::Serialize;

use super::instructions::Model;
use super::record::{cases, near_mm};

/// Processor with the fastest loops for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Processor {
    /// Name in `firmware/image/cost.tsv`.
    #[serde(rename = "processor")]
    pub name: &'static str,
    /// Name of its loops there.
    pub loops: &'static str,
    /// Part with this processor.
    pub part: &'static str,
    /// Highest clock of that part by its data sheet, MHz.
    pub clock_mhz: f64,
}

impl Processor {
    /// Processor whose instructions a search counts.
    pub const REFERENCE: Self =
        Self { name: "cortex-m4", loops: "dual_multiply", part: "STM32F405", clock_mhz: 168.0 };

    /// All processors, the slowest part first.
    pub const ALL: [Self; 5] = [
        Self { name: "rv32imac", loops: "scalar", part: "RP2350", clock_mhz: 150.0 },
        Self::REFERENCE,
        Self { name: "cortex-m33", loops: "dual_multiply", part: "STM32H563", clock_mhz: 250.0 },
        Self { name: "cortex-m7", loops: "dual_multiply", part: "STM32H723", clock_mhz: 550.0 },
        Self { name: "cortex-m55", loops: "mve", part: "STM32N657", clock_mhz: 800.0 },
    ];

    /// Instructions of the detector for a beam with `echoes` echoes, all its shots together; `None`
    /// for settings that are refused.
    pub fn instructions(
        &self,
        settings: &Settings,
        hardware: &Hardware,
        echoes: u32,
    ) -> Option<f64> {
        let near_echoes = if near_mm(settings) > 0 { f64::from(echoes.min(1)) } else { 0.0 };
        self.model()?.of(settings, hardware, [echoes.into(), near_echoes])
    }

    /// Fitted model; `None` for a processor not in [`Self::ALL`].
    pub(super) fn model(&self) -> Option<&'static Model> {
        MODELS.iter().find(|(processor, _)| processor == self).map(|(_, model)| model)
    }
}

static MODELS: LazyLock<Vec<(Processor, Model)>> = LazyLock::new(|| {
    Processor::ALL.map(|processor| (processor, Model::fitted(&cases(&processor)))).into()
});

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight samples at a time make steps that a linear model does not follow.
    #[test]
    fn the_model_is_within_six_percent_of_the_counts_and_eleven_on_the_cortex_m55() {
        for (processor, model) in MODELS.iter() {
            let cases = cases(processor);
            assert!(cases.len() >= 8, "{} cases of {}", cases.len(), processor.name);
            for case in &cases {
                let off = model.instructions(&case.load) / case.stages["pipeline"] - 1.0;
                let most = if processor.loops == "mve" { 0.11 } else { 0.06 };
                assert!(off.abs() < most, "{}, {}: {off:+.3}", processor.name, case.name);
            }
        }
    }

    #[test]
    fn more_echoes_take_more_instructions_and_refused_settings_have_no_count() {
        let hardware = Hardware::REFERENCE;
        let settings = Settings { echoes: 4, ..Settings::default() };
        for processor in Processor::ALL {
            let of = |echoes| processor.instructions(&settings, &hardware, echoes).unwrap();
            assert!(of(0) < of(1) && of(1) < of(4), "{}", processor.name);
            let wrong = Settings { bins: 1, ..settings };
            assert_eq!(processor.instructions(&wrong, &hardware, 1), None);
        }
    }
}
