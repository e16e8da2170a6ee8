//! Heading, facts, headline and tiles.

use echoloop_closed_loop::search::Stage;

use super::{Report, evaluation};
use crate::page::{self, subtitle};

/// Heading of the page.
pub(super) fn title(report: &Report) -> String {
    let result = &report.run.result;
    format!("Echoloop: {} tuned for {}", result.protocol, result.scene)
}

pub(super) fn section(report: &Report) -> String {
    let result = &report.run.result;
    let counts =
        format!("{} registrations in {} generations", result.registrations, result.generations);
    let (axes, generations) = (report.background.axes.len(), report.generations.len());
    let below = [
        subtitle(&counts),
        evaluation::headline(&report.table, axes, generations),
        page::facts(&facts(report)),
    ];
    page::header(&title(report), &below.concat())
}

/// Names and values that identify a run.
fn facts(report: &Report) -> Vec<(String, String)> {
    let Report { run, background, .. } = report;
    let (config, result) = (&run.config, &run.result);
    let stages = background.stages.iter().map(|stage| {
        let Stage { name, generations, population, pairs, .. } = stage;
        format!("{name}: {generations} generations of {population} candidates on {pairs} pairs")
    });
    let usual = [
        ("Scene", format!("{}, {} triangles", result.scene, background.triangles)),
        ("Beams", background.beams.clone()),
        ("Protocol", result.protocol.clone()),
        ("Method", result.method.clone()),
        ("Strategy", config.tune.strategy.name().into()),
        ("Training pairs", config.data.train_pairs.to_string()),
        ("Held-out pairs", result.tuned_summary.pairs.to_string()),
        ("Distance of a pair", format!("{} m", config.data.baseline_m)),
        ("Searches", stages.collect::<Vec<_>>().join("; ")),
        ("Seed", config.seed.to_string()),
        ("Chosen", result.origin.clone()),
    ];
    let check = result.check.as_ref().map(|check| ("Checked", check.to_string()));
    usual.into_iter().chain(check).map(|(name, value)| (name.to_owned(), value)).collect()
}
