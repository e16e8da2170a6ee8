//! What a sensor is, beside its settings.

use echoloop_dsp::{Aim, Hardware, ParameterId, ScanPattern, Settings, Steered};

use super::ValueError;
use crate::budget::Budget;

/// Hardware, scan pattern and budget of a sensor: what its settings are checked against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Device {
    /// Hardware.
    pub hardware: Hardware,
    /// Scan pattern, with the sensor's own aim.
    pub pattern: ScanPattern,
    /// What a scan may use.
    pub budget: Budget,
}

impl Device {
    /// Reference sensor with the paper's grid.
    #[cfg(test)]
    pub(crate) const REFERENCE: Self = Self {
        hardware: Hardware::REFERENCE,
        pattern: ScanPattern::Grid(echoloop_dsp::Grid {
            columns: 192,
            rows: 64,
            azimuth_cdeg: 18_000,
            elevation_cdeg: 18_000,
        }),
        budget: Budget::NONE,
    };

    /// Checks settings as the sensor does, then against the budget.
    ///
    /// # Errors
    ///
    /// [`ValueError::Sensor`] of the first field that the sensor refuses, [`ValueError::Budget`] of
    /// the first limit.
    pub fn check(&self, settings: &Settings) -> Result<(), ValueError> {
        settings.check(&self.hardware)?;
        let pattern = self.pattern.aimed(settings)?;
        match self.budget.exceeded(&pattern, settings) {
            None => Ok(()),
            Some(exceeded) => Err(ValueError::Budget(exceeded)),
        }
    }

    /// Steered pattern, of a sensor whose beams the settings aim.
    pub fn steered(&self) -> Option<&Steered> {
        match &self.pattern {
            ScanPattern::Steered(steered) => Some(steered),
            _ => None,
        }
    }

    /// Settings with the sensor's own aim where they leave it out.
    pub fn with_own_aim(&self, mut settings: Settings) -> Settings {
        let Some(Steered { aim, .. }) = self.steered() else { return settings };
        for field in ParameterId::AIM {
            if settings.get(field).is_none() {
                settings.set(field, Some(of_aim(aim, field)));
            }
        }
        settings
    }

    /// Pattern with the aim of these settings; the sensor's own where it refuses that.
    pub fn aimed(&self, settings: &Settings) -> ScanPattern {
        self.pattern.aimed(settings).unwrap_or(self.pattern)
    }
}

/// Value of a field of the aim, in wire units; 0 for other fields.
pub(super) fn of_aim(aim: &Aim, field: ParameterId) -> i32 {
    match field {
        ParameterId::AzimuthSpan => aim.azimuth_cdeg.into(),
        ParameterId::ElevationSpan => aim.elevation_cdeg.into(),
        ParameterId::Tilt => aim.tilt_cdeg.into(),
        ParameterId::Columns => aim.columns.into(),
        ParameterId::Rows => aim.rows.into(),
        ParameterId::AzimuthFovea => aim.azimuth_fovea_milli.into(),
        ParameterId::ElevationFovea => aim.elevation_fovea_milli.into(),
        ParameterId::FrameTime => aim.frame_us as i32, // 1 s at most in range
        _ => 0,
    }
}
