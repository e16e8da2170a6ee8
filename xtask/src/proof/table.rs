//! Tables of the proof's page.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use echoloop_campaign::{Choice, Line};
use echoloop_statistics::{Estimate, mean, mean_of_groups};

use super::record::Run;
use super::{PROOF, parts};
use crate::study::table::{as_ratio, differences, ratio, ratio_alone};

/// Row whose gain is to be proved.
const BOTH: &str = "joint";
/// Rows that both together are counted against.
const CONTROLS: [&str; 10] = [
    "nothing",
    "lidar",
    "registration",
    "combined-half",
    "hand",
    "sequence",
    "combined",
    "combined-hand",
    "ideal",
    "random",
];
/// Those of the controls that all have to be beaten.
const REQUIRED: [&str; 4] = ["lidar", "registration", "combined-half", "hand"];
/// Runs from which an interval says something of other seeds.
pub(super) const LEAST_RUNS: usize = 3;

const HEAD: &str = "\
| scene | tuned | runs | searched | CPU s | recall | mean error | worst | both together to this |
|---|---|---|---|---|---|---|---|---|
";

const SUMMARY: &str = "
| both together to | places | less error | more error | smaller root | larger root \
| larger plain mean | fewer pairs found |
|---|---|---|---|---|---|---|---|
";

/// For each condition a summary, and a table for each method with the scenes' rows.
pub(super) fn tables(lines: &[Line<Run>]) -> String {
    let mut text = String::new();
    for condition in PROOF.values("condition") {
        let of_condition = of_condition(lines, &condition.name);
        if of_condition.is_empty() {
            continue;
        }
        let _ = write!(text, "\n### {}\n{}", condition.name, summary(&of_condition));
        for method in PROOF.values("method") {
            let mut rows = String::new();
            for scene in PROOF.names("scene") {
                let of_scene = of_place(&of_condition, &method.name, scene);
                for tuned in PROOF.values("tuned") {
                    row(&mut rows, scene, tuned, &of_scene);
                }
            }
            if !rows.is_empty() {
                let _ =
                    write!(text, "\n#### {}, {}\n\n{HEAD}{rows}", method.title(), condition.name);
            }
        }
    }
    text + "\n"
}

/// In how many places, each a method in a kind of scene, both together differ from each control.
fn summary(lines: &[&Line<Run>]) -> String {
    let methods = PROOF.names("method");
    let places = methods.flat_map(|method| PROOF.names("scene").map(move |scene| (method, scene)));
    let places = places.map(|(method, scene)| of_place(lines, method, scene));
    let places: Vec<_> = places.filter(|place| of(place, BOTH).count() >= LEAST_RUNS).collect();
    if places.is_empty() {
        return String::new();
    }
    let mut text = SUMMARY.to_owned();
    let of_control = |control| places.iter().map(|place| compared(place, control)).collect();
    let of_controls: BTreeMap<&str, Vec<Option<Compared>>> =
        CONTROLS.into_iter().map(|control| (control, of_control(control))).collect();
    for control in CONTROLS {
        let all: Vec<&Compared> = of_controls[control].iter().flatten().collect();
        let count =
            |is_it: fn(&Compared) -> bool| all.iter().copied().filter(|one| is_it(one)).count();
        if !all.is_empty() {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} |",
                title(control),
                all.len(),
                count(|one| one.ratio.interval[1] < 0.0),
                count(|one| one.ratio.interval[0] > 0.0),
                count(|one| one.root.interval[1] < 0.0),
                count(|one| one.root.interval[0] > 0.0),
                count(|one| one.plain.interval[0] > 0.0),
                count(|one| one.found.interval[1] < 0.0),
            );
        }
    }
    // Of a condition without these rows there is nothing to be counted.
    let is_run = |control: &&str| of_controls[*control].iter().any(Option::is_some);
    if REQUIRED.iter().all(is_run) {
        let _ = write!(text, "\n{}", in_lines(&told(lines, &of_controls)));
    }
    text + &over_places(lines)
}

