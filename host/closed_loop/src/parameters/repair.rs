//! Joint constraints of the sensor: a candidate that breaks one is repaired, and the repair
//! reported. The sensor would refuse it.

use echoloop_dsp::{Hardware, ParameterId, Settings};

use super::Device;
use super::aim::{Columns, repair_aim, repair_counts};

/// Limits of a repair where there is a choice: codes, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Least power, µW.
    pub least_power_uw: i32,
    /// Shortest and longest pulse, ps.
    pub pulse_ps: [i32; 2],
}

impl Limits {
    /// The sensor's own limits.
    pub fn of_sensor() -> Self {
        let width = ParameterId::PulseWidth.parameter();
        let least_power_uw = ParameterId::Power.parameter().min;
        Self { least_power_uw, pulse_ps: [width.min, width.max] }
    }
}

/// Brings settings whose fields are each in range within the joint constraints; names what was
/// changed.
///
/// Too few samples a pulse: the pulse is widened up to its limit; beyond it, bins are added. Too
/// much energy: the power is lowered to its limit, then the pulse shortened; where neither is
/// enough, the power is lowered beyond its limit. The budget's light and eye safety count as
/// energy. More beams, samples or bits than the budget has: an aim that may change comes within
/// it and within the mount; else there are fewer shots, bins or echoes. A gain that rises beyond
/// the middle of the window: it rises up to there, or nowhere. (S > N holds by the ranges.)
pub fn repair(
    settings: &mut Settings,
    device: &Device,
    limits: &Limits,
    columns: Columns,
) -> Vec<&'static str> {
    let (mut repaired, hardware) = (Vec::new(), &device.hardware);
    let has_one_aim = columns == Columns::OfTheStart || device.steered().is_none();
    if has_one_aim {
        repaired.extend(repair_counts(settings, device));
    }
    if hardware.shortest_pulse_ps(settings.bins) > limits.pulse_ps[1] {
        settings.bins = bins_for(limits.pulse_ps[1], settings.bins, hardware);
        repaired.push(ParameterId::WaveformResolution.parameter().name);
    }
    let shortest_ps = hardware.shortest_pulse_ps(settings.bins);
    if settings.pulse_width_ps < shortest_ps {
        settings.pulse_width_ps = shortest_ps;
        repaired.push(ParameterId::PulseWidth.parameter().name);
    }
    if !has_one_aim {
        repaired.extend(repair_aim(settings, device, columns));
    }
    let energy_limit_pj = device.budget.pulse_limit_pj(hardware, &device.aimed(settings), settings);
    let hardware = &Hardware { energy_limit_pj, ..*hardware };
    let strongest_uw = hardware.strongest_power_uw(settings.pulse_width_ps);
    if settings.power_uw > strongest_uw {
        let shortest_ps = shortest_ps.max(limits.pulse_ps[0]);
        if let Some(id) = weaken(settings, hardware, limits.least_power_uw, shortest_ps) {
            repaired.push(id.parameter().name);
        }
        let strongest_uw = hardware.strongest_power_uw(settings.pulse_width_ps);
        if settings.power_uw > strongest_uw {
            settings.power_uw = strongest_uw;
            repaired.push(ParameterId::Power.parameter().name);
        }
    }
    let middle_mm = i32::try_from(hardware.middle_mm()).unwrap_or(i32::MAX);
    if settings.gain_slope_mdb_m > 0 && middle_mm < ParameterId::GainRange.parameter().min {
        settings.gain_slope_mdb_m = 0;
        repaired.push(ParameterId::GainSlope.parameter().name);
    } else if settings.gain_slope_mdb_m > 0 && settings.gain_range_mm > middle_mm {
        settings.gain_range_mm = middle_mm;
        repaired.push(ParameterId::GainRange.parameter().name);
    }
    repaired
}

/// Smallest number of bins, from `bins` up, that samples a pulse often enough; the maximum where
/// none does.
fn bins_for(width_ps: i32, bins: i32, hardware: &Hardware) -> i32 {
    let most = ParameterId::WaveformResolution.parameter().max;
    (bins..most).find(|&bins| hardware.shortest_pulse_ps(bins) <= width_ps).unwrap_or(most)
}

