//! Tables of the study's page.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::mem::take;

use echoloop_campaign::Line;
use echoloop_statistics::{Estimate, mean_of_groups};

use super::STUDY;
use super::record::{Judged, Run, energy};

/// A table for each condition and method, with the scenes' rows.
pub(super) fn tables(lines: &[Line<Run>]) -> String {
    let mut text = String::new();
    for condition in STUDY.names("condition") {
        for method in STUDY.names("method") {
            let mut heading = format!("\n### {}, {condition}\n\n{HEAD}", method.to_uppercase());
            for scene in STUDY.names("scene") {
                // Rows that are compared are the same in all but strategy, protocol and seed.
                let place = [condition, method, scene];
                let is_it = |line: &&Line<Run>| {
                    ["condition", "method", "scene"].map(|axis| line.cell.of(axis)) == place
                };
                let lines: Vec<&Line<Run>> = lines.iter().filter(is_it).collect();
                if !lines.is_empty() {
                    text += &take(&mut heading);
                    rows(&mut text, scene, &lines);
                }
            }
        }
    }
    text + "\n"
}

const HEAD: &str = "\
| scene | tuned | by | runs | searched | recall | mean error | energy a scan | to the start \
| to registration | to the sensor | to `paper` |
|---|---|---|---|---|---|---|---|---|---|---|---|
";

/// Strategies in the order of the rows.
const STRATEGIES: [&str; 5] = ["paper", "short", "warm", "fast", "thrift"];

fn rows(text: &mut String, scene: &str, lines: &[&Line<Run>]) {
    // A seed's start is the same for all that was tuned from it.
    let starts: BTreeMap<&str, &Judged> =
        lines.iter().map(|line| (line.cell.of("seed"), &line.result.start)).collect();
    let starts: Vec<&Judged> = starts.into_values().collect();
    row(text, [scene, "nothing", "–"], &starts, None, [None; 4]);
    let of = |strategy: &str, protocol: &str| -> Vec<&Line<Run>> {
        let is_it = |line: &&&Line<Run>| {
            [line.cell.of("strategy"), line.cell.of("protocol")] == [strategy, protocol]
        };
        lines.iter().filter(is_it).copied().collect()
    };
    for strategy in STRATEGIES {
        for protocol in STUDY.names("protocol") {
            let runs = of(strategy, protocol);
            if runs.is_empty() {
                continue;
            }
            let tuned: Vec<&Judged> = runs.iter().map(|line| &line.result.tuned).collect();
            let registrations = runs.iter().map(|line| line.result.registrations).sum::<u64>();
            let count = registrations / runs.len() as u64;
            let start = against(&runs, |line| Some(&line.result.start));
            // Runs are compared with those of another row that have the same seed.
            let beside = |strategy, protocol| {
                let others = of(strategy, protocol);
                against(&runs, move |line| {
                    let same = |other: &&&Line<Run>| other.cell.of("seed") == line.cell.of("seed");
                    others.iter().find(same).map(|other| &other.result.tuned)
                })
            };
            let half = |half| (protocol == "joint").then(|| beside(strategy, half))?;
            // Thrift searches for the least energy, not for the paper's error.
            let has_paper = !matches!(strategy, "paper" | "thrift");
            let paper = has_paper.then(|| beside("paper", protocol)).flatten();
            let gains = [start, half("registration"), half("lidar"), paper];
            row(text, [scene, protocol, strategy], &tuned, Some(count), gains);
        }
    }
}

fn row(
    text: &mut String,
    [scene, tuned, by]: [&str; 3],
    judged: &[&Judged],
    count: Option<u64>,
    gains: [Option<Estimate>; 4],
) {
    let of = |value: fn(&Judged) -> f64| {
        judged.iter().map(|judged| value(judged)).sum::<f64>() / judged.len() as f64
    };
    let recall_pct = of(|judged| judged.recall_pct);
    let means: Vec<f64> = judged.iter().filter_map(|judged| judged.mean_cm).collect();
    // Mean over the runs that found a pair.
    let mean_cm = match means.len() {
        0 => "–".to_owned(),
        runs => format!("{:.2} cm", means.iter().sum::<f64>() / runs as f64),
    };
    let energy_mj = of(|judged| judged.energy_mj);
    let count = count.map_or("–".to_owned(), |count| count.to_string());
    let gains = gains.map(|gain| gain.map_or("–".into(), as_ratio)).join(" | ");
    let runs = judged.len();
    let _ = writeln!(
        text,
        "| {scene} | {tuned} | {by} | {runs} | {count} | {recall_pct:.1} % | {mean_cm} \
         | {} | {gains} |",
        energy(energy_mj)
    );
}

