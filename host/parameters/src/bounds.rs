//! Bounds of a value: the check and its wording.

use std::fmt;

use crate::choice;

/// Bounds of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// Within a range. Of several numbers, each.
    Within(Range),
    /// Within a range that has words of its own.
    Called(&'static str, Range),
    /// 0, which has the meaning of the word, or within a range.
    ZeroOr(&'static str, Range),
    /// Length of a list, and the word for its items.
    Count(Range, &'static str),
    /// Ranges that depend on another key: see [`crate::Parameter::check_in`].
    Cases(&'static [Case]),
    /// One of these names. The type of the field reads no others.
    OneOf(&'static [&'static str]),
    /// Described in words. The reader of the value checks it.
    Words(&'static str),
}

/// Numbers between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Minimum.
    pub min: f64,
    /// Maximum. Infinite: there is none, but a number must be finite.
    pub max: f64,
    /// True when the minimum itself is too small.
    pub excludes_min: bool,
    /// Numbers that are allowed between the ends.
    pub step: Step,
}

/// Numbers of a range that are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// All numbers that the type of the field holds.
    Any,
    /// Whole numbers.
    Whole,
    /// Odd numbers.
    Odd,
    /// 1, 2, 4, 8, …
    PowerOfTwo,
}

choice! {
    /// Spacing of the values of a range in which a search may look.
    pub enum Scale by default Linear {
        /// Even.
        Linear = "linear",
        /// Even in the logarithm.
        Log = "log",
        /// Whole numbers, each with an equal share.
        Integer = "integer",
        /// 1, 2, 4, …, each with an equal share.
        PowerOfTwo = "power-of-two",
    }
}

/// A range that applies under a condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Condition, as the end of a sentence: `in fog`.
    pub when: &'static str,
    /// Range.
    pub range: Range,
}

impl Bounds {
    /// A switch.
    pub const FLAG: Self = Self::Words("true or false");

    /// A seed. TOML has no greater whole numbers.
    pub const SEED: Self = Self::Words("a whole number, 0 or more, below 2^63");

    /// From `min` to `max`, both included.
    pub const fn between(min: f64, max: f64) -> Self {
        Self::Within(Range::new(min, max))
    }

    /// Above `min`, at most `max`.
    pub const fn above(min: f64, max: f64) -> Self {
        Self::Within(Range { excludes_min: true, ..Range::new(min, max) })
    }

    /// `min` or more.
    pub const fn at_least(min: f64) -> Self {
        Self::between(min, f64::INFINITY)
    }

    /// An odd number from `min` to `max`.
    pub const fn odd(min: f64, max: f64) -> Self {
        Self::Within(Range { step: Step::Odd, ..Range::new(min, max) })
    }

    /// 0, which means `word`, or from `min` to `max`.
    pub const fn zero_or(word: &'static str, min: f64, max: f64) -> Self {
        Self::ZeroOr(word, Range::new(min, max))
    }

    /// The same range, called by words of its own.
    pub const fn called(self, words: &'static str) -> Self {
        match self {
            Self::Within(range) => Self::Called(words, range),
            other => other,
        }
    }

    /// A list of `min` to `max` items, which `word` names.
    pub const fn count(min: f64, max: f64, word: &'static str) -> Self {
        Self::Count(Range::new(min, max), word)
    }

    /// Its ranges, each with its condition, if it has one.
    pub fn ranges(&self) -> Vec<(Option<&'static str>, Range)> {
        match self {
            Self::Within(range)
            | Self::Called(_, range)
            | Self::ZeroOr(_, range)
            | Self::Count(range, _) => {
                vec![(None, *range)]
            }
            Self::Cases(cases) => cases.iter().map(|case| (Some(case.when), case.range)).collect(),
            Self::OneOf(_) | Self::Words(_) => Vec::new(),
        }
    }

    /// The one range of a number; None where there are several, or none.
    pub fn range(&self) -> Option<Range> {
        match self {
            Self::Within(range) | Self::Called(_, range) | Self::ZeroOr(_, range) => Some(*range),
            _ => None,
        }
    }

