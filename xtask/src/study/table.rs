//! The page's table, written between two marks.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::cell::{Cell, Condition, Method, Protocol, Scene, Strategy};
use super::record::{Judged, Line, energy};
use crate::bootstrap::{Interval, mean};

/// What is compared: the same in everything but strategy, protocol and seed.
type Place = (Condition, Method, Scene);

pub(super) fn tables(lines: &[Line]) -> String {
    let mut places: BTreeMap<Place, Vec<&Line>> = BTreeMap::new();
    for line in lines {
        let Cell { condition, method, scene, .. } = line.cell;
        places.entry((condition, method, scene)).or_default().push(line);
    }
    let mut text = String::new();
    let mut heading = None;
    for ((condition, method, scene), lines) in places {
        if heading != Some((condition, method)) {
            heading = Some((condition, method));
            let _ =
                write!(text, "\n### {}, {condition}\n\n{HEAD}", method.to_string().to_uppercase());
        }
        rows(&mut text, scene, &lines);
    }
    text.push('\n');
    text
}

const HEAD: &str = "\
| scene | tuned | by | runs | searched | recall | mean error | energy a scan | to the start \
| to registration | to the sensor | to `paper` |
|---|---|---|---|---|---|---|---|---|---|---|---|
";

fn rows(text: &mut String, scene: Scene, lines: &[&Line]) {
    // A seed's start is the same for all that was tuned from it.
    let starts: BTreeMap<u64, &Judged> =
        lines.iter().map(|line| (line.cell.seed, &line.start)).collect();
    row(
        text,
        &[scene.to_string(), "nothing".into(), "–".into()],
        &starts.into_values().collect::<Vec<_>>(),
        None,
        ["–"; 4].map(String::from),
    );
    let of = |strategy: Strategy, protocol: Protocol| -> Vec<&Line> {
        let is_asked =
            |line: &&&Line| (line.cell.strategy, line.cell.protocol) == (strategy, protocol);
        lines.iter().filter(is_asked).copied().collect()
    };
    for strategy in
        [Strategy::Paper, Strategy::Short, Strategy::Warm, Strategy::Fast, Strategy::Thrift]
    {
        for protocol in [Protocol::Lidar, Protocol::Registration, Protocol::Joint] {
            let runs = of(strategy, protocol);
            if runs.is_empty() {
                continue;
            }
            let tuned: Vec<&Judged> = runs.iter().map(|line| &line.tuned).collect();
            let count = runs.iter().map(|line| line.registrations).sum::<u64>() / runs.len() as u64;
            // Beside what else was tuned with the same seed, where that is another row.
            let beside = |strategy, protocol| {
                let others = of(strategy, protocol);
                against(&runs, move |line| {
                    let same = others.iter().find(|other| other.cell.seed == line.cell.seed);
                    same.map(|other| &other.tuned)
                })
            };
            let half = |half| (protocol == Protocol::Joint).then(|| beside(strategy, half))?;
            // One that searched for the least energy was not after the paper's error.
            let is_beside = !matches!(strategy, Strategy::Paper | Strategy::Thrift);
            let papers = || is_beside.then(|| beside(Strategy::Paper, protocol))?;
            let gains = [
                against(&runs, |line| Some(&line.start)),
                half(Protocol::Registration),
                half(Protocol::Lidar),
                papers(),
            ];
            let names = [scene.to_string(), protocol.to_string(), strategy.to_string()];
            row(text, &names, &tuned, Some(count), gains.map(|gain| gain.map_or("–".into(), told)));
        }
    }
}