/// Shortens a pulse that has too much energy at the lowest allowed power, down to the shortest at
/// most. The power is then lowered as far as is still needed.
fn weaken(
    settings: &mut Settings,
    hardware: &Hardware,
    least_power_uw: i32,
    shortest_ps: i32,
) -> Option<ParameterId> {
    let power_uw = settings.power_uw.min(least_power_uw);
    if hardware.strongest_power_uw(settings.pulse_width_ps) >= power_uw {
        return None;
    }
    // 1 µW · 1 ps is 10⁻⁶ pJ.
    let longest_ps = i64::from(hardware.energy_limit_pj) * 1_000_000 / i64::from(power_uw.max(1));
    let longest_ps = i32::try_from(longest_ps).unwrap_or(i32::MAX);
    let fits = longest_ps >= shortest_ps && longest_ps < settings.pulse_width_ps;
    fits.then(|| {
        settings.pulse_width_ps = longest_ps;
        ParameterId::PulseWidth
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(hardware: &Hardware) -> Device {
        Device { hardware: *hardware, ..Device::REFERENCE }
    }

    fn repair(settings: &mut Settings, hardware: &Hardware) -> Vec<&'static str> {
        super::repair(settings, &device(hardware), &Limits::of_sensor(), Columns::AtMost)
    }

    #[test]
    fn where_the_power_may_not_fall_the_pulse_is_shortened_and_else_the_power_falls() {
        let wide = Settings { power_uw: 75_000_000, pulse_width_ps: 20_000, ..Settings::default() };
        let with = |least_power_uw, shortest_pulse_ps| {
            let (mut settings, hardware) = (wide, Hardware::REFERENCE);
            let limits = Limits { least_power_uw, pulse_ps: [shortest_pulse_ps, 20_000] };
            let repaired =
                super::repair(&mut settings, &device(&hardware), &limits, Columns::AtMost);
            settings.check(&hardware).unwrap();
            (repaired, settings.power_uw, settings.pulse_width_ps)
        };
        assert_eq!(with(75_000_000, 2_000), (vec!["pulse_width"], 75_000_000, 5_333));
        assert_eq!(
            with(40_000_000, 2_000),
            (vec!["pulse_width", "power"], 40_000_000, 10_000),
            "as little of either as must be"
        );
        assert_eq!(with(10_000_000, 2_000), (vec!["power"], 20_000_000, 20_000));
        assert_eq!(with(75_000_000, 20_000), (vec!["power"], 20_000_000, 20_000), "no other way");
    }

    #[test]
    fn a_pulse_that_may_not_be_widened_gets_as_many_bins_as_it_needs() {
        let hardware = Hardware::REFERENCE;
        let mut settings = Settings { bins: 200, pulse_width_ps: 5_000, ..Settings::default() };
        let limits = Limits { pulse_ps: [5_000, 5_000], ..Limits::of_sensor() };
        let repaired = super::repair(&mut settings, &device(&hardware), &limits, Columns::AtMost);
        assert_eq!((repaired, settings.pulse_width_ps), (vec!["waveform_resolution"], 5_000));
        settings.check(&hardware).unwrap();
        assert!(Settings { bins: settings.bins - 1, ..settings }.check(&hardware).is_err());
    }

    #[test]
    fn too_much_energy_lowers_the_power_to_the_limit() {
        let mut settings =
            Settings { power_uw: 100_000_000, pulse_width_ps: 20_000, ..Settings::default() };
        assert_eq!(repair(&mut settings, &Hardware::REFERENCE), ["power"]);
        assert_eq!((settings.power_uw, settings.pulse_width_ps), (20_000_000, 20_000));
        settings.check(&Hardware::REFERENCE).unwrap();
    }

    #[test]
    fn too_few_samples_widen_the_pulse_and_no_more_than_needed() {
        let mut settings = Settings { bins: 200, pulse_width_ps: 2_000, ..Settings::default() };
        assert_eq!(repair(&mut settings, &Hardware::REFERENCE), ["pulse_width", "power"]);
        settings.check(&Hardware::REFERENCE).unwrap();
        let shorter = Settings { pulse_width_ps: settings.pulse_width_ps - 1, ..settings };
        assert!(shorter.check(&Hardware::REFERENCE).is_err());
    }

    #[test]
    fn a_gain_that_rises_ends_in_the_middle_of_a_short_window() {
        let hardware = Hardware { range_max_mm: 50_000, ..Hardware::REFERENCE };
        let mut settings = Settings { gain_slope_mdb_m: 300, ..Settings::default() };
        assert_eq!(repair(&mut settings, &hardware), ["gain_range"]);
        assert_eq!(settings.gain_range_mm, 25_500);
        settings.check(&hardware).unwrap();
        let shorter = Hardware { range_max_mm: 8_000, ..hardware };
        assert_eq!(repair(&mut settings, &shorter), ["gain_slope"]);
        settings.check(&shorter).unwrap();
    }

    #[test]
    fn settings_within_the_constraints_stay_as_they_are() {
        let mut settings = Settings::default();
        assert!(repair(&mut settings, &Hardware::REFERENCE).is_empty());
        assert_eq!(settings, Settings::default());
    }
}
