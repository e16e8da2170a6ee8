//! Aim of a steered sensor in a search: its axes, and its repair.

use echoloop_dsp::{ParameterId, Refusal, Settings, Steered};

use super::axis::Axis;
use super::device::{Device, of_aim};
use super::table::lidar_name;
use echoloop_parameters::Scale;

/// Axis of a field of the aim: the part of its range that a search may want, within the mount.
pub(super) fn aim_axis(id: ParameterId, mount: &Steered) -> Axis {
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
        ParameterId::FrameTime => (Scale::Log, [10.0, f64::from(mount.aim.frame_us) / 1e3]),
        _ => (Scale::Linear, [parameter.min, parameter.max].map(|code| parameter.to_unit(code))),
    };
    let default = parameter.to_unit(of_aim(&mount.aim, id));
    Axis { name: lidar_name(id), unit: parameter.unit, scale, min, max, default }
}

/// Brings the aim of a candidate within the mount, the time of a scan and the budget's counts;
/// names what was changed.
///
/// Spans and tilt come within the mount, and rows down to its step. Shots are halved, then rows
/// fall, until a column of them fits. Columns are as many as the budget has where `fills` says so,
/// at most as many as before elsewhere, and never finer than the step.
pub(super) fn repair_aim(
    settings: &mut Settings,
    device: &Device,
    fills: bool,
) -> Vec<&'static str> {
    let Some(mount) = device.steered() else { return Vec::new() };
    let mut aim = AimRepair { settings: device.with_own_aim(*settings), mount, device };
    let asked = aim.settings;
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
        let beams = self.device.budget.most_beams(&self.settings, frame_s).min(by_time);
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

    use super::*;
    use crate::budget::Budget;

    fn device(budget: Budget) -> Device {
        let mut own = Steered::REFERENCE;
        own.aim.columns = 192;
        Device { pattern: ScanPattern::Steered(own), budget, ..Device::REFERENCE }
    }

    fn set(values: &[(ParameterId, i32)]) -> Settings {
        let mut settings = Settings::default();
        values.iter().for_each(|&(field, value)| settings.set(field, Some(value)));
        settings
    }

    #[test]
    fn every_candidate_of_the_axes_is_repaired_to_an_aim_that_the_sensor_takes() {
        let budget = Budget { shots_per_s: 122_880.0, ..Budget::NONE };
        let device = device(budget);
        let mut random = Generator::new(3, 0);
        for draw in 0..2000 {
            let mut settings = Settings { shots: 1 << (draw % 5), ..Settings::default() };
            for field in ParameterId::AIM {
                let axis = aim_axis(field, &Steered::REFERENCE);
                let value = axis.from_cube(random.unit());
                settings.set(field, Some(field.parameter().to_code(value)));
            }
            repair_aim(&mut settings, &device, true);
            let pattern = device.pattern.aimed(&settings).expect("an aim that is taken");
            assert_eq!(device.budget.exceeded(&pattern, &settings), None, "{settings:?}");
        }
    }

    #[test]
    fn columns_take_up_what_the_budget_leaves_beside_rows_and_shots() {
        let budget = Budget { shots_per_s: 122_880.0, ..Budget::NONE };
        let columns = |values: &[(ParameterId, i32)], fills| {
            let mut settings = set(values);
            let repaired = repair_aim(&mut settings, &device(budget), fills);
            (settings.columns, repaired)
        };
        use ParameterId::{AzimuthSpan, Columns, Rows, Shots};
        assert_eq!(columns(&[], true), (Some(192), vec![]));
        assert_eq!(columns(&[(Rows, 32)], true), (Some(384), vec![]));
        assert_eq!(columns(&[(Rows, 32)], false), (Some(192), vec![]), "no more than before");
        assert_eq!(columns(&[(Shots, 4)], true), (Some(48), vec![]));
        assert_eq!(columns(&[(Shots, 4)], false), (Some(48), vec!["columns"]));
        assert_eq!(columns(&[(Rows, 16), (AzimuthSpan, 6_000)], true).0, Some(300), "the step");
        assert_eq!(columns(&[(Columns, 4096), (Rows, 8)], true).0, Some(1536));
    }

    #[test]
    fn what_the_mount_cannot_reach_is_brought_within_it_by_name() {
        let mut settings = set(&[
            (ParameterId::ElevationSpan, 8_000),
            (ParameterId::Tilt, -2_000),
            (ParameterId::Rows, 500),
        ]);
        let repaired = repair_aim(&mut settings, &device(Budget::NONE), false);
        assert_eq!(repaired, ["tilt", "columns", "rows"]);
        assert_eq!((settings.tilt_cdeg, settings.rows), (Some(-500), Some(400)));
        assert_eq!(settings.columns, Some(50), "20,000 shots of 5 µs a scan");
    }

    #[test]
    fn a_sensor_that_is_not_steered_has_no_aim_to_repair() {
        let mut settings = Settings::default();
        assert!(repair_aim(&mut settings, &Device::REFERENCE, true).is_empty());
        assert_eq!(settings, Settings::default());
    }
}
