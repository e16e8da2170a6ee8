//! Refusal of a setting, with field, value and bound, so that the sender can mend it.

use core::fmt;

use crate::settings::reason::Reason;
use crate::settings::{Kind, Parameter, ParameterId};

/// Refused field of a set of settings. The sensor keeps the settings it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Refusal {
    /// Field at fault.
    pub field: ParameterId,
    /// Value that was asked for, in the field's wire unit.
    pub value: i32,
    /// Reason of the refusal.
    pub reason: Reason,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = self.field.parameter();
        write!(f, "{} {}", p.name, InUnit(p, self.value))?;
        match self.reason {
            Reason::BelowMinimum { minimum } => {
                write!(f, " is below its minimum {}", InUnit(p, minimum))
            }
            Reason::AboveMaximum { maximum } => {
                write!(f, " is above its maximum {}", InUnit(p, maximum))
            }
            Reason::NotAChoice => write!(f, " is none of {}", Choices(p)),
            Reason::EnergyAboveLimit { energy_pj, limit_pj } => write!(
                f,
                " times pulse_width is {:.1} nJ, above the pulse energy limit of {:.1} nJ",
                f64::from(energy_pj) / 1e3,
                f64::from(limit_pj) / 1e3
            ),
            Reason::SaturationNotAboveFloor { floor_ppm } => {
                write!(f, " is not above noise_floor {} of full scale", f64::from(floor_ppm) / 1e6)
            }
            Reason::Undersampled { sample_period_fs } => write!(
                f,
                " spans fewer than 2.5 samples of {:.3} ns (raise it or waveform_resolution)",
                f64::from(sample_period_fs) / 1e6
            ),
            Reason::BeyondMiddle { middle_mm } => write!(
                f,
                " is beyond the middle of the window, {} m (lower it, or set gain_slope to 0)",
                f64::from(middle_mm) / 1e3
            ),
            Reason::NotSteered => {
                f.write_str(" is of no use: the scan pattern is not steered (leave it out)")
            }
            Reason::BeyondMount { most_cdeg } => {
                write!(f, " is beyond the mount, which reaches {}°", f64::from(most_cdeg) / 100.0)
            }
            Reason::FinerThanRaster { step_cdeg } => write!(
                f,
                " are finer than the mount's step of {}° \
                 (lower it or the foveation, or widen the span)",
                f64::from(step_cdeg) / 100.0
            ),
            Reason::FrameTooShort { needed_us } => {
                write!(f, " is shorter than the shots of a scan, {} ms", f64::from(needed_us) / 1e3)
            }
        }
    }
}

impl core::error::Error for Refusal {}

/// Prints a wire value for people: scaled, with its unit, or as the name of the choice.
struct InUnit<'a>(&'a Parameter, i32);

impl fmt::Display for InUnit<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(parameter, code) = *self;
        match parameter.kind {
            Kind::Choice { names } => match usize::try_from(code).ok().and_then(|i| names.get(i)) {
                Some(name) => write!(f, "'{name}'"),
                None => write!(f, "{code}"),
            },
            _ => {
                write!(f, "{}", parameter.to_unit(code))?;
                if parameter.unit.is_empty() { Ok(()) } else { write!(f, " {}", parameter.unit) }
            }
        }
    }
}

/// Prints all values that a parameter takes.
struct Choices<'a>(&'a Parameter);

impl fmt::Display for Choices<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for code in self.0.min..=self.0.max {
            if self.0.check(code).is_ok() {
                write!(f, "{separator}{}", InUnit(self.0, code))?;
                separator = ", ";
            }
        }
        Ok(())
    }
}
