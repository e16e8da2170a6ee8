//! Finished runs, read from their folders alone: no sensor, no scan.
//!
//! [`FinishedRun::read`] reads a run's folder, [`Report::of`](crate::Report::of) what its page
//! shows, and [`compared`] puts several runs side by side.

pub(crate) mod chosen;
mod compared;
mod compared_text;
mod folder;
pub(crate) mod importance;
mod result_text;
mod runs_page;
mod surrogate;

pub use crate::sections::{costs, judged};
pub use compared::{Against, Compared, ComparedRun, Differing, compared, flatten};
pub use folder::{FinishedRun, Known, RunError};
pub use result_text::result_text;

#[cfg(test)]
pub(crate) mod tests {
    use std::path::PathBuf;

    use super::FinishedRun;
    use echoloop_closed_loop::config::DataConfig;
    use echoloop_closed_loop::config::RunConfig;
    use echoloop_closed_loop::evaluation::compare::Comparison;
    use echoloop_closed_loop::evaluation::objective::PairError;
    use echoloop_closed_loop::evaluation::summary::Summary;
    use echoloop_closed_loop::parameters::Values;
    use echoloop_closed_loop::run_folder::provenance::About;
    use echoloop_closed_loop::run_folder::run::RunResult;

    /// A run of the default configuration with the result's seed.
    pub(crate) fn finished_run(result: RunResult) -> FinishedRun {
        let config = RunConfig { seed: result.seed, ..RunConfig::default() };
        let config_text = toml::to_string(&config).unwrap();
        let config = toml::from_str(&config_text).unwrap();
        let about = About::default();
        FinishedRun { path: PathBuf::from("run"), config_text, config, about, result }
    }

    /// A result with arbitrary figures.
    pub(crate) fn result(origin: &str, tuned: Values) -> RunResult {
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
