//! Joint constraints: a candidate that breaks one is repaired, and says so; the sensor would refuse
//! it.

use echoloop_dsp::{Hardware, ParameterId, Settings};

/// Brings settings whose fields are each in range within the joint constraints; names what was
/// changed.
///
/// Too few samples a pulse: the pulse is widened. Too much energy: the power is lowered. A gain
/// that rises beyond the middle of the window: its range ends there, or it rises nowhere. (S > N
/// holds by the ranges.)
pub fn repair(settings: &mut Settings, hardware: &Hardware) -> Vec<&'static str> {
    let mut repaired = Vec::new();
    let shortest_ps = hardware.shortest_pulse_ps(settings.bins);
    if settings.pulse_width_ps < shortest_ps {
        settings.pulse_width_ps = shortest_ps;
        repaired.push(ParameterId::PulseWidth.parameter().name);
    }
    let strongest_uw = hardware.strongest_power_uw(settings.pulse_width_ps);
    if settings.power_uw > strongest_uw {
        settings.power_uw = strongest_uw;
        repaired.push(ParameterId::Power.parameter().name);
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

#[cfg(test)]
mod tests {
    use super::*;

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
