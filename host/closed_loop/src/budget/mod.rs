//! Budget of a sensor: what its light, its converter, its link and its time allow.

pub mod eye_safety;

use std::fmt;

use echoloop_dsp::{Hardware, ScanPattern, Settings, pulse_energy_pj};
use echoloop_parameters::{Bounds, section};
use serde::{Deserialize, Serialize};

section! {
    /// What a scan may use. A search repairs candidates beyond it; 0: no limit.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [budget]")]
    pub struct Budget in "budget" {
        class_1: bool, "", Bounds::FLAG,
            "Eye safety: each pulse within class 1 of IEC 60825-1 at `wavelength_nm`.";
        wavelength_nm: f64, "nm", Bounds::between(700.0, 1050.0),
            "Wavelength of the laser, for eye safety.";
        frame_ms: f64, "ms", Bounds::between(10.0, 1000.0),
            "Longest time of a steered scan; that of a scan whose pattern has none of its own.";
        light_mw: f64, "mW", Bounds::between(0.0, 1e4),
            "Most light emitted, in the mean.";
        shots_per_s: f64, "1/s", Bounds::between(0.0, 1e9),
            "Most shots a second.";
        msamples_per_s: f64, "10⁶/s", Bounds::between(0.0, 1e6),
            "Most samples a second of converter and detector, millions.";
        mbit_per_s: f64, "Mbit/s", Bounds::between(0.0, 1e6),
            "Most bits a second on the link, if every beam has as many echoes as are kept, Mbit/s.";
    }
}

impl Default for Budget {
    fn default() -> Self {
        Self::NONE
    }
}

impl Budget {
    /// Budget of a sensor on sale, the Unitree 4D LiDAR L2 by its data sheet: class 1, 64,000
    /// points a second over 360° × 96°, Ethernet. One converter of 1 GS/s (AD9094, of Analog
    /// Devices' LiDAR kit) reads 0.8 µs for each point. The light is that of the paper's pulses,
    /// 75 W for 5 ns, as no data sheet states its own.
    pub const UNITREE_L2: Self = Self {
        class_1: true,
        light_mw: 24.0,
        shots_per_s: 64_000.0,
        msamples_per_s: 51.2,
        mbit_per_s: 100.0,
        ..Self::NONE
    };

    /// Budget of the Livox Mid-360 by its data sheet, else as [`Self::UNITREE_L2`]: class 1 at
    /// 905 nm, 200,000 points a second over 360° × 59°, 100BASE-TX.
    pub const MID_360: Self =
        Self { light_mw: 75.0, shots_per_s: 200_000.0, msamples_per_s: 160.0, ..Self::UNITREE_L2 };