/// Mean difference of ln error between runs and others on the same pairs; each run is a group.
fn against<'a>(
    runs: &[&'a Line<Run>],
    other: impl Fn(&'a Line<Run>) -> Option<&'a Judged>,
) -> Option<Estimate> {
    let pair = |line: &&'a Line<Run>| Some((&line.result.tuned, other(line)?));
    ratio(&runs.iter().filter_map(pair).collect::<Vec<_>>())
}

/// Mean difference of ln error between two that were judged on the same pairs, of several runs;
/// each run is a group.
pub(crate) fn ratio(runs: &[(&Judged, &Judged)]) -> Option<Estimate> {
    mean_of_groups(&runs.iter().map(|(own, other)| differences(own, other)).collect::<Vec<_>>())
}

/// Difference of ln error of each pair that two were judged on.
pub(crate) fn differences(own: &Judged, other: &Judged) -> Vec<f64> {
    /// Errors below a tenth of a millimetre count as this.
    const LEAST: f64 = 1e-4;
    let pairs = own.losses().into_iter().zip(other.losses());
    pairs.map(|(own, other)| (own.max(LEAST) / other.max(LEAST)).ln()).collect()
}

/// A difference of logarithms as a ratio with its interval.
pub(crate) fn as_ratio(estimate: Estimate) -> String {
    let [low, high] = estimate.interval.map(|logarithm| digits(logarithm.exp()));
    format!("{} ({low} to {high})", ratio_alone(estimate))
}

/// A difference of logarithms as a ratio, bold where it is significant.
pub(crate) fn ratio_alone(estimate: Estimate) -> String {
    let bold = if estimate.holds(0.0) { "" } else { "**" };
    format!("{bold}× {}{bold}", digits(estimate.value.exp()))
}

/// A ratio with two decimals, and at least two significant digits.
fn digits(ratio: f64) -> String {
    let places = if ratio > 0.0 { (1.0 - ratio.log10().floor()).clamp(2.0, 9.0) } else { 2.0 };
    format!("{ratio:.*}", places as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(protocol: &str, seed: &str, start: u32, tuned: u32) -> Line<Run> {
        let judged = |error: u32| Judged {
            recall_pct: 100.0,
            mean_cm: Some(f64::from(error) / 1e3),
            worst_cm: None,
            energy_mj: 4.6,
            errors: (0..100).map(|i| error + i % 2).collect(),
        };
        let cell = STUDY.cells(&[("seed", &[seed.to_owned()])]).swap_remove(0);
        Line {
            cell: cell.with("protocol", protocol),
            made: "today".into(),
            result: Run {
                registrations: 900,
                origin: "start".into(),
                parameters: BTreeMap::new(),
                start: judged(start),
                tuned: judged(tuned),
            },
        }
    }

    #[test]
    fn a_ratio_has_two_places_and_more_where_it_is_small() {
        let texts = [1.234, 0.5, 0.0949, 0.00123, 0.0].map(digits);
        assert_eq!(texts, ["1.23", "0.50", "0.095", "0.0012", "0.00"]);
    }

    #[test]
    fn joint_runs_are_compared_with_registration_alone_of_the_same_seed() {
        let lines = [
            line("registration", "1", 1000, 800),
            line("registration", "2", 2000, 1000),
            line("joint", "1", 1000, 400),
            line("joint", "2", 2000, 500),
        ];
        let page = tables(&lines);
        let row = page.lines().find(|row| row.contains("| joint |")).unwrap();
        assert!(row.contains("| 2 | 900 | 100.0 % | 0.45 cm | 4.60 mJ |"), "{row}");
        assert!(row.contains("**× 0.50** (0.50 to 0.50) |"), "{row}");
        assert!(row.contains("× 0.32**"), "{row}"); // √(0.4 · 0.25)
        let alone = page.lines().find(|row| row.contains("| registration |")).unwrap();
        assert!(alone.ends_with("| – | – | – |"), "{alone}");
        let start = page.lines().find(|row| row.contains("| nothing |")).unwrap();
        assert!(start.contains("| 2 | – | 100.0 % | 1.50 cm | 4.60 mJ | – | – |"), "{start}");
    }

    #[test]
    fn joint_runs_are_compared_with_sensor_alone_and_with_paper_of_the_same_seed() {
        let mut papers = line("joint", "2", 2000, 250);
        papers.cell = papers.cell.with("strategy", "paper");
        let lines = [
            line("lidar", "1", 1000, 800),
            line("joint", "1", 1000, 400),
            line("joint", "2", 2000, 500),
            papers,
        ];
        let page = tables(&lines);
        let row = |by: &str| page.lines().find(|row| row.contains(&format!("| joint | {by} |")));
        let (fast, paper) = (row("fast").unwrap(), row("paper").unwrap());
        let ends = "| – | **× 0.50** (0.50 to 0.50) | **× 2.00** (2.00 to 2.00) |";
        assert!(fast.ends_with(ends), "{fast}");
        assert!(paper.ends_with("| – | – | – |"), "{paper}");
    }
}
