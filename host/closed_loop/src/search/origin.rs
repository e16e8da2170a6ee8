//! Origin of parameters, and its form in files.

use std::fmt;

use crate::run_folder::journal::Generation;

const START: &str = "start";
const COMBINED: &str = "halves combined";
const WARM_START: &str = "warm start ";
const SURVEY: &str = "survey ";
const MEAN: &str = ", mean";

/// Origin of parameters. Files hold it as text, by [`Display`](fmt::Display) and
/// [`Origin::read`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The start of the search.
    Start,
    /// Parameters tuned elsewhere, by their number among the warm starts, from 1.
    WarmStart(usize),
    /// An aim of the survey, by its number, from 1.
    Survey(usize),
    /// The winners of both halves, put together.
    Combined,
    /// The optimiser's mean at the end of a stage.
    Mean {
        /// Name of the stage.
        stage: String,
    },
    /// A candidate of a stage.
    Candidate {
        /// Name of the stage.
        stage: String,
        /// Number of the generation among those of all stages.
        generation: u32,
        /// Index of the candidate within its generation, from 0.
        candidate: usize,
    },
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str(START),
            Self::WarmStart(number) => write!(f, "{WARM_START}{number}"),
            Self::Survey(number) => write!(f, "{SURVEY}{number}"),
            Self::Combined => f.write_str(COMBINED),
            Self::Mean { stage } => write!(f, "{stage}{MEAN}"),
            Self::Candidate { stage, generation, candidate } => {
                write!(f, "{stage}, generation {generation}, candidate {candidate}")
            }
        }
    }
}

impl Origin {
    /// Origin of a candidate of a generation.
    pub(super) fn of(generation: &Generation, candidate: usize) -> Self {
        let stage = generation.stage.clone();
        Self::Candidate { stage, generation: generation.generation, candidate }
    }

    /// Reads the text form; `None` for any other text.
    pub fn read(text: &str) -> Option<Self> {
        if let Some(stage) = text.strip_suffix(MEAN) {
            return Some(Self::Mean { stage: stage.to_owned() });
        }
        if let Some(number) = text.strip_prefix(WARM_START) {
            return number.parse().ok().map(Self::WarmStart);
        }
        if let Some(number) = text.strip_prefix(SURVEY) {
            return number.parse().ok().map(Self::Survey);
        }
        match text {
            START => Some(Self::Start),
            COMBINED => Some(Self::Combined),
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
    fn an_origin_is_read_back_from_its_text_and_other_text_is_none() {
        let stage = || "registration".to_owned();
        for (origin, text) in [
            (Origin::Start, "start"),
            (Origin::WarmStart(2), "warm start 2"),
            (Origin::Survey(17), "survey 17"),
            (Origin::Combined, "halves combined"),
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
