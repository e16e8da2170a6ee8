//! Heading, facts, headline and tiles.

use echoloop_closed_loop::run_folder::run::Background;
use echoloop_closed_loop::search::Stage;

use super::{Report, evaluation};
use crate::finished_runs::FinishedRun;
use crate::format::escape;
use crate::page;

/// Names and values that identify a finished run.
pub(super) fn facts(run: &FinishedRun, background: &Background) -> Vec<(String, String)> {
    let (config, result) = (&run.config, &run.result);
    let usual = [
        ("Scene", format!("{}, {} triangles", result.scene, background.triangles)),
        ("Beams", background.beams.clone()),
        ("Protocol", result.protocol.clone()),
        ("Method", result.method.clone()),
        ("Strategy", config.tune.strategy.name().into()),
        ("Training pairs", config.data.train_pairs.to_string()),
        ("Held-out pairs", result.tuned_summary.pairs.to_string()),
        ("Distance of a pair", format!("{} m", config.data.baseline_m)),
        ("Searches", searches(&background.stages)),
        ("Seed", config.seed.to_string()),
        ("Chosen", result.origin.clone()),
    ];
    let check = result.check.map(|check| ("Checked", check.to_string()));
    usual.into_iter().chain(check).map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The stages of a search, in their order.
fn searches(stages: &[Stage]) -> String {
    let texts = stages.iter().map(|stage| {
        let Stage { name, generations, population, pairs, .. } = stage;
        format!("{name}: {generations} generations of {population} candidates on {pairs} pairs")
    });
    texts.collect::<Vec<_>>().join("; ")
}

pub(super) fn section(report: &Report) -> String {
    let facts = page::facts(&report.facts);
    format!(
        "<header><p class=\"eyebrow\">Echoloop</p><h1>{}</h1><p class=\"subtitle\">{}</p>\
         {}{}{facts}</header>\n",
        escape(&report.title),
        escape(&report.subtitle),
        evaluation::headline(report),
        evaluation::tiles(&report.table)
    )
}
