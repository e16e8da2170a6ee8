//! The page of one run: its data, its sections and their order.
//!
//! A section is a file here with its data, `of_run`, which takes them from a run's folder, and
//! `section`, which draws them. Values that are not finite mean "unknown" or "nothing found"
//! everywhere.

pub(crate) mod clouds;
mod convergence;
pub(crate) mod correlation;
pub(crate) mod cost;
pub(crate) mod evaluation;
mod front;
mod header;
mod identity;
mod importance;
mod notes;
pub(crate) mod pairs;
mod trajectories;

use echoloop_closed_loop::front::Front;

use crate::error::ReportError;
use crate::figure::{Figure, figures};
use crate::finished_runs::{FinishedRun, RunError};
use crate::page::{document, save_script};

pub use clouds::{CloudLayer, MAX_LAYER_POINTS, PairClouds};
pub use convergence::Convergence;
pub use correlation::{Correlation, Moved};
pub use cost::{Costs, costs};
pub use evaluation::{EvaluationRow, EvaluationTable, RowKind, judged};
pub use identity::Identity;
pub use importance::{Bar, Importance, Slice};
pub use pairs::PairErrors;
pub use trajectories::ParameterTrace;

const CAMERA: &str = include_str!("../camera.js");
const VIEWER: &str = include_str!("../viewer.js");

/// Everything the page shows.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Heading of the page.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// Names and values that identify the run: scene, seed, method, protocol, generations…
    pub facts: Vec<(String, String)>,
    /// Provenance of the run.
    pub identity: Identity,
    /// Default against tuned on the held-out pairs.
    pub table: EvaluationTable,
    /// Costs of a scan.
    pub costs: Costs,
    /// Error against a cost.
    pub front: Option<Front>,
    /// Fitness and step size by generation.
    pub convergence: Convergence,
    /// One trace for each tuned parameter.
    pub parameters: Vec<ParameterTrace>,
    /// Importance of the parameters.
    pub importance: Importance,
    /// Correlations of the search distribution at the end.
    pub correlation: Option<Correlation>,
    /// Errors of each held-out pair, default against tuned.
    pub pair_errors: Vec<PairErrors>,
    /// One pair's clouds in their estimated poses.
    pub clouds: Option<PairClouds>,
    /// Remarks, a paragraph each.
    pub notes: Vec<String>,
}

/// The page of a run, from its folder alone.
///
/// # Errors
///
/// [`RunError`] names the file.
pub fn page(run: &FinishedRun) -> Result<Report, RunError> {
    let (_, generations) = run.journal()?;
    let (background, result, config) = (run.background()?, &run.result, &run.config);
    Ok(Report {
        title: format!("Echoloop: {} tuned for {}", result.protocol, result.scene),
        subtitle: format!(
            "{} registrations in {} generations",
            result.registrations, result.generations
        ),
        facts: header::facts(run, background),
        identity: Identity::of_run(run),
        table: EvaluationTable::of_run(result, &config.data),
        costs: costs(result, config.tune.told_cost()),
        front: result.front.clone(),
        convergence: Convergence::of_run(run, &generations),
        parameters: ParameterTrace::of_run(background, result, &generations),
        importance: Importance::of_run(background, result, &generations),
        correlation: Correlation::of_run(background),
        pair_errors: PairErrors::of_run(background, result),
        clouds: Some(PairClouds::of_run(run, background)?),
        notes: notes::of_run(config),
    })
}

impl Report {
    /// The page, complete.
    ///
    /// Values that are not finite are shown as a dash, gaps or marks at the edge of the plot; empty
    /// parts are left out.
    ///
    /// # Errors
    ///
    /// [`ReportError::Length`] when series that belong together differ in length.
    pub fn to_html(&self) -> Result<String, ReportError> {
        self.check()?;
        let sections = [
            header::section(self),
            evaluation::section(&self.table),
            cost::section(&self.costs),
            front::section(self.front.as_ref()),
            convergence::section(&self.convergence),
            trajectories::section(self),
            importance::section(&self.importance),
            correlation::section(self.correlation.as_ref(), self.convergence.generation.len()),
            pairs::section(self),
            clouds::section(self.clouds.as_ref()),
            identity::section(&self.identity),
            notes::section(&self.notes),
        ];
        Ok(document(&self.title, &sections.concat(), &[CAMERA, save_script(), VIEWER].concat()))
    }

    /// Every chart of the page, standing alone.
    ///
    /// # Errors
    ///
    /// As of [`Self::to_html`], and [`ReportError::Drawing`].
    pub fn figures(&self) -> Result<Vec<Figure>, ReportError> {
        figures(&self.to_html()?).map_err(ReportError::Drawing)
    }

    /// Refuses series that differ in length.
    fn check(&self) -> Result<(), ReportError> {
        self.convergence.check()?;
        let generations = self.convergence.generation.len();
        self.parameters.iter().try_for_each(|trace| trace.check(generations))?;
        self.importance.slices.iter().try_for_each(Slice::check)?;
        self.correlation.iter().try_for_each(Correlation::check)?;
        self.clouds.iter().try_for_each(PairClouds::check)
    }
}

/// Refuses a series of `found` values that are neither none nor `count`.
fn optional_length(series: &str, found: usize, count: usize, of: &str) -> Result<(), ReportError> {
    if found == 0 {
        return Ok(());
    }
    length(series, found, count, of)
}

/// Refuses a series of `found` values where `count` are expected, one for each `of`.
fn length(series: &str, found: usize, count: usize, of: &str) -> Result<(), ReportError> {
    if found == count {
        return Ok(());
    }
    Err(ReportError::Length { series: series.to_owned(), expected: format!("{count} {of}"), found })
}
