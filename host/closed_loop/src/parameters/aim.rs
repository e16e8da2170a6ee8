//! Aim of a steered sensor in a search: its axes, and its repair.

use echoloop_dsp::{ParameterId, Refusal, Settings, Steered};

use super::axis::Axis;
use super::device::{Device, of_aim};
use super::table::lidar_name;
use crate::budget::Budget;
use echoloop_parameters::Scale;

/// Axis of a field of the aim: the part of its range that a search may want, within the mount.
pub(super) fn aim_axis(id: ParameterId, mount: &Steered, budget: &Budget) -> Axis {
    let parameter = id.parameter();
    let [azimuth, elevation] =
        [mount.raster.azimuth_cdeg, mount.raster.elevation_cdeg].map(|c| f64::from(c) / 100.0);
    let least = |own: f64, most: f64| own.min(most);
    let (scale, [min, max]) = match id {
        ParameterId::AzimuthSpan => (Scale::Linear, [least(20.0, azimuth), azimuth]),
        ParameterId::ElevationSpan => (Scale::Linear, [least(5.0, elevation), elevation]),
        ParameterId::Tilt => (Scale::Linear, [-0.4, 0.4].map(|share| share * elevation)),
        ParameterId::Columns => (Scale::Integer, [8.0, 1024.0]),
        ParameterId::Rows => (Scale::Integer, [8.0, 128.0]),
        ParameterId::FrameTime => (Scale::Log, [10.0, budget.frame_ms]),
        _ => (Scale::Linear, [parameter.min, parameter.max].map(|code| parameter.to_unit(code))),
    };
    let default = parameter.to_unit(of_aim(&mount.aim, id));
    Axis { name: lidar_name(id), unit: parameter.unit, scale, min, max, default }
}

/// Number of columns of a candidate's aim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Columns {
    /// As many as the budget has.
    Filled,
    /// As many as the settings say, or fewer.
    AtMost,
    /// Those of the start, with the rest of its aim: pairs have the beams of one aim.
    OfTheStart,
}

/// Brings the aim of a candidate within the mount, the time of a scan and the budget's counts;
/// names what was changed.
///
/// Spans and tilt come within the mount, and rows down to its step. Shots are halved, then rows
/// fall, until a column of them fits. Columns follow, never finer than the step.
pub(super) fn repair_aim(
    settings: &mut Settings,
    device: &Device,
    columns: Columns,
) -> Vec<&'static str> {
    let Some(mount) = device.steered() else { return Vec::new() };
    let mut aim = AimRepair { settings: device.with_own_aim(*settings), mount, device };
    let asked = aim.settings;
    let fills = columns == Columns::Filled;
    aim.reach();
    aim.time();
    aim.rows();
    aim.columns(fills);
    let is_repaired = |field: &ParameterId| {
        let has_changed = aim.settings.get(*field) != asked.get(*field);
        has_changed && !(fills && *field == ParameterId::Columns)
    };
    let fields = ParameterId::AIM.into_iter().chain([ParameterId::Shots]);
    let repaired = fields.filter(is_repaired).map(|field| field.parameter().name).collect();
    *settings = aim.settings;
    repaired
}

/// Columns of a steered sensor that fill the budget beside all else in these settings.
pub(crate) fn filled_columns(settings: &Settings, device: &Device) -> Option<i32> {
    let mut filled = *settings;
    repair_aim(&mut filled, device, Columns::Filled);
    filled.columns
}