/// In how many places both together err less than each of those to be beaten, and whose sensor they
/// end at.
fn told(lines: &[&Line<Run>], of_controls: &BTreeMap<&str, Vec<Option<Compared>>>) -> String {
    let places = of_controls[REQUIRED[0]].len();
    let shown = |of: fn(&Compared) -> &Estimate| {
        let less =
            |one: &Option<Compared>| one.as_ref().is_some_and(|one| of(one).interval[1] < 0.0);
        let all =
            |place: &usize| REQUIRED.iter().all(|control| less(&of_controls[control][*place]));
        (0..places).filter(all).count()
    };
    let (by_ratio, by_root) = (shown(|one| &one.ratio), shown(|one| &one.root));
    let names = REQUIRED.map(title).join("; ");
    let [own, of_hand] = sensors(lines);
    let runs = of(lines, BOTH).count();
    format!(
        "Less error than each of these is shown in {by_ratio} of {places} places, a smaller root \
         in {by_root}: {names}. Of {runs} runs of both together {own} end at a sensor of their \
         own, {of_hand} at the one set by hand."
    )
}

/// Ratio of both together to each of the controls to be beaten and to the sensor before its
/// registration, with the interval of all methods alone: the table of `docs/results.md`.
pub(super) fn claim(lines: &[&Line<Run>]) -> String {
    ratios_over_places(lines, &[&REQUIRED[..], &["sequence"]].concat(), ratio_alone) + "\n"
}

/// Ratio of both together to each control, over the kinds of scene and over the methods as well.
fn over_places(lines: &[&Line<Run>]) -> String {
    ratios_over_places(lines, &CONTROLS, as_ratio)
}

/// Table of the ratios to some controls, those of a single method as `told`.
fn ratios_over_places(
    lines: &[&Line<Run>],
    controls: &[&str],
    told: fn(Estimate) -> String,
) -> String {
    let of_method = |method: &Choice| {
        let own = lines.iter().filter(|line| line.cell.of("method") == method.name);
        own.copied().collect::<Vec<_>>()
    };
    let methods: Vec<_> =
        PROOF.values("method").iter().map(|m| (m.title(), of_method(m), told)).collect();
    let columns = [methods, vec![("all", lines.to_vec(), as_ratio)]].concat();
    let titles: Vec<&str> = columns.iter().map(|(title, ..)| *title).collect();
    let mut text = format!("\n| both together to | {} |\n", titles.join(" | "));
    let _ = writeln!(text, "{}|", "|---".repeat(1 + columns.len()));
    for control in controls {
        let ratios = columns
            .iter()
            .map(|(_, own, told)| ratio_over_places(own, control).map_or("–".to_owned(), told));
        let ratios: Vec<String> = ratios.collect();
        if ratios.iter().any(|ratio| ratio != "–") {
            let _ = writeln!(text, "| {} | {} |", title(control), ratios.join(" | "));
        }
    }
    text
}

/// Ratio of both together to a row, as its logarithm: a seed is a group of the pairs of all its
/// places. A seed that lacks either in one of the places is left out.
fn ratio_over_places(lines: &[&Line<Run>], tuned: &str) -> Option<Estimate> {
    let pairs: Vec<_> = beside(lines, tuned).collect();
    let place = |line: &Line<Run>| ["method", "scene"].map(|axis| line.cell.of(axis).to_owned());
    let places: BTreeSet<_> = pairs.iter().map(|[own, _]| place(own)).collect();
    let mut of_seeds: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    for &[own, other] in &pairs {
        let of_pairs = differences(&own.result.tuned, &other.result.tuned);
        of_seeds.entry(own.cell.of("seed")).or_default().push(of_pairs);
    }
    let whole = of_seeds.into_values().filter(|own| own.len() == places.len());
    let groups: Vec<Vec<f64>> = whole.map(|own| own.concat()).collect();
    (groups.len() >= LEAST_RUNS).then(|| mean_of_groups(&groups))?
}