    /// Budget of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, budget)| *budget)
    }

    /// Budgets that have a name.
    pub const NAMED: [(&str, Self); 3] =
        [("none", Self::NONE), ("unitree-l2", Self::UNITREE_L2), ("mid-360", Self::MID_360)];

    /// No limit.
    pub const NONE: Self = Self {
        class_1: false,
        wavelength_nm: 905.0,
        frame_ms: 100.0,
        light_mw: 0.0,
        shots_per_s: 0.0,
        msamples_per_s: 0.0,
        mbit_per_s: 0.0,
    };

    /// Time of a scan, s, by a pattern with its aim.
    pub(crate) fn frame_s(&self, pattern: &ScanPattern) -> f64 {
        match pattern.duration_s() {
            0.0 => self.frame_ms / 1e3,
            own => own,
        }
    }

    /// What settings use. `pattern` has their aim.
    pub fn usage(&self, pattern: &ScanPattern, settings: &Settings) -> Usage {
        let frame_s = self.frame_s(pattern);
        let shots_per_s = f64::from(pattern.beams()) * f64::from(settings.shots) / frame_s;
        let pulse_pj = pulse_energy_pj(settings.power_uw, settings.pulse_width_ps);
        let pulse_j = f64::from(pulse_pj) * 1e-12;
        let class_1_j = match self.class_1 {
            true => eye_safety::class_1_pulse_j(self.wavelength_nm, pattern, settings, frame_s),
            false => f64::INFINITY,
        };
        Usage {
            is_steered: matches!(pattern, ScanPattern::Steered(_)),
            frame_ms: 1e3 * frame_s,
            pulse_nj: 1e9 * pulse_j,
            class_1_nj: 1e9 * class_1_j,
            light_mw: 1e3 * pulse_j * shots_per_s,
            shots_per_s,
            msamples_per_s: 1e-6 * samples_a_shot(settings) * shots_per_s,
            mbit_per_s: 1e-6 * bits_a_beam(settings) * f64::from(pattern.beams()) / frame_s,
        }
    }

    /// The first limit that settings are beyond, if any. `pattern` has their aim.
    pub fn exceeded(&self, pattern: &ScanPattern, settings: &Settings) -> Option<Exceeded> {
        let usage = self.usage(pattern, settings);
        let beyond = |row: &Row| row.limit.is_some_and(|limit| row.used > limit * SLACK);
        usage.rows(self).into_iter().find(beyond).map(Exceeded)
    }

    /// Energy that a pulse may have, pJ: the hardware's limit, or less. `pattern` has the settings'
    /// aim.
    pub(crate) fn pulse_limit_pj(
        &self,
        hardware: &Hardware,
        pattern: &ScanPattern,
        settings: &Settings,
    ) -> u32 {
        let usage = self.usage(pattern, settings);
        let light_nj = match self.light_mw {
            0.0 => f64::INFINITY,
            limit => 1e6 * limit / usage.shots_per_s,
        };
        let most_nj = usage.class_1_nj.min(light_nj);
        ((1e3 * most_nj) as u32).min(hardware.energy_limit_pj) // `as` saturates
    }

    /// Beams of a scan of `frame_s` that shots, samples and bits allow, in this order.
    pub(crate) fn most_beams(&self, settings: &Settings, frame_s: f64) -> [f64; 3] {
        let shots = f64::from(settings.shots);
        let most = |limit: f64, of_beam: f64| match limit {
            0.0 => f64::INFINITY,
            limit => limit * frame_s / of_beam,
        };
        [
            most(self.shots_per_s, shots),
            most(1e6 * self.msamples_per_s, shots * samples_a_shot(settings)),
            most(1e6 * self.mbit_per_s, bits_a_beam(settings)),
        ]
    }
}

fn samples_a_shot(settings: &Settings) -> f64 {
    f64::from(settings.bins) + f64::from(settings.pre_trigger_samples())
}

/// Bits of a beam on the link if it has as many echoes as are kept.
fn bits_a_beam(settings: &Settings) -> f64 {
    BITS_A_BEAM + BITS_AN_ECHO * f64::from(settings.echoes)
}

/// Rounding of a limit in the check.
const SLACK: f64 = 1.0 + 1e-9;

/// Bits of a beam without an echo, and of an echo, both ways, frames included: bounds of
/// [`echoloop_sensors::size::scan_bits`], which a test compares them with.
const BITS_A_BEAM: f64 = 20.0;
const BITS_AN_ECHO: f64 = 152.0;

/// What settings use of a budget.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    /// True when the settings have the time of a scan.
    pub is_steered: bool,
    /// Time of a scan, ms.
    pub frame_ms: f64,
    /// Energy of a pulse, nJ.
    pub pulse_nj: f64,
    /// Energy of a pulse that class 1 allows this scan, nJ; infinite where the budget is not to
    /// keep it, as counting the pulses takes long.
    pub class_1_nj: f64,
    /// Light, mW.
    pub light_mw: f64,
    /// Shots a second.
    pub shots_per_s: f64,
    /// Samples a second, millions.
    pub msamples_per_s: f64,
    /// Bits a second on the link at most, Mbit/s.
    pub mbit_per_s: f64,
}

/// One limit of a budget and its use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Key of the limit.
    pub key: &'static str,
    /// Name, to be read.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Use.
    pub used: f64,
    /// Limit; None without one.
    pub limit: Option<f64>,
}

