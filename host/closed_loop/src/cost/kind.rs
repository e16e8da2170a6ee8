//! Which of the costs.

use serde::{Deserialize, Serialize};

use super::ScanCost;

/// One of the costs of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum CostKind {
    /// Light emitted.
    #[default]
    Energy,
    /// Instructions of the detector a waveform.
    Instructions,
    /// Bits on the link.
    Bits,
    /// Time of a scan.
    Seconds,
}

impl CostKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Energy, Self::Instructions, Self::Bits, Self::Seconds];

    /// As a sentence has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Instructions => "instructions",
            Self::Bits => "bits",
            Self::Seconds => "time",
        }
    }

    /// As the configuration has it.
    pub fn key(self) -> &'static str {
        if self == Self::Seconds { "seconds" } else { self.name() }
    }

    /// As the head of a column has it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Energy => "energy of a scan",
            Self::Instructions => "instructions a waveform",
            Self::Bits => "bits of a scan",
            Self::Seconds => "time of a scan",
        }
    }

    /// The parameters that it hangs on, by name; none: on any of the sensor's, for each may change
    /// how many echoes there are.
    pub fn changed_by(self) -> &'static [&'static str] {
        match self {
            Self::Energy => &["lidar.power", "lidar.pulse_width", "lidar.shots"],
            Self::Seconds => &["lidar.shots"],
            Self::Instructions | Self::Bits => &[],
        }
    }

    /// Its unit; empty for plain numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Energy => "J",
            Self::Instructions => "",
            Self::Bits => "bit",
            Self::Seconds => "s",
        }
    }

    /// Its value.
    pub fn of(self, cost: &ScanCost) -> f64 {
        match self {
            Self::Energy => cost.energy_j,
            Self::Instructions => cost.instructions,
            Self::Bits => cost.bits,
            Self::Seconds => cost.seconds,
        }
    }

    /// A value with its unit, three digits and an SI prefix: `4.61 mJ`.
    pub fn text(self, value: f64) -> String {
        if !value.is_finite() || value <= 0.0 {
            return "–".into();
        }
        // Of what rounds up to a thousand, the next.
        let exponent = (libm::log10(value * 1.000_5).floor() as i32).clamp(-18, 14);
        let thousands = exponent.div_euclid(3);
        let digits = value / libm::pow(10.0, f64::from(3 * thousands));
        let decimals = (2 - exponent.rem_euclid(3)) as usize;
        let prefix = PREFIXES.get((thousands + 6) as usize).copied().unwrap_or_default();
        format!("{digits:.decimals$} {prefix}{}", self.unit()).trim_end().to_owned()
    }
}

const PREFIXES: [&str; 11] = ["a", "f", "p", "n", "µ", "m", "", "k", "M", "G", "T"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_is_said_in_three_digits() {
        let energy = |value| CostKind::Energy.text(value);
        assert_eq!(energy(4.608e-3), "4.61 mJ");
        assert_eq!(energy(0.999_7), "1.00 J");
        assert_eq!(energy(99.96e-6), "100 µJ");
        assert_eq!(energy(12_288.0 * 2e-14), "246 pJ");
        assert_eq!(CostKind::Instructions.text(25_211.0), "25.2 k");
        assert_eq!(CostKind::Bits.text(1.7e6), "1.70 Mbit");
        assert_eq!(CostKind::Seconds.text(9.837e-3), "9.84 ms");
        assert_eq!(CostKind::Seconds.text(f64::NAN), "–");
    }
}