/// Brings shots, then bins, then echoes down to what the budget has for a scan whose beams do not
/// follow; names what was changed.
pub(super) fn repair_counts(settings: &mut Settings, device: &Device) -> Vec<&'static str> {
    let pattern = device.aimed(settings);
    let (budget, beams) = (&device.budget, f64::from(pattern.beams()));
    let frame_s = budget.frame_s(&pattern);
    let shot_s = device.steered().map_or(0.0, |mount| f64::from(mount.shot_ns) / 1e9);
    let fit = |settings: &Settings| {
        let [shots, samples, bits] = budget.most_beams(settings, frame_s);
        let in_time = frame_s / (shot_s * f64::from(settings.shots)); // infinite without a mount
        // A hair more, for products that are whole but for their rounding.
        [shots.min(in_time), samples, bits].map(|most| most * (1.0 + 1e-9) >= beams)
    };
    let mut repaired = Vec::new();
    for (limit, id) in [
        (0, ParameterId::Shots),
        (1, ParameterId::Shots),
        (1, ParameterId::WaveformResolution),
        (2, ParameterId::Echoes),
    ] {
        let least = id.parameter().min;
        let asked = settings.get(id).unwrap_or(least);
        let mut value = asked;
        while !fit(settings)[limit] && value > least {
            value = if id == ParameterId::Shots { value / 2 } else { value - 1 };
            settings.set(id, Some(value));
        }
        if value != asked && !repaired.contains(&id.parameter().name) {
            repaired.push(id.parameter().name);
        }
    }
    repaired
}

struct AimRepair<'a> {
    settings: Settings,
    mount: &'a Steered,
    device: &'a Device,
}