fn row(
    text: &mut String,
    names: &[String; 3],
    judged: &[&Judged],
    count: Option<u64>,
    gains: [String; 4],
) {
    let of = |value: fn(&Judged) -> f64| {
        judged.iter().map(|judged| value(judged)).sum::<f64>() / judged.len() as f64
    };
    let recall_pct = of(|judged| judged.recall_pct);
    let means: Vec<f64> = judged.iter().filter_map(|judged| judged.mean_cm).collect();
    // Over the runs that found a pair.
    let mean_cm = match means.len() {
        0 => "–".to_owned(),
        runs => format!("{:.2} cm", means.iter().sum::<f64>() / runs as f64),
    };
    let energy_mj = of(|judged| judged.energy_mj);
    let count = count.map_or("–".to_owned(), |count| count.to_string());
    let [scene, tuned, by] = names;
    let (runs, gains) = (judged.len(), gains.join(" | "));
    let _ = writeln!(
        text,
        "| {scene} | {tuned} | {by} | {runs} | {count} | {recall_pct:.1} % | {mean_cm} \
         | {} | {gains} |",
        energy(energy_mj)
    );
}

/// By how much the errors of runs differ from those of others on the same pairs: the mean
/// difference of the logarithms, a run a group.
fn against<'a>(
    runs: &[&'a Line],
    other: impl Fn(&'a Line) -> Option<&'a Judged>,
) -> Option<Interval> {
    /// A tenth of a millimetre: nothing counts for less.
    const LEAST: f64 = 1e-4;
    let differences = |line: &&'a Line| {
        let other = other(line)?.losses();
        let pairs = line.tuned.losses().into_iter().zip(other);
        Some(pairs.map(|(a, b)| (a.max(LEAST) / b.max(LEAST)).ln()).collect::<Vec<f64>>())
    };
    mean(&runs.iter().filter_map(differences).collect::<Vec<_>>())
}

/// A difference of logarithms as a ratio.
fn told(interval: Interval) -> String {
    let Interval { value, low, high } = interval;
    let [value, low, high] = [value, low, high].map(|logarithm| digits(logarithm.exp()));
    let doubt = if interval.holds(0.0) { "" } else { "**" };
    format!("{doubt}× {value}{doubt} ({low} to {high})")
}

/// Two places, and two digits at least: a thousandth is not nothing.
fn digits(ratio: f64) -> String {
    let places = if ratio > 0.0 { (1.0 - ratio.log10().floor()).clamp(2.0, 9.0) } else { 2.0 };
    format!("{ratio:.*}", places as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(protocol: Protocol, seed: u64, start: u32, tuned: u32) -> Line {
        let judged = |error: u32| Judged {
            recall_pct: 100.0,
            mean_cm: Some(f64::from(error) / 1e3),
            energy_mj: 4.6,
            errors: (0..100).map(|i| error + i % 2).collect(),
        };
        let cell = Cell {
            strategy: Strategy::Fast,
            protocol,
            method: Method::Icp,
            scene: Scene::Structured,
            condition: Condition::Clear,
            seed,
        };
        let (made, origin) = ("today".into(), "start".into());
        Line {
            cell,
            made,
            registrations: 900,
            origin,
            parameters: BTreeMap::new(),
            start: judged(start),
            tuned: judged(tuned),
        }
    }

    #[test]
    fn a_ratio_has_two_places_and_more_where_it_is_small() {
        let texts = [1.234, 0.5, 0.0949, 0.00123, 0.0].map(digits);
        assert_eq!(texts, ["1.23", "0.50", "0.095", "0.0012", "0.00"]);
    }

    #[test]
    fn both_together_are_compared_with_registration_alone_of_the_same_seed() {
        let lines = [
            line(Protocol::Registration, 1, 1000, 800),
            line(Protocol::Registration, 2, 2000, 1000),
            line(Protocol::Joint, 1, 1000, 400),
            line(Protocol::Joint, 2, 2000, 500),
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
    fn of_two_runs_only_those_of_one_seed_are_compared_with_the_sensor_s_and_the_paper_s() {
        let mut papers = line(Protocol::Joint, 2, 2000, 250);
        papers.cell.strategy = Strategy::Paper;
        let lines = [
            line(Protocol::Lidar, 1, 1000, 800),
            line(Protocol::Joint, 1, 1000, 400),
            line(Protocol::Joint, 2, 2000, 500),
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
