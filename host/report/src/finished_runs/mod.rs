//! Finished runs, read from their folders alone: no sensor, no scan.
//!
//! [`FinishedRun::read`] reads a run's folder, [`page`] makes its page, and [`compared`] puts
//! several runs side by side.

pub(crate) mod chosen;
mod compared;
mod compared_text;
mod folder;
pub(crate) mod importance;
mod result_text;
mod runs_page;
mod surrogate;

pub use crate::sections::{costs, judged, page};
pub use compared::{Against, Compared, ComparedRun, compared, flatten};
pub use folder::{FinishedRun, Known, RunError};
pub use result_text::result_text;
pub use runs_page::runs_page;

#[cfg(test)]
mod tests {
    use echoloop_closed_loop::config::DataConfig;
    use echoloop_closed_loop::evaluation::compare::Comparison;
    use echoloop_closed_loop::evaluation::objective::PairError;
    use echoloop_closed_loop::evaluation::summary::Summary;
    use echoloop_closed_loop::parameters::Values;
    use echoloop_closed_loop::run_folder::run::RunResult;

    /// A result with arbitrary figures.
    pub(super) fn result(origin: &str, tuned: Values) -> RunResult {
        let error = |pair| PairError {
            pair,
            translation_m: 0.1,
            rotation_deg: 0.1,
            frobenius: 0.1,
            points: [10, 10],
            stop: String::new(),
            iterations: 1,
        };
        let summary = Summary::from_errors((0..8).map(error).collect(), &DataConfig::default());
        RunResult {
            format: 1,
            protocol: "joint".into(),
            method: "icp".into(),
            scene: "unstructured".into(),
            seed: 1,
            generations: 41,
            registrations: 1000,
            origin: origin.into(),
            default: Values::new(),
            tuned,
            finalists: Vec::new(),
            check: None,
            plain_summary: None,
            default_summary: summary.clone(),
            tuned_summary: summary,
            comparison: Comparison { difference: 0.0, interval: [0.0; 2], reference: 0.0 },
            front: None,
            background: None,
        }
    }
}
