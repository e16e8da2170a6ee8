//! One setting: its name, its bounds, and the ranges in which a search may look for it.

use std::fmt;

use echoloop_parameters::{Bounds, Kind, Scale};

use super::error::ConfigError;
use super::method::Method;

/// One setting of registration: a row of [`crate::SETTINGS`].
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its name: a field of the configurations, a flag (with dashes), a key in files.
    pub key: &'static str,
    /// Its name among all parameters of a run.
    pub path: &'static str,
    /// Its name in earlier versions, which is read for one more version.
    pub former: Option<&'static str>,
    /// Kind of its value: a number, or a whole one, 0 or more.
    pub kind: Kind,
    /// `m`, `rad`, or nothing for counts and shares.
    pub unit: &'static str,
    /// Its meaning, in one line. [`Setting::bounds`] has its bounds.
    pub help: &'static str,
    /// Its bound in methods that have none of their own.
    pub(super) bound: Bound,
    /// The configurations that have it.
    pub(super) uses: &'static [(Owner, Use)],
}

/// A configuration with settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// That of a method.
    Method(Method),
    /// That of features, which methods on features hold.
    Features,
}

/// The use of a setting in one method.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// The method's own bound.
    bound: Option<Bound>,
    /// Ranges of a search; None when no search changes it.
    pub search: Option<Search>,
}

/// The ranges in which a search may look for a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// The paper's symbol (Sec. 3.3); empty for settings that the paper does not have.
    pub symbol: &'static str,
    /// The range for outdoor scans. A search starts at the default.
    pub outdoor: Range,
    /// The paper's range, for indoor scans, and the start of a search in it. None for settings that
    /// the paper's methods lack.
    pub paper: Option<(Range, f64)>,
}

/// A range of values in the setting's unit, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// Spacing of the values between.
    pub scale: Scale,
}

/// The values that a setting may have.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Bounds of the value by itself.
    pub bounds: Bounds,
    /// Another setting that it must not be below, and this rule in words.
    pub not_below: Option<(&'static str, &'static str)>,
}

impl Bound {
    /// These bounds alone.
    pub(super) const fn of(bounds: Bounds) -> Self {
        Self { bounds, not_below: None }
    }

    /// The same bound, and not below another setting.
    pub(super) const fn not_below(self, key: &'static str, words: &'static str) -> Self {
        Self { not_below: Some((key, words)), ..self }
    }
}

impl Setting {
    /// Its use in a method; None when the method does not have it.
    pub fn of(&self, method: Method) -> Option<Use> {
        self.used_by(Owner::Method(method))
    }

    /// Its use in a configuration, or in the features that the configuration holds.
    pub(super) fn used_by(&self, owner: Owner) -> Option<Use> {
        let of = |owner| self.uses.iter().find(|(of, _)| *of == owner).map(|(_, of)| *of);
        match owner {
            Owner::Method(method) if method.has_features() => {
                of(owner).or_else(|| of(Owner::Features))
            }
            _ => of(owner),
        }
    }

    /// Its bound in a method.
    pub fn bound(&self, of: &Use) -> Bound {
        of.bound.unwrap_or(self.bound)
    }

    /// Its bound in words, with the setting it must not be below; where methods differ, for each.
    pub fn bounds(&self) -> String {
        let mut bounds: Vec<(String, Vec<&str>)> = Vec::new();
        for method in Method::ALL {
            let Some(of) = self.of(method) else { continue };
            let words = self.bound(&of).to_string();
            match bounds.iter_mut().find(|(known, _)| *known == words) {
                Some((_, methods)) => methods.push(method.name()),
                None => bounds.push((words, vec![method.name()])),
            }
        }
        if let [(words, _)] = &bounds[..] {
            return words.clone();
        }
        let each = bounds.iter().map(|(words, of)| format!("{}: {words}", of.join(", ")));
        each.collect::<Vec<_>>().join("; ")
    }

    /// Checks a value without regard to other settings.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the setting and its bound.
    pub fn check_alone(&self, of: &Use, value: f64) -> Result<(), ConfigError> {
        let bound = self.bound(of).bounds;
        match bound.allows(value) {
            true => Ok(()),
            false => Err(ConfigError { field: self.key, value, bound }),
        }
    }

    /// Checks a value, and that it is not below the setting that bounds it.
    pub(super) fn check(
        &self,
        of: &Use,
        get: impl Fn(&str) -> Option<f64>,
    ) -> Result<(), ConfigError> {
        let Some(value) = get(self.key) else { return Ok(()) };
        self.check_alone(of, value)?;
        match self.bound(of).not_below {
            Some((other, words)) if get(other).is_some_and(|least| value < least) => {
                Err(ConfigError { field: self.key, value, bound: Bounds::Words(words) })
            }
            _ => Ok(()),
        }
    }
}

impl Use {
    /// The same use with a bound of the method's own.
    pub(super) const fn bounded(self, bound: Bound) -> Self {
        Self { bound: Some(bound), ..self }
    }
}

/// The use of a setting with the common bound, which no search changes.
pub(super) const PLAIN: Use = Use { bound: None, search: None };

/// The use of a setting that a search may change.
pub(super) const fn searched(
    symbol: &'static str,
    outdoor: Range,
    paper: Range,
    paper_start: f64,
) -> Use {
    let paper = Some((paper, paper_start));
    Use { bound: None, search: Some(Search { symbol, outdoor, paper }) }
}

/// The use of a setting that a search may change, and that the paper's methods lack.
pub(super) const fn ours(outdoor: Range) -> Use {
    Use { bound: None, search: Some(Search { symbol: "", outdoor, paper: None }) }
}

/// A number from `min` to `max`, both included.
pub(super) const fn between(min: f64, max: f64) -> Bound {
    Bound::of(Bounds::between(min, max))
}

pub(super) const fn linear(min: f64, max: f64) -> Range {
    Range { min, max, scale: Scale::Linear }
}

pub(super) const fn log(min: f64, max: f64) -> Range {
    Range { min, max, scale: Scale::Log }
}

pub(super) const fn whole(min: f64, max: f64) -> Range {
    Range { min, max, scale: Scale::Integer }
}

impl fmt::Display for Bound {
    /// Its words, then the rule about another setting where its words differ.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bounds = self.bounds.to_string();
        match self.not_below {
            Some((_, relation)) if relation != bounds => write!(f, "{bounds}; {relation}"),
            _ => f.write_str(&bounds),
        }
    }
}

/// A field of a configuration, read and written as a number.
pub(super) trait SettingField {
    fn get(&self) -> Option<f64>;

    /// Sets it; None leaves it out, if it may be left out.
    fn set(&mut self, new: Option<f64>);
}

impl SettingField for f64 {
    fn get(&self) -> Option<f64> {
        Some(*self)
    }

    fn set(&mut self, new: Option<f64>) {
        *self = new.unwrap_or(*self);
    }
}

impl SettingField for Option<f64> {
    fn get(&self) -> Option<f64> {
        *self
    }

    fn set(&mut self, new: Option<f64>) {
        *self = new;
    }
}

impl SettingField for usize {
    fn get(&self) -> Option<f64> {
        Some(*self as f64)
    }

    /// A value below zero becomes 0. Flags and axes check their bounds before.
    fn set(&mut self, new: Option<f64>) {
        *self = new.map_or(*self, |new| new.max(0.0) as usize);
    }
}
