//! What is known of one setting: its name, its bounds, where a search may look for it.

use std::fmt;

use super::error::ConfigError;
use super::method::Method;

/// One setting of registration: a row of [`crate::SETTINGS`].
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its name: a field of the configurations, a flag (with dashes), a key in files.
    pub key: &'static str,
    /// Its name among all parameters of an experiment.
    pub path: &'static str,
    /// Its name in earlier versions, which is read for one version more.
    pub former: Option<&'static str>,
    /// How it is kept.
    pub kind: Kind,
    /// `m`, `rad`, or nothing for counts and shares.
    pub unit: &'static str,
    /// What it is, in one line; [`Setting::bounds`] has what it must be.
    pub help: &'static str,
    /// What it must be, where a method does not say otherwise.
    pub(super) bound: Bound,
    pub(super) icp: Option<Use>,
    pub(super) gicp: Option<Use>,
    pub(super) features: Option<Use>,
    pub(super) fgr: Option<Use>,
    pub(super) mac: Option<Use>,
    pub(super) auto: Option<Use>,
}

/// How a setting is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A length, an angle or a share.
    Real,
    /// A number that may be left out.
    Optional,
    /// A number of things.
    Count,
}

/// A setting as one method has it.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// The bound, where it is the method's own.
    bound: Option<Bound>,
    /// Where a search may look for it.
    pub search: Option<Search>,
}

/// Where a search may look for a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// The paper's symbol (Sec. 3.3); empty for what the paper does not have.
    pub symbol: &'static str,
    /// What outdoor spacing needs. It starts at the default.
    pub outdoor: Range,
    /// The paper's range, made for indoor spacing, and where it starts there; absent for what the
    /// paper's methods do without.
    pub paper: Option<(Range, f64)>,
}

/// A range of values, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// How values lie between them.
    pub spacing: Spacing,
}

/// How the values of a range lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// Evenly.
    Linear,
    /// Evenly in the logarithm.
    Log,
    /// Whole numbers, each with an equal share.
    Whole,
}

/// What a value must be.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// In words, as the end of "expected …".
    pub words: &'static str,
    holds: fn(f64) -> bool,
    /// Another setting that it must not be below, and that in words.
    pub not_below: Option<(&'static str, &'static str)>,
}

impl Bound {
    /// Whether a value is one that a method runs with, whatever its other settings are.
    pub fn allows(&self, value: f64) -> bool {
        (self.holds)(value)
    }
}

impl Setting {
    /// Of no method yet.
    pub(super) const fn new(
        key: &'static str,
        path: &'static str,
        kind: Kind,
        unit: &'static str,
        help: &'static str,
        bound: Bound,
    ) -> Self {
        let (former, icp, gicp, features) = (None, None, None, None);
        let (fgr, mac, auto) = (None, None, None);
        Self { key, path, former, kind, unit, help, bound, icp, gicp, features, fgr, mac, auto }
    }

    /// As the method has it; absent when it is none of its settings.
    pub fn of(&self, method: Method) -> Option<Use> {
        match method {
            Method::Icp => self.icp,
            Method::Gicp => self.gicp,
            Method::Fgr => self.fgr.or(self.features),
            Method::Mac => self.mac.or(self.features),
            Method::Auto => self.auto,
        }
    }

    /// What it must be in a method.
    pub fn bound(&self, of: &Use) -> Bound {
        of.bound.unwrap_or(self.bound)
    }

    /// What it must be, in words, and not below which other; where methods differ, of each in turn.
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

    /// Checks a value by itself.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the setting and its bound.
    pub fn check_alone(&self, of: &Use, value: f64) -> Result<(), ConfigError> {
        let bound = self.bound(of);
        match bound.allows(value) {
            true => Ok(()),
            false => Err(ConfigError { field: self.key, value, bound: bound.words }),
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
            Some((other, bound)) if get(other).is_some_and(|least| value < least) => {
                Err(ConfigError { field: self.key, value, bound })
            }
            _ => Ok(()),
        }
    }
}

impl Use {
    /// The same with a bound of the method's own.
    pub(super) const fn bounded(self, bound: Bound) -> Self {
        Self { bound: Some(bound), ..self }
    }
}

/// A setting that no search changes, and that is bounded as everywhere.
pub(super) const PLAIN: Use = Use { bound: None, search: None };

/// A setting that a search may change.
pub(super) const fn searched(
    symbol: &'static str,
    outdoor: Range,
    paper: Range,
    paper_start: f64,
) -> Use {
    let paper = Some((paper, paper_start));
    Use { bound: None, search: Some(Search { symbol, outdoor, paper }) }
}

/// A setting that a search may change, and that the paper's methods do without.
pub(super) const fn ours(outdoor: Range) -> Use {
    Use { bound: None, search: Some(Search { symbol: "", outdoor, paper: None }) }
}

pub(super) const fn linear(min: f64, max: f64) -> Range {
    Range { min, max, spacing: Spacing::Linear }
}

pub(super) const fn log(min: f64, max: f64) -> Range {
    Range { min, max, spacing: Spacing::Log }
}

pub(super) const fn whole(min: f64, max: f64) -> Range {
    Range { min, max, spacing: Spacing::Whole }
}

impl fmt::Display for Bound {
    /// Its words, then those of the setting it must not be below, where they say more.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.not_below {
            Some((_, relation)) if relation != self.words => {
                write!(f, "{}; {relation}", self.words)
            }
            _ => f.write_str(self.words),
        }
    }
}

impl Bound {
    /// The values for which `holds`, which `words` say.
    pub(super) const fn new(words: &'static str, holds: fn(f64) -> bool) -> Self {
        Self { words, holds, not_below: None }
    }

    /// And not below another setting.
    pub(super) const fn not_below(self, key: &'static str, words: &'static str) -> Self {
        Self { not_below: Some((key, words)), ..self }
    }
}

/// A field of a configuration that is a setting, read and written as a number.
pub(super) trait SettingField {
    fn get(&self) -> Option<f64>;

    fn set(&mut self, new: f64);

    /// Leaves it out, where it may be.
    fn clear(&mut self) {}
}

/// A type of such a field, and the kind of its settings.
pub(super) trait FieldType: SettingField {
    const KIND: Kind;
}

impl FieldType for f64 {
    const KIND: Kind = Kind::Real;
}

impl FieldType for Option<f64> {
    const KIND: Kind = Kind::Optional;
}

impl FieldType for usize {
    const KIND: Kind = Kind::Count;
}

impl SettingField for f64 {
    fn get(&self) -> Option<f64> {
        Some(*self)
    }

    fn set(&mut self, new: f64) {
        *self = new;
    }
}

impl SettingField for Option<f64> {
    fn get(&self) -> Option<f64> {
        *self
    }

    fn set(&mut self, new: f64) {
        *self = Some(new);
    }

    fn clear(&mut self) {
        *self = None;
    }
}

impl SettingField for usize {
    fn get(&self) -> Option<f64> {
        Some(*self as f64)
    }

    /// Below zero it becomes none: flags and axes have their own bounds before.
    fn set(&mut self, new: f64) {
        *self = new.max(0.0) as usize;
    }
}