impl AimRepair<'_> {
    fn get(&self, field: ParameterId) -> i32 {
        self.settings.get(field).unwrap_or_default()
    }

    fn lower(&mut self, field: ParameterId, most: i32) {
        let value = self.get(field).min(most.max(field.parameter().min));
        self.settings.set(field, Some(value));
    }

    /// Brings spans and tilt within the mount.
    fn reach(&mut self) {
        let raster = self.mount.raster;
        self.lower(ParameterId::AzimuthSpan, raster.azimuth_cdeg.into());
        self.lower(ParameterId::ElevationSpan, raster.elevation_cdeg.into());
        let most = (i32::from(raster.elevation_cdeg) - self.get(ParameterId::ElevationSpan)) / 2;
        let tilt = self.get(ParameterId::Tilt).clamp(-most, most);
        self.settings.set(ParameterId::Tilt, Some(tilt));
    }

    /// Brings the time of a scan within the budget.
    fn time(&mut self) {
        let most_us = (1e3 * self.device.budget.frame_ms) as i32;
        self.lower(ParameterId::FrameTime, most_us);
    }

    /// Columns that fit beside these rows and shots.
    fn affordable(&self) -> i32 {
        let frame_s = f64::from(self.get(ParameterId::FrameTime)) / 1e6;
        let by_time = 1e9 * frame_s
            / f64::from(self.mount.shot_ns.max(1))
            / f64::from(self.settings.shots.max(1));
        let by_budget = self.device.budget.most_beams(&self.settings, frame_s);
        let beams = by_budget.into_iter().fold(by_time, f64::min);
        // A hair more, for products that are whole but for their rounding.
        ((beams + 1e-6) / f64::from(self.get(ParameterId::Rows).max(1))) as i32 // saturates
    }

    /// Thins out the rows to the raster, then the shots and the rows to the budget.
    fn rows(&mut self) {
        // Any one column: its number is set afterwards.
        let columns = self.settings.columns.replace(1);
        self.thin(ParameterId::Rows);
        self.settings.columns = columns;
        while self.affordable() < 1 && self.settings.shots > 1 {
            self.settings.shots /= 2;
        }
        while self.affordable() < 1 && self.get(ParameterId::Rows) > 1 {
            let fewer = self.get(ParameterId::Rows) - 1;
            self.settings.set(ParameterId::Rows, Some(fewer));
        }
    }

    fn columns(&mut self, fills: bool) {
        let most = self.affordable().clamp(1, ParameterId::Columns.parameter().max);
        match fills {
            true => self.settings.columns = Some(most),
            false => self.lower(ParameterId::Columns, most),
        }
        self.thin(ParameterId::Columns);
    }

    /// Lowers a count until the mount has a step between any two beams.
    fn thin(&mut self, field: ParameterId) {
        let (span, fovea, full, cells) = match field {
            ParameterId::Rows => (
                self.get(ParameterId::ElevationSpan),
                self.get(ParameterId::ElevationFovea),
                self.mount.raster.elevation_cdeg,
                self.mount.raster.rows,
            ),
            _ => (
                self.get(ParameterId::AzimuthSpan),
                self.get(ParameterId::AzimuthFovea),
                self.mount.raster.azimuth_cdeg,
                self.mount.raster.columns,
            ),
        };
        // Where beams are densest, 1/(1 − f) in the middle or 1/(1 + 2f) at the ends, each still
        // has a cell.
        let fovea = f64::from(fovea) / 1000.0;
        let thinnest = if fovea > 0.0 { 1.0 - fovea } else { 1.0 + 2.0 * fovea };
        let span_cells = f64::from(span) * f64::from(cells) / f64::from(full.max(1));
        // The middle is the densest place, and only two beams stand there: a few more may fit.
        self.lower(field, (1.2 * span_cells * thinnest) as i32 + 4);
        while self.get(field) > 1 && self.is_too_fine(field) {
            let fewer = self.get(field) - 1;
            self.settings.set(field, Some(fewer));
        }
    }

    fn is_too_fine(&self, field: ParameterId) -> bool {
        // Time is another matter: a scan of one column or row is not refused for it.
        let alone = Settings {
            shots: 1,
            columns: if field == ParameterId::Rows { Some(1) } else { self.settings.columns },
            rows: if field == ParameterId::Columns { Some(1) } else { self.settings.rows },
            ..self.settings
        };
        matches!(self.mount.aimed(&alone), Err(Refusal { field: at, .. }) if at == field)
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::ScanPattern;
    use echoloop_random::Generator;

    use super::super::repair::{Limits, repair};
    use super::super::table::device_axis;
    use super::*;
    use crate::config::preset::LidarPreset;

    fn device(budget: Budget) -> Device {
        let mut own = Steered::REFERENCE;
        (own.aim.columns, own.aim.rows) = (192, 64);
        (own.aim.elevation_cdeg, own.aim.tilt_cdeg) = (6_000, 0);
        Device { pattern: ScanPattern::Steered(own), budget, ..Device::REFERENCE }
    }

    fn set(values: &[(ParameterId, i32)]) -> Settings {
        let mut settings = Settings::default();
        values.iter().for_each(|&(field, value)| settings.set(field, Some(value)));
        settings
    }

    #[test]
    fn every_candidate_of_the_axes_is_repaired_to_settings_that_the_sensor_and_the_budget_take() {
        let mut random = Generator::new(3, 0);
        let budgets = [Budget::UNITREE_L2, Budget::MID_360, Budget::NONE];
        let columns = [Columns::Filled, Columns::AtMost, Columns::OfTheStart];
        let mut repaired = [0; 3];
        for draw in 0..3000 {
            let (budget, columns) = (budgets[draw % 3], columns[draw / 3 % 3]);
            let device =
                Device { pattern: ScanPattern::Steered(Steered::REFERENCE), ..device(budget) };
            let mut settings = device.with_own_aim(Settings::default());
            let is_fixed = columns == Columns::OfTheStart;
            let aim: &[ParameterId] = if is_fixed { &[] } else { &ParameterId::AIM };
            use ParameterId::{Echoes, Power, PulseWidth, Shots, WaveformResolution};
            for &field in [Shots, Power, PulseWidth, WaveformResolution, Echoes].iter().chain(aim) {
                let axis = device_axis(field, LidarPreset::Full, &settings, &device).unwrap();
                let value = axis.from_cube(random.unit());
                settings.set(field, Some(field.parameter().to_code(value)));
            }
            let names = repair(&mut settings, &device, &Limits::of_sensor(), columns);
            repaired[draw / 3 % 3] += usize::from(!names.is_empty());
            assert_eq!(device.check(&settings).map_err(|error| error.to_string()), Ok(()));
            let own = device.with_own_aim(Settings::default());
            let is_own = |id: &ParameterId| settings.get(*id) == own.get(*id);
            assert!(!is_fixed || ParameterId::AIM.iter().all(is_own), "{settings:?}");
        }
        assert!(repaired.iter().all(|&count| count > 500), "{repaired:?}");
    }

    #[test]
    fn a_grid_beyond_its_budget_has_fewer_shots_then_fewer_samples_and_echoes() {
        // 12,288 beams, 122,880 shots a second.
        let of = |budget: Budget, values: &[(ParameterId, i32)]| {
            let device = Device { budget, ..Device::REFERENCE };
            let mut settings = set(values);
            let repaired = repair_counts(&mut settings, &device);
            device.check(&settings).unwrap();
            (repaired, [settings.shots, settings.bins, settings.echoes])
        };
        use ParameterId::{Echoes, Shots, WaveformResolution};
        let none = Budget::NONE;
        assert_eq!(of(none, &[(Shots, 16)]), (vec![], [16, 800, 1]));
        let shots = Budget { shots_per_s: 300_000.0, ..none };
        assert_eq!(of(shots, &[(Shots, 16)]), (vec!["shots"], [2, 800, 1]));
        let samples = Budget { msamples_per_s: 122.88, ..none };
        let both = vec!["shots", "waveform_resolution"];
        assert_eq!(of(samples, &[(Shots, 2), (WaveformResolution, 2_000)]), (both, [1, 1_000, 1]));
        let bits = Budget { mbit_per_s: 50.0, ..none };
        assert_eq!(of(bits, &[(Echoes, 4)]), (vec!["echoes"], [1, 800, 2]));
    }

    #[test]
    fn columns_take_up_what_the_budget_leaves_beside_rows_and_shots() {
        let budget = Budget { shots_per_s: 122_880.0, ..Budget::NONE };
        let of = |values: &[(ParameterId, i32)], columns| {
            let mut settings = set(values);
            let repaired = repair_aim(&mut settings, &device(budget), columns);
            (settings.columns, repaired)
        };
        use Columns::{AtMost, Filled};
        use ParameterId::{AzimuthSpan, Rows, Shots};
        assert_eq!(of(&[], Filled), (Some(192), vec![]));
        assert_eq!(of(&[(Rows, 32)], Filled), (Some(384), vec![]));
        assert_eq!(of(&[(Rows, 32)], AtMost), (Some(192), vec![]), "no more than before");
        assert_eq!(of(&[(Shots, 4)], Filled), (Some(48), vec![]));
        assert_eq!(of(&[(Shots, 4)], AtMost), (Some(48), vec!["columns"]));
        assert_eq!(of(&[(Rows, 16), (AzimuthSpan, 6_000)], Filled).0, Some(300), "the step");
        assert_eq!(of(&[(ParameterId::Columns, 4096), (Rows, 8)], Filled).0, Some(1536));
    }

    #[test]
    fn what_the_mount_cannot_reach_is_brought_within_it_by_name() {
        let mut settings = set(&[
            (ParameterId::ElevationSpan, 8_000),
            (ParameterId::Tilt, -2_000),
            (ParameterId::Rows, 500),
        ]);
        let repaired = repair_aim(&mut settings, &device(Budget::NONE), Columns::AtMost);
        assert_eq!(repaired, ["tilt", "columns", "rows"]);
        assert_eq!((settings.tilt_cdeg, settings.rows), (Some(-500), Some(400)));
        assert_eq!(settings.columns, Some(50), "20,000 shots of 5 µs a scan");
    }

    #[test]
    fn a_sensor_that_is_not_steered_has_no_aim_to_repair() {
        let mut settings = Settings::default();
        assert!(repair_aim(&mut settings, &Device::REFERENCE, Columns::Filled).is_empty());
        assert_eq!(settings, Settings::default());
    }
}