/// Prose in lines of at most 100 columns.
fn in_lines(prose: &str) -> String {
    let (mut text, mut column) = (String::new(), 0);
    for word in prose.split(' ') {
        let width = word.chars().count();
        let (between, before) = match column {
            0 => ("", 0),
            _ if column + 1 + width > 100 => ("\n", 0),
            _ => (" ", column + 1),
        };
        text += between;
        text += word;
        column = before + width;
    }
    text + "\n"
}

/// Runs of both together that end at a sensor of their own, and at the one set by hand.
fn sensors(lines: &[&Line<Run>]) -> [usize; 2] {
    let sensor = |line: &Line<Run>| {
        let own = line.result.parameters.clone().into_iter();
        own.filter(|(name, _)| name.starts_with("lidar.")).collect::<Vec<_>>()
    };
    let is_that_of = |line: &Line<Run>, row| {
        let cell = line.cell.with("tuned", row);
        of(lines, row).any(|other| other.cell == cell && sensor(other) == sensor(line))
    };
    let both = || of(lines, BOTH);
    let own = both().filter(|line| !["nothing", "hand"].iter().any(|row| is_that_of(line, row)));
    [own.count(), both().filter(|line| is_that_of(line, "hand")).count()]
}

/// Title of a row of the plan.
pub(super) fn title(row: &str) -> &str {
    PROOF.values("tuned").iter().find(|value| value.name == row).map_or(row, Choice::title)
}

fn row(text: &mut String, scene: &str, tuned: &Choice, lines: &[&Line<Run>]) {
    let own: Vec<&Run> = of(lines, &tuned.name).map(|line| &line.result).collect();
    if own.is_empty() {
        return;
    }
    let found: Vec<f64> = own.iter().filter_map(|run| run.tuned.mean_cm).collect();
    let mean_cm = match found.len() {
        0 => "–".to_owned(),
        _ => format!("{:.2} cm", mean(&found)),
    };
    let worst = own.iter().filter_map(|run| run.tuned.worst_cm).max_by(f64::total_cmp);
    // What is put together of others' choices cost what they did.
    let rows = || [&*tuned.name].into_iter().chain(parts(&tuned.name).iter().copied());
    let of_all = |value: &dyn Fn(&Run) -> f64| -> f64 {
        rows().map(|row| mean_of(lines, row, value)).filter(|mean| mean.is_finite()).sum()
    };
    let searched = match of_all(&|run| run.registrations as f64) {
        0.0 => "–".to_owned(),
        some => format!("{some:.0}"),
    };
    let gain = to(lines, &tuned.name).map_or("–".to_owned(), as_ratio);
    let _ = writeln!(
        text,
        "| {scene} | {} | {} | {searched} | {:.0} | {:.1} % | {mean_cm} | {} | {gain} |",
        tuned.title(),
        own.len(),
        of_all(&|run| run.cpu_s),
        mean_of(lines, &tuned.name, &|run| run.tuned.recall_pct),
        worst.map_or("–".to_owned(), |cm| format!("{cm:.1} cm")),
    );
}

/// Mean over a row's runs; NaN without any.
pub(super) fn mean_of(lines: &[&Line<Run>], row: &str, value: &dyn Fn(&Run) -> f64) -> f64 {
    mean(&of(lines, row).map(|line| value(&line.result)).collect::<Vec<f64>>())
}

/// Ratio of both together to a row, of the seeds that have both, as its logarithm.
pub(super) fn to(lines: &[&Line<Run>], tuned: &str) -> Option<Estimate> {
    let pairs: Vec<_> = beside(lines, tuned).map(results).collect();
    ratio(&pairs.iter().map(|[own, other]| (&own.tuned, &other.tuned)).collect::<Vec<_>>())
}

