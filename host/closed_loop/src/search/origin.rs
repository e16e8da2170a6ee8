//! Where a choice comes from, and how files write it.

use std::fmt;

const START: &str = "start";
const WARM_START: &str = "warm start ";
const MEAN: &str = ", mean";

/// Where parameters come from. Files have it as text, by [`Display`](fmt::Display) and
/// [`Origin::read`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Where the search started.
    Start,
    /// What was tuned elsewhere, by its number among the warm starts, from 1.
    WarmStart(usize),
    /// Where a stage's search ended.
    Mean {
        /// Its name.
        stage: String,
    },
    /// What a stage tried.
    Candidate {
        /// Its name.
        stage: String,
        /// The generation, of all stages.
        generation: u32,
        /// The candidate, from 0.
        candidate: usize,
    },
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str(START),
            Self::WarmStart(number) => write!(f, "{WARM_START}{number}"),
            Self::Mean { stage } => write!(f, "{stage}{MEAN}"),
            Self::Candidate { stage, generation, candidate } => {
                write!(f, "{stage}, generation {generation}, candidate {candidate}")
            }
        }
    }
}

impl Origin {
    /// Reads what was written; `None` where it is of no such form.
    pub fn read(text: &str) -> Option<Self> {
        if let Some(stage) = text.strip_suffix(MEAN) {
            return Some(Self::Mean { stage: stage.to_owned() });
        }
        if let Some(number) = text.strip_prefix(WARM_START) {
            return number.parse().ok().map(Self::WarmStart);
        }
        match text {
            START => Some(Self::Start),
            _ => {
                let (stage, rest) = text.split_once(", generation ")?;
                let (generation, candidate) = rest.split_once(", candidate ")?;
                Some(Self::Candidate {
                    stage: stage.to_owned(),
                    generation: generation.parse().ok()?,
                    candidate: candidate.parse().ok()?,
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again_and_anything_else_is_none() {
        let stage = || "registration".to_owned();
        for (origin, text) in [
            (Origin::Start, "start"),
            (Origin::WarmStart(2), "warm start 2"),
            (Origin::Mean { stage: stage() }, "registration, mean"),
            (
                Origin::Candidate { stage: stage(), generation: 12, candidate: 0 },
                "registration, generation 12, candidate 0",
            ),
        ] {
            assert_eq!(origin.to_string(), text);
            assert_eq!(Origin::read(text), Some(origin));
        }
        for text in ["", "begin", "warm start", "warm start x", "a, generation 1"] {
            assert_eq!(Origin::read(text), None, "{text:?}");
        }
    }
}
