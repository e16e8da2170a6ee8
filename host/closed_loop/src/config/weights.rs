//! `[tune.weights]`: weights of a scan's costs beside the error.

use echoloop_parameters::{Bounds, section};
use serde::{Deserialize, Serialize};

use crate::cost::{CostKind, ScanCost};

section! {
    /// Powers of a scan's costs, each over the start's, that the error is multiplied by.
    ///
    /// With 0.05 of energy a tenth of the light is worth 11 % of the error. 0: it does not count.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [tune.weights]")]
    pub struct Weights in "tune.weights" {
        energy: f64, "", Bounds::between(0.0, 10.0),
            "Power of the light emitted, over the start's, that the error is multiplied by; 0: it \
             does not count.";
        instructions: f64, "", Bounds::between(0.0, 10.0),
            "The same of the detector's instructions a waveform.";
        bits: f64, "", Bounds::between(0.0, 10.0),
            "The same of the bits on the link.";
        seconds: f64, "", Bounds::between(0.0, 10.0),
            "The same of the time.";
    }
}

impl Default for Weights {
    fn default() -> Self {
        Self { energy: 0.05, instructions: 0.0, bits: 0.0, seconds: 0.0 }
    }
}

impl Weights {
    fn of(&self, kind: CostKind) -> f64 {
        match kind {
            CostKind::Energy => self.energy,
            CostKind::Instructions => self.instructions,
            CostKind::Bits => self.bits,
            CostKind::Seconds => self.seconds,
        }
    }

    /// The product of the costs over those of another, each to its power.
    pub fn factor(&self, cost: &ScanCost, reference: &ScanCost) -> f64 {
        let power = |kind: CostKind| match self.of(kind) {
            0.0 => 1.0,
            weight => libm::pow(kind.of(cost) / kind.of(reference), weight),
        };
        CostKind::ALL.into_iter().map(power).product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_counts_by_its_power_and_one_without_weight_not_at_all() {
        let cost =
            |energy_j: f64| ScanCost { energy_j, instructions: f64::NAN, bits: 9.0, seconds: 4.0 };
        let other = ScanCost { energy_j: 1.0, instructions: 1.0, bits: 3.0, seconds: 1.0 };
        let weights = Weights { energy: 0.5, instructions: 0.0, bits: 1.0, seconds: 0.5 };
        assert!((weights.factor(&cost(0.25), &other) - 0.5 * 3.0 * 2.0).abs() < 1e-12);
        let tenth = Weights::default().factor(&cost(0.1), &other);
        assert!((tenth - 0.891).abs() < 1e-3, "{tenth}");
    }
}
