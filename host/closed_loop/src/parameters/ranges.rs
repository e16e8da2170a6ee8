//! Ranges of parameters: those of a preset, changed by `[tune.axes]`.

use echoloop_parameters::{Kind, Parameter, Scale};
use echoloop_registration::{Method, setting};

use super::axis::Axis;
use super::table::tunable;
use super::theta_reg;
use crate::config::preset::Preset;
use crate::config::{AxisChoice, OwnAxes, RunConfig};

/// Ranges of parameters: a preset's, and the user's own.
#[derive(Clone, Copy, Debug)]
pub struct Ranges<'a> {
    preset: Preset,
    own: Option<&'a OwnAxes>,
}

impl From<Preset> for Ranges<'static> {
    fn from(preset: Preset) -> Self {
        Self { preset, own: None }
    }
}

impl<'a> From<&'a RunConfig> for Ranges<'a> {
    fn from(config: &'a RunConfig) -> Self {
        Self { preset: config.registration.preset, own: Some(&config.tune.axes) }
    }
}

impl Ranges<'_> {
    /// The preset.
    pub fn preset(&self) -> Preset {
        self.preset
    }

    /// Axes of registration's parameters. A fixed one has no ends here: the method checks it.
    pub fn of_registration(&self, method: Method) -> Vec<Axis> {
        let mut axes = theta_reg::axes(method, self.preset);
        let Some(own) = self.own else { return axes };
        for (name, choice) in own.iter() {
            let at = axes.iter().position(|axis| axis.name == name);
            let free = || free_setting(name, method);
            match (choice, at) {
                (AxisChoice::Fixed, Some(at)) => {
                    (axes[at].min, axes[at].max) = (f64::NEG_INFINITY, f64::INFINITY);
                }
                (AxisChoice::Within { min, max, .. }, Some(at)) => {
                    (axes[at].min, axes[at].max) = (min, max);
                }
                (AxisChoice::Within { min, max, .. }, None) => {
                    axes.extend(free().map(|axis| Axis { min, max, ..axis }));
                }
                _ => {}
            }
        }
        axes
    }
}

/// Axis of a setting that no preset searches, without a range.
pub(super) fn free_setting(name: &str, method: Method) -> Option<Axis> {
    let key = name.strip_prefix(theta_reg::SECTION)?;
    setting(key).filter(|setting| setting.of(method).is_some())?;
    let &Parameter { key: name, unit, kind, .. } = tunable(name)?;
    let scale = if kind == Kind::Whole { Scale::Integer } else { Scale::Linear };
    let (min, max, default) = (f64::NEG_INFINITY, f64::INFINITY, f64::NAN);
    Some(Axis { name, unit, scale, min, max, default })
}