    /// Names that a choice chooses from; empty for everything else.
    pub fn names(&self) -> &'static [&'static str] {
        if let Self::OneOf(names) = self { names } else { &[] }
    }

    /// True when a number is allowed, as far as that depends on nothing else.
    pub fn allows(&self, number: f64) -> bool {
        match self {
            Self::Within(range) | Self::Called(_, range) => range.contains(number),
            Self::ZeroOr(_, range) => number == 0.0 || range.contains(number),
            Self::Count(..) | Self::Cases(_) | Self::OneOf(_) | Self::Words(_) => true,
        }
    }
}

impl Range {
    /// From `min` to `max`, both included.
    pub const fn new(min: f64, max: f64) -> Self {
        Self { min, max, excludes_min: false, step: Step::Any }
    }

    /// True when a number lies in it.
    pub fn contains(&self, number: f64) -> bool {
        let lies = (self.min..=self.max).contains(&number) && number.is_finite();
        lies && !(self.excludes_min && number == self.min) && self.step.allows(number)
    }
}

impl Step {
    fn allows(self, number: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Whole => number.fract() == 0.0,
            Self::Odd => number % 2.0 == 1.0,
            Self::PowerOfTwo => number.fract() == 0.0 && (number as u64).is_power_of_two(),
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { min, max, excludes_min, step } = self;
        if *step == Step::Odd {
            f.write_str("odd, ")?;
        }
        match (excludes_min, max.is_finite()) {
            (true, true) => write!(f, "above {min}, at most {max}"),
            (true, false) => write!(f, "above {min}"),
            (false, true) => write!(f, "{min} to {max}"),
            (false, false) => write!(f, "{min} or more"),
        }?;
        f.write_str(match step {
            Step::Any | Step::Odd => "",
            Step::Whole => ", whole",
            Step::PowerOfTwo => ", a power of two",
        })
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.range, self.when)
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Within(range) => range.fmt(f),
            Self::ZeroOr(word, range) => write!(f, "0 ({word}) or {range}"),
            Self::Count(range, word) => write!(f, "{range} {word}"),
            Self::Cases(cases) => {
                let cases: Vec<String> = cases.iter().map(Case::to_string).collect();
                f.write_str(&cases.join(", "))
            }
            Self::OneOf(names) => write!(f, "one of {}", names.join(", ")),
            Self::Words(words) | Self::Called(words, _) => f.write_str(words),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wording_is_what_is_checked_at_both_ends() {
        let (up, down) = (f64::next_up, f64::next_down);
        let whole = |step| Bounds::Within(Range { step, ..Range::new(1.0, 8.0) });
        for (bounds, words, good, bad) in [
            (Bounds::between(1.0, 9.0), "1 to 9", vec![1.0, 9.0], vec![down(1.0), up(9.0)]),
            (Bounds::above(0.0, 1.0), "above 0, at most 1", vec![up(0.0), 1.0], vec![0.0, up(1.0)]),
            (Bounds::at_least(0.0), "0 or more", vec![0.0, f64::MAX], vec![-1e-300, f64::INFINITY]),
            (Bounds::odd(1.0, 15.0), "odd, 1 to 15", vec![1.0, 7.0, 15.0], vec![2.0, 17.0, -1.0]),
            (whole(Step::Whole), "1 to 8, whole", vec![1.0, 3.0, 8.0], vec![0.0, 2.5, 9.0]),
            (
                whole(Step::PowerOfTwo),
                "1 to 8, a power of two",
                vec![1.0, 2.0, 8.0],
                vec![0.5, 3.0, 16.0],
            ),
            (Bounds::above(0.0, 9.0).called("a length"), "a length", vec![9.0], vec![0.0, up(9.0)]),
            (
                Bounds::zero_or("automatic", 2.0, 9.0),
                "0 (automatic) or 2 to 9",
                vec![0.0, 2.0, 9.0],
                vec![1.0, 10.0, -1.0],
            ),
        ] {
            assert_eq!(bounds.to_string(), words);
            for number in good {
                assert!(bounds.allows(number), "{words}: {number}");
            }
            for number in bad.into_iter().chain([f64::NAN]) {
                assert!(!bounds.allows(number), "{words}: {number}");
            }
        }
    }
}