/// Both together less a row.
struct Compared {
    /// Logarithm of the error, in the mean.
    ratio: Estimate,
    /// Square root of the error, in the mean: what every search makes small.
    root: Estimate,
    /// Error ‖T − T*‖_F, in the mean.
    plain: Estimate,
    /// Pairs found, percent.
    found: Estimate,
}

/// `None` where too few seeds have both.
fn compared(lines: &[&Line<Run>], tuned: &str) -> Option<Compared> {
    let runs: Vec<_> = beside(lines, tuned).map(results).collect();
    if runs.len() < LEAST_RUNS {
        return None;
    }
    let differences = |of: fn(f64) -> f64| {
        let run = |[own, other]: &[&Run; 2]| {
            let pairs = own.tuned.losses().into_iter().zip(other.tuned.losses());
            pairs.map(|(own, other)| of(own) - of(other)).collect()
        };
        runs.iter().map(run).collect::<Vec<Vec<f64>>>()
    };
    let found = |[own, other]: &[&Run; 2]| vec![own.tuned.recall_pct - other.tuned.recall_pct];
    Some(Compared {
        ratio: to(lines, tuned)?,
        root: mean_of_groups(&differences(f64::sqrt))?,
        plain: mean_of_groups(&differences(|error| error))?,
        found: mean_of_groups(&runs.iter().map(found).collect::<Vec<_>>())?,
    })
}

/// Lines of both together and of a row, of each place and seed that has both.
fn beside<'a>(lines: &[&'a Line<Run>], tuned: &str) -> impl Iterator<Item = [&'a Line<Run>; 2]> {
    let pair = move |line: &&'a Line<Run>| {
        let cell = line.cell.with("tuned", tuned);
        let other = lines.iter().find(|other| other.cell == cell && tuned != BOTH)?;
        Some([*line, *other])
    };
    lines.iter().filter(|line| line.cell.of("tuned") == BOTH).filter_map(pair)
}

