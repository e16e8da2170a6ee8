//! The page of one run: its sections and their order.
//!
//! A section is a file here with `section`, which draws what it takes from the [`Report`]. Values
//! that are not finite mean "unknown" or "nothing found" everywhere.

mod beams;
mod budget;
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

use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::Background;
use echoloop_clouds::Cloud;

use crate::figure::{Figure, figures};
use crate::finished_runs::{FinishedRun, RunError};
use crate::page::{SAVE, document};

pub use correlation::Moved;
pub use cost::{Costs, costs};
pub use evaluation::{EvaluationRow, EvaluationTable, RowKind, judged};
pub use importance::{Bar, Importance, Slice, SlicePoint};

pub(crate) const CAMERA: &str = include_str!("../camera.js");
pub(crate) const VIEWER: &str = include_str!("../viewer.js");

/// A finished run, read and evaluated for its page.
#[derive(Clone, Debug)]
pub struct Report {
    /// The run.
    pub run: FinishedRun,
    /// Axes, stages and correlations of its search.
    pub background: Background,
    /// Generations of its search.
    pub generations: Vec<Generation>,
    /// Default against tuned on the held-out pairs.
    pub table: EvaluationTable,
    /// Importance of the parameters.
    pub importance: Importance,
    /// Target and source of the shown pair: with the default, then with the tuned parameters.
    pub clouds: [[Cloud; 2]; 2],
}

impl Report {
    /// Reads the rest of a run's folder.
    ///
    /// # Errors
    ///
    /// [`RunError`] names the file.
    pub fn of(run: FinishedRun) -> Result<Self, RunError> {
        let (_, generations) = run.journal()?;
        let background = run.background()?.clone();
        correlation::check(&background).map_err(|what| run.result_error(what))?;
        Ok(Self {
            table: EvaluationTable::of_run(&run.result, &run.config.data),
            importance: Importance::of_run(&background, &run.result, &generations),
            clouds: run.clouds()?,
            run,
            background,
            generations,
        })
    }

    /// The page, complete. Values that are not finite are shown as a dash, gaps or marks at the
    /// edge of the plot; empty parts are left out.
    pub fn to_html(&self) -> String {
        let sections = [
            header::section(self),
            evaluation::section(&self.table),
            cost::section(&costs(&self.run.result, self.run.config.tune.told_cost())),
            budget::section(self),
            front::section(self.run.result.front.as_ref()),
            convergence::section(self),
            trajectories::section(self),
            importance::section(&self.importance),
            correlation::section(self),
            pairs::section(self),
            beams::section(self),
            clouds::section(self),
            identity::section(&self.run),
            notes::section(&self.run.config),
        ];
        document(&header::title(self), &sections.concat(), &[CAMERA, SAVE, VIEWER].concat())
    }

    /// Every chart of the page, standing alone.
    ///
    /// # Errors
    ///
    /// A text about the first chart that cannot be drawn.
    pub fn figures(&self) -> Result<Vec<Figure>, String> {
        figures(&self.to_html())
    }
}
