//! Tables of the proof's page.

use std::fmt::Write;

use echoloop_campaign::{Choice, Line};
use echoloop_statistics::Estimate;

use super::PROOF;
use super::record::Run;
use crate::study::table::{as_ratio, ratio};

/// Row whose gain is to be proved.
const BOTH: &str = "joint";
/// Rows that both together have to be shown better than.
const CONTROLS: [&str; 9] = [
    "nothing",
    "lidar",
    "registration",
    "combined-half",
    "sequence",
    "combined",
    "hand",
    "combined-hand",
    "random",
];

const HEAD: &str = "\
| scene | tuned | runs | searched | CPU s | recall | mean error | worst | both together to this |
|---|---|---|---|---|---|---|---|---|
";

/// For each condition a summary, and a table for each method with the scenes' rows.
pub(super) fn tables(lines: &[Line<Run>]) -> String {
    let mut text = String::new();
    for condition in PROOF.values("condition") {
        let of_condition = of_condition(lines, &condition.name);
        if of_condition.is_empty() {
            continue;
        }
        let mut tables = String::new();
        let mut shown = [[0; 2]; CONTROLS.len()];
        for method in PROOF.values("method") {
            let mut rows = String::new();
            for scene in PROOF.names("scene") {
                let of_scene = of_place(&of_condition, &method.name, scene);
                for (count, control) in shown.iter_mut().zip(CONTROLS) {
                    if let Some(estimate) = to(&of_scene, control) {
                        count[0] += usize::from(estimate.interval[1] < 0.0);
                        count[1] += 1;
                    }
                }
                for tuned in PROOF.values("tuned") {
                    row(&mut rows, scene, tuned, &of_scene);
                }
            }
            if !rows.is_empty() {
                let _ =
                    write!(tables, "\n#### {}, {}\n\n{HEAD}{rows}", method.title(), condition.name);
            }
        }
        let title = |name: &str| {
            let value = PROOF.values("tuned").iter().find(|value| value.name == name);
            value.map_or("", Choice::title)
        };
        let each = CONTROLS.iter().zip(shown).filter(|(_, [_, of])| *of > 0);
        let each: Vec<String> = each
            .map(|(control, [better, of])| format!("{} in {better} of {of}", title(control)))
            .collect();
        let _ = write!(text, "\n### {}\n", condition.name);
        if !each.is_empty() {
            let _ =
                write!(text, "\nBoth together are shown to err less than: {}.\n", each.join("; "));
        }
        text += &tables;
    }
    text + "\n"
}

fn row(text: &mut String, scene: &str, tuned: &Choice, lines: &[&Line<Run>]) {
    let own: Vec<&Run> = of(lines, &tuned.name).map(|line| &line.result).collect();
    if own.is_empty() {
        return;
    }
    let mean = |value: &dyn Fn(&Run) -> f64| {
        own.iter().map(|run| value(run)).sum::<f64>() / own.len() as f64
    };
    let found: Vec<f64> = own.iter().filter_map(|run| run.tuned.mean_cm).collect();
    let mean_cm = match found.len() {
        0 => "–".to_owned(),
        runs => format!("{:.2} cm", found.iter().sum::<f64>() / runs as f64),
    };
    let worst = own.iter().filter_map(|run| run.tuned.worst_cm).max_by(f64::total_cmp);
    let searched = match mean(&|run| run.registrations as f64) {
        0.0 => "–".to_owned(),
        some => format!("{some:.0}"),
    };
    let gain = to(lines, &tuned.name).map_or("–".to_owned(), as_ratio);
    let _ = writeln!(
        text,
        "| {scene} | {} | {} | {searched} | {:.0} | {:.1} % | {mean_cm} | {} | {gain} |",
        tuned.title(),
        own.len(),
        mean(&|run| run.cpu_s),
        mean(&|run| run.tuned.recall_pct),
        worst.map_or("–".to_owned(), |cm| format!("{cm:.1} cm")),
    );
}

/// Ratio of both together to a row, of the seeds that have both, as its logarithm.
pub(super) fn to(lines: &[&Line<Run>], tuned: &str) -> Option<Estimate> {
    if tuned == BOTH {
        return None;
    }
    let pairs = of(lines, BOTH).filter_map(|line| {
        let same = |other: &&Line<Run>| other.cell.of("seed") == line.cell.of("seed");
        of(lines, tuned).find(same).map(|other| (&line.result.tuned, &other.result.tuned))
    });
    ratio(&pairs.collect::<Vec<_>>())
}

/// Lines of a condition.
pub(super) fn of_condition<'a>(lines: &'a [Line<Run>], condition: &str) -> Vec<&'a Line<Run>> {
    lines.iter().filter(|line| line.cell.of("condition") == condition).collect()
}

/// Lines of a row.
pub(super) fn of<'a>(
    lines: &'a [&Line<Run>],
    tuned: &'a str,
) -> impl Iterator<Item = &'a Line<Run>> {
    lines.iter().filter(move |line| line.cell.of("tuned") == tuned).copied()
}

/// Lines of a method in a kind of scene.
pub(super) fn of_place<'a>(
    lines: &[&'a Line<Run>],
    method: &str,
    scene: &str,
) -> Vec<&'a Line<Run>> {
    let is_it =
        |line: &&&Line<Run>| [line.cell.of("method"), line.cell.of("scene")] == [method, scene];
    lines.iter().filter(is_it).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture;
    use super::*;

    fn line(tuned: &str, seed: &str, error: u32) -> Line<Run> {
        let cell = PROOF.cells(&[("seed", &[seed.to_owned()])]).swap_remove(0);
        let cell = cell.with("condition", "quarter").with("tuned", tuned);
        Line { cell, made: "today".into(), result: fixture(error, error) }
    }

    #[test]
    fn both_together_are_compared_with_each_row_of_the_same_seeds() {
        let lines = [
            line("registration", "1", 800),
            line("registration", "2", 2000),
            line("lidar", "1", 400),
            line("combined-half", "1", 100),
            line("joint", "1", 400),
            line("joint", "2", 1000),
        ];
        let page = tables(&lines);
        let row = |tuned: &str| {
            let is_it = |row: &&str| row.contains(&format!("| {tuned} |"));
            page.lines().find(is_it).unwrap().to_owned()
        };
        assert!(row("registration").ends_with("| **× 0.50** (0.50 to 0.50) |"), "{page}");
        assert!(row("registration").contains("| 2 | 900 | 1 | 99.0 % | 1.40 cm | 2000.0 cm |"));
        assert!(row("sensor").ends_with("| × 1.00 (1.00 to 1.00) |"), "{page}");
        assert!(row("halves combined").contains("**× 3.99**"), "{page}");
        assert!(row("both together").ends_with("| – |"), "{page}");
        let summary = "shown to err less than: sensor in 0 of 1; registration in 1 of 1; halves \
                       combined in 0 of 1.";
        assert!(page.contains(summary), "{page}");
    }
}
