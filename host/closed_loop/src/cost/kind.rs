//! Kinds of cost.

use serde::{Deserialize, Serialize};

use super::ScanCost;

/// Kind of cost of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum CostKind {
    /// Emitted light.
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
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Energy, Self::Instructions, Self::Bits, Self::Seconds];

    /// Name in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Instructions => "instructions",
            Self::Bits => "bits",
            Self::Seconds => "time",
        }
    }

    /// Name in the configuration.
    pub fn key(self) -> &'static str {
        if self == Self::Seconds { "seconds" } else { self.name() }
    }

    /// Title of a column.
    pub fn title(self) -> &'static str {
        match self {
            Self::Energy => "energy of a scan",
            Self::Instructions => "instructions a waveform",
            Self::Bits => "bits of a scan",
            Self::Seconds => "time of a scan",
        }
    }

    /// Names of the parameters that it depends on. Empty where it depends on all of the sensor's,
    /// for each may change the number of echoes.
    pub fn changed_by(self) -> &'static [&'static str] {
        match self {
            Self::Energy => {
                &["lidar.power", "lidar.pulse_width", "lidar.shots", "lidar.columns", "lidar.rows"]
            }
            Self::Seconds => &["lidar.shots", "lidar.frame_time"],
            Self::Instructions | Self::Bits => &[],
        }
    }

    /// Unit; empty for plain numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Energy => "J",
            Self::Instructions => "",
            Self::Bits => "bit",
            Self::Seconds => "s",
        }
    }

    /// Value of this kind.
    pub fn of(self, cost: &ScanCost) -> f64 {
        match self {
            Self::Energy => cost.energy_j,
            Self::Instructions => cost.instructions,
            Self::Bits => cost.bits,
            Self::Seconds => cost.seconds,
        }
    }

    /// Value in three digits with SI prefix and unit: `4.61 mJ`.
    pub fn text(self, value: f64) -> String {
        if !value.is_finite() || value <= 0.0 {
            return "–".into();
        }
        // A value that rounds up to 1000 takes the next prefix.
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
    fn a_cost_is_printed_in_three_digits() {
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
