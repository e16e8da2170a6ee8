//! What a value must be: the bound that is enforced, and how it is said.

use std::fmt;

/// What a value must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Must {
    /// In a range. Of several numbers, each.
    Lie(Range),
    /// 0, which means what the word says, or in a range.
    ZeroOr(&'static str, Range),
    /// A list of so many of what the word says.
    Count(Range, &'static str),
    /// In one range or another, by what else is set: [`crate::Key::check_in`] knows.
    Cases(&'static [Case]),
    /// One of these names. Its type reads no others.
    Name(&'static [&'static str]),
    /// What the words say. Whoever reads it knows.
    Read(&'static str),
}

/// Numbers between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The least.
    pub least: f64,
    /// The greatest; infinite: none, but a number must be finite.
    pub greatest: f64,
    /// Whether the least is itself too small.
    pub is_open: bool,
    /// Whether only odd numbers are meant.
    pub is_odd: bool,
}

/// A range that is meant under a condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// When, as the end of a sentence: `in fog`.
    pub when: &'static str,
    /// The range.
    pub range: Range,
}

impl Must {
    /// A switch.
    pub const FLAG: Self = Self::Read("true or false");

    /// A seed: TOML has no greater whole numbers.
    pub const SEED: Self = Self::Read("a whole number, 0 or more, below 2^63");

    /// From `least` to `greatest`, both included.
    pub const fn between(least: f64, greatest: f64) -> Self {
        Self::Lie(Range::new(least, greatest))
    }

    /// Above `least`, at most `greatest`.
    pub const fn above(least: f64, greatest: f64) -> Self {
        Self::Lie(Range { is_open: true, ..Range::new(least, greatest) })
    }

    /// `least` or more.
    pub const fn at_least(least: f64) -> Self {
        Self::between(least, f64::INFINITY)
    }

    /// An odd number from `least` to `greatest`.
    pub const fn odd(least: f64, greatest: f64) -> Self {
        Self::Lie(Range { is_odd: true, ..Range::new(least, greatest) })
    }

    /// 0, which means `word`, or from `least` to `greatest`.
    pub const fn zero_or(word: &'static str, least: f64, greatest: f64) -> Self {
        Self::ZeroOr(word, Range::new(least, greatest))
    }

    /// From `least` to `greatest` of what `word` says.
    pub const fn count(least: f64, greatest: f64, word: &'static str) -> Self {
        Self::Count(Range::new(least, greatest), word)
    }

    /// Its ranges, each with its condition, if it has one.
    pub fn ranges(&self) -> Vec<(Option<&'static str>, Range)> {
        match self {
            Self::Lie(range) | Self::ZeroOr(_, range) | Self::Count(range, _) => {
                vec![(None, *range)]
            }
            Self::Cases(cases) => cases.iter().map(|case| (Some(case.when), case.range)).collect(),
            Self::Name(_) | Self::Read(_) => Vec::new(),
        }
    }

    /// Whether a number is as it must be, as far as that hangs on nothing else.
    pub fn holds(&self, number: f64) -> bool {
        match self {
            Self::Lie(range) => range.holds(number),
            Self::ZeroOr(_, range) => number == 0.0 || range.holds(number),
            Self::Count(..) | Self::Cases(_) | Self::Name(_) | Self::Read(_) => true,
        }
    }
}

impl Range {
    /// From `least` to `greatest`, both included.
    pub const fn new(least: f64, greatest: f64) -> Self {
        Self { least, greatest, is_open: false, is_odd: false }
    }

    /// Whether a number lies in it.
    pub fn holds(&self, number: f64) -> bool {
        let lies = (self.least..=self.greatest).contains(&number) && number.is_finite();
        lies && !(self.is_open && number == self.least) && (!self.is_odd || number % 2.0 == 1.0)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, greatest, is_open, is_odd } = self;
        if *is_odd {
            f.write_str("odd, ")?;
        }
        match (is_open, greatest.is_finite()) {
            (true, true) => write!(f, "above {least}, at most {greatest}"),
            (true, false) => write!(f, "above {least}"),
            (false, true) => write!(f, "{least} to {greatest}"),
            (false, false) => write!(f, "{least} or more"),
        }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.range, self.when)
    }
}

impl fmt::Display for Must {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lie(range) => range.fmt(f),
            Self::ZeroOr(word, range) => write!(f, "0 ({word}) or {range}"),
            Self::Count(range, word) => write!(f, "{range} {word}"),
            Self::Cases(cases) => {
                let cases: Vec<String> = cases.iter().map(Case::to_string).collect();
                f.write_str(&cases.join(", "))
            }
            Self::Name(names) => write!(f, "one of {}", names.join(", ")),
            Self::Read(words) => f.write_str(words),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_is_what_holds_at_both_ends() {
        let (up, down) = (f64::next_up, f64::next_down);
        for (must, words, good, bad) in [
            (Must::between(1.0, 9.0), "1 to 9", vec![1.0, 9.0], vec![down(1.0), up(9.0)]),
            (Must::above(0.0, 1.0), "above 0, at most 1", vec![up(0.0), 1.0], vec![0.0, up(1.0)]),
            (Must::at_least(0.0), "0 or more", vec![0.0, f64::MAX], vec![-1e-300, f64::INFINITY]),
            (Must::odd(1.0, 15.0), "odd, 1 to 15", vec![1.0, 7.0, 15.0], vec![2.0, 17.0, -1.0]),
            (
                Must::zero_or("automatic", 2.0, 9.0),
                "0 (automatic) or 2 to 9",
                vec![0.0, 2.0, 9.0],
                vec![1.0, 10.0, -1.0],
            ),
        ] {
            assert_eq!(must.to_string(), words);
            for number in good {
                assert!(must.holds(number), "{words}: {number}");
            }
            for number in bad.into_iter().chain([f64::NAN]) {
                assert!(!must.holds(number), "{words}: {number}");
            }
        }
    }
}
