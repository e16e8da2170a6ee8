//! `--format csv`: a row for each pair.

use clap::ValueEnum;
use serde::Serialize;

use super::exit::Failure;
use crate::experiment::evaluate::Summary;
use crate::experiment::objective::PairError;

/// How tables are printed for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum TableFormat {
    /// Comma-separated values with a header.
    Csv,
}

#[derive(Serialize)]
struct Row<'a> {
    set: &'a str,
    pair: usize,
    translation_m: f64,
    rotation_deg: f64,
    frobenius: f64,
    target_points: usize,
    source_points: usize,
    iterations: usize,
    stop: &'a str,
}

impl<'a> Row<'a> {
    fn new(set: &'a str, error: &'a PairError) -> Self {
        let PairError { pair, translation_m, rotation_deg, frobenius, points, stop, iterations } =
            error;
        Self {
            set,
            pair: *pair,
            translation_m: *translation_m,
            rotation_deg: *rotation_deg,
            frobenius: *frobenius,
            target_points: points[0],
            source_points: points[1],
            iterations: *iterations,
            stop,
        }
    }
}

/// Every pair of some sets, by their names; numbers as they are stored.
pub(super) fn csv<'a>(
    sets: impl IntoIterator<Item = (&'a str, &'a Summary)>,
) -> Result<String, Failure> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for (set, summary) in sets {
        for error in &summary.errors {
            table.serialize(Row::new(set, error)).map_err(Failure::run)?;
        }
    }
    let bytes = table.into_inner().map_err(Failure::run)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