impl Usage {
    /// Limits of a budget and the use of each.
    pub fn rows(&self, budget: &Budget) -> [Row; 6] {
        let row = |key, name, unit, used, limit: f64| Row {
            key,
            name,
            unit,
            used,
            limit: (limit > 0.0).then_some(limit),
        };
        let class_1_nj = if budget.class_1 { self.class_1_nj } else { 0.0 };
        let frame_ms = if self.is_steered { budget.frame_ms } else { 0.0 };
        [
            row("budget.frame_ms", "time of a scan", "ms", self.frame_ms, frame_ms),
            row("budget.class_1", "energy of a pulse", "nJ", self.pulse_nj, class_1_nj),
            row("budget.light_mw", "light", "mW", self.light_mw, budget.light_mw),
            row(
                "budget.shots_per_s",
                "shots a second",
                "1/s",
                self.shots_per_s,
                budget.shots_per_s,
            ),
            row(
                "budget.msamples_per_s",
                "samples a second",
                "10⁶/s",
                self.msamples_per_s,
                budget.msamples_per_s,
            ),
            row("budget.mbit_per_s", "bits a second", "Mbit/s", self.mbit_per_s, budget.mbit_per_s),
        ]
    }
}

/// A limit that settings are beyond.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub struct Exceeded(pub Row);

impl fmt::Display for Exceeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Row { key, name, unit, used, limit } = self.0;
        let limit = limit.unwrap_or(f64::INFINITY);
        write!(f, "{name}: {used:.4} {unit} are used, and {key} allows {limit:.4}")
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{Echo, Echoes, Rosette, Steered};
    use echoloop_link::settings_hash;
    use echoloop_sensors::size::scan_bits;

    use super::*;

    #[test]
    fn the_paper_s_sensor_uses_46_mw_and_98_million_samples_a_second() {
        let usage = Budget::NONE.usage(&ScanPattern::default(), &Settings::default());
        assert!((usage.pulse_nj - 375.0).abs() < 1e-9);
        assert!((usage.shots_per_s - 122_880.0).abs() < 1e-6);
        assert!((usage.light_mw - 46.08).abs() < 1e-6);
        assert!((usage.msamples_per_s - 98.304).abs() < 1e-9);
        assert_eq!(Budget::NONE.exceeded(&ScanPattern::default(), &Settings::default()), None);
    }

    #[test]
    fn only_a_scan_whose_time_is_set_can_take_too_long() {
        let slow = ScanPattern::Rosette(Rosette { beams: 50_000, ..Rosette::MID_40 });
        assert_eq!(Budget::NONE.exceeded(&slow, &Settings::default()), None);
        let mut steered = Steered::REFERENCE;
        steered.aim.frame_us = 100_001;
        let exceeded = Budget::NONE.exceeded(&ScanPattern::Steered(steered), &Settings::default());
        let said = exceeded.map(|exceeded| exceeded.to_string()).unwrap_or_default();
        assert_eq!(
            said,
            "time of a scan: 100.0010 ms are used, and budget.frame_ms allows 100.0000"
        );
    }

    #[test]
    fn a_limit_is_named_with_what_is_used_and_what_there_is() {
        let check = |budget: Budget| {
            let exceeded = budget.exceeded(&ScanPattern::default(), &Settings::default());
            exceeded.map(|exceeded| exceeded.to_string()).unwrap_or_default()
        };
        let none = Budget::NONE;
        assert_eq!(
            check(Budget { light_mw: 46.0, ..none }),
            "light: 46.0800 mW are used, and budget.light_mw allows 46.0000"
        );
        assert_eq!(check(Budget { light_mw: 46.08, ..none }), "");
        assert!(check(Budget { class_1: true, ..none }).starts_with("energy of a pulse: 375"));
        assert!(check(Budget { shots_per_s: 1e5, ..none }).starts_with("shots a second"));
        assert!(check(Budget { msamples_per_s: 98.0, ..none }).starts_with("samples a second"));
        assert!(check(Budget { mbit_per_s: 1.0, ..none }).starts_with("bits a second"));
    }

    #[test]
    fn the_bits_of_a_full_scan_are_within_the_bound_and_near_it() {
        let echo = Echo {
            range: 256_000 * 119,
            amplitude: 32_767,
            width: 300,
            snr: 40_000,
            deviation: 20_000,
            reflectivity: 40_000,
            ..Echo::default()
        };
        for echoes in [0, 1, 4] {
            let beam: Echoes = (0..echoes).map(|_| echo).collect();
            let bits = scan_bits(&vec![beam; 12_288], settings_hash(&Settings::default())) as f64;
            let bound = 12_288.0 * (BITS_A_BEAM + BITS_AN_ECHO * f64::from(echoes));
            assert!((0.5..=1.0).contains(&(bits / bound)), "{echoes}: {bits} of {bound}");
        }
    }
}