fn results(lines: [&Line<Run>; 2]) -> [&Run; 2] {
    lines.map(|line| &line.result)
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

    /// Both together err 400 and the sensor `lidar` with each seed; other rows always less.
    fn lines(lidar: [u32; 3]) -> Vec<Line<Run>> {
        let of_seed = |(seed, lidar): (&str, u32)| {
            [
                line("registration", seed, 800),
                line("lidar", seed, lidar),
                line("combined-half", seed, 600),
                line("hand", seed, 700),
                line("joint", seed, 400),
            ]
        };
        ["1", "2", "3"].into_iter().zip(lidar).flat_map(of_seed).collect()
    }

    #[test]
    fn both_together_are_compared_with_each_row_of_the_same_seeds() {
        let mut lines = lines([400; 3]);
        lines.retain(|line| line.cell.of("tuned") != "lidar" || line.cell.of("seed") != "3");
        lines.push(line("lidar", "9", 1)); // a seed without both together
        let page = tables(&lines);
        let row = |tuned: &str| {
            let is_it = |row: &&str| row.contains(&format!("structured | {tuned} |"));
            page.lines().find(is_it).unwrap().to_owned()
        };
        assert!(row("registration").ends_with("| **× 0.50** (0.50 to 0.50) |"), "{page}");
        assert!(row("registration").contains("| 3 | 900 | 1 | 99.0 % | 0.80 cm | 800.0 cm |"));
        assert!(row("sensor").ends_with("| × 1.00 (1.00 to 1.00) |"), "{page}");
        assert!(row("both together").ends_with("| – |"), "{page}");
        // Of two seeds the summary says nothing.
        assert!(!page.contains("| sensor | 1 |"), "{page}");
    }

    #[test]
    fn a_place_counts_where_every_required_control_is_shown_to_err_more() {
        let page = tables(&lines([500; 3]));
        assert!(page.contains("| sensor | 1 | 1 | 0 | 1 | 0 | 0 | 0 |"), "{page}");
        assert!(page.contains("of these is shown in 1 of 1 places, a smaller root in 1: sensor;"));
        let page = tables(&lines([300, 300, 900]));
        assert!(page.contains("| sensor | 1 | 0 | 0 | 0 | 0 | 0 | 0 |"), "{page}");
        assert!(page.contains("is shown in 0 of 1 places, a smaller root in 0"), "{page}");
        let page = tables(&lines([300; 3]));
        assert!(page.contains("| sensor | 1 | 0 | 1 | 0 | 1 | 1 | 0 |"), "{page}");
    }

    #[test]
    fn over_places_only_seeds_count_that_have_both_in_each_of_them() {
        let mut lines = lines([500; 3]);
        let page = tables(&lines);
        let halves = |ratio: &str| format!("| halves combined | {ratio} | – | – | – | {ratio} |");
        assert!(page.contains(&halves("**× 0.67** (0.67 to 0.67)")), "{page}");
        let shown = claim(&lines.iter().collect::<Vec<_>>());
        let sensor = "| sensor | **× 0.80** | – | – | – | **× 0.80** (0.80 to 0.80) |";
        assert!(shown.contains(sensor), "{shown}");
        assert!(!shown.contains("| sensor, then registration |"), "{shown}");
        let elsewhere: Vec<Line<Run>> = lines
            .iter()
            .map(|line| Line { cell: line.cell.with("scene", "unstructured"), ..line.clone() })
            .collect();
        lines.extend(elsewhere);
        // There both together err twice as much, of seed 3 fifty times.
        for line in lines.iter_mut().skip(15).filter(|line| line.cell.of("tuned") == "joint") {
            let factor = if line.cell.of("seed") == "3" { 50 } else { 2 };
            line.result.tuned.errors.iter_mut().for_each(|error| *error *= factor);
        }
        let row = |page: &str| -> Option<String> {
            let mut own = page.lines().filter(|row| row.starts_with("| halves combined |"));
            own.nth(1).map(str::to_owned)
        };
        // Of each seed √(0.67 × 1.33), but of the last √(0.67 × 33).
        let page = tables(&lines);
        assert!(row(&page).unwrap().starts_with("| halves combined | × 1.61 ("), "{page}");
        lines.retain(|line| {
            ["tuned", "scene", "seed"].map(|axis| line.cell.of(axis))
                != ["combined-half", "unstructured", "3"]
        });
        // Of two whole seeds nothing is said.
        let page = tables(&lines);
        assert_eq!(row(&page), None, "{page}");
        // Nor are places counted for what was not run.
        lines.retain(|line| line.cell.of("tuned") != "hand");
        assert!(!tables(&lines).contains("is shown in"), "{page}");
    }

    #[test]
    fn fewer_pairs_found_are_counted_and_whose_sensor_it_is() {
        let mut lines = lines([500; 3]);
        for line in &mut lines {
            let is_both = line.cell.of("tuned") == "joint";
            line.result.tuned.recall_pct = if is_both { 90.0 } else { 95.0 };
            let power = if is_both && line.cell.of("seed") == "1" { 2.0 } else { 1.0 };
            line.result.parameters.insert("lidar.power".into(), power);
        }
        let page = tables(&lines);
        assert!(page.contains("| registration | 1 | 1 | 0 | 1 | 0 | 0 | 1 |"), "{page}");
        let prose = page.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(prose.contains("Of 3 runs of both together 1 end at a sensor of their own, 2 at"));
        assert!(page.lines().all(|line| line.starts_with('|') || line.chars().count() <= 100));
    }

    #[test]
    fn lost_pairs_weigh_in_the_roots_and_hardly_in_the_ratio() {
        let mut lines = lines([200; 3]);
        for line in &mut lines {
            let errors = &mut line.result.tuned.errors;
            match line.cell.of("tuned") {
                "joint" => errors.fill(2_000),
                "lidar" => errors[..20].fill(100_000),
                _ => {}
            }
        }
        let page = tables(&lines);
        assert!(page.contains("| sensor | 1 | 0 | 1 | 1 | 0 | 0 | 0 |"), "{page}");
    }
}
