//! Goals beside the error: the least of a cost, and the front of error against it.

use std::fs;

use crate::fixture::Fixture;
use serde_json::Value;

const RUN: &str = "runs/latest";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn the_least_energy_is_the_cheapest_whose_error_is_within_the_limit() {
    let fixture = Fixture::new();
    let least = ["--minimise=energy", "--at-most-error=1.5x"];
    fixture.tune(&[&least[..], &["--generations=6", "--seed=2"]].concat());
    let result = fixture.result();
    let energy = |who: &str| number(&result[who]["cost"]["energy_j"]);
    let share = energy("tuned_summary") / energy("default_summary");
    assert!(share < 0.8, "{share} of the start's");
    let finalists = result["finalists"].as_array().expect("a list");
    let of = |origin: &Value| {
        let own = finalists.iter().find(|one| one["origin"] == *origin && one["pairs"] == 4);
        number(&own.unwrap_or_else(|| panic!("{origin} was not judged to the end"))["fitness"])
    };
    // Fitness is the share of the start's energy, more where the limit is passed or a pair is lost.
    let chosen = of(&result["origin"]);
    assert!((chosen / share - 1.0).abs() < 1e-9, "{chosen} for {share}: beyond the limit");
    assert_eq!(of(&"start".into()), 1.0);
    // Here one that is fitter passes the limit: its energy is worth the penalty to a search.
    assert_eq!(finalists[0]["origin"], result["origin"], "best first");
    let fittest = finalists.iter().map(|one| number(&one["fitness"]));
    assert!(fittest.fold(f64::INFINITY, f64::min) < chosen, "the test has lost its case");
}

#[test]
fn every_other_cost_is_made_less_and_has_a_front_too() {
    let shots = ["--tune=lidar.shots=1..8", "--set=lidar.shots=4"];
    for (cost, more) in [("instructions", &[][..]), ("bits", &[]), ("seconds", &shots)] {
        let fixture = Fixture::new();
        let (least, front) = (format!("--minimise={cost}"), format!("--pareto={cost}"));
        let few = ["front.generations=4", "front.population=8", "front.pairs=2"];
        let few: Vec<&str> = few.iter().flat_map(|set| ["--set", set]).collect();
        let own = [least.as_str(), &front, "--at-most-error=1.5x", "--generations=2", "--seed=4"];
        fixture.tune(&[&own[..], more, &few].concat());
        let result = fixture.result();
        let of = |judged: &Value| number(&judged["cost"][cost]);
        let share = of(&result["tuned_summary"]) / of(&result["default_summary"]);
        assert!(share < 0.95, "{cost}: {share} of the start's");
        let points = result["front"]["points"].as_array().expect("a list");
        let costs: Vec<f64> = points.iter().map(of).collect();
        assert!(costs.len() > 1, "{cost}: {costs:?}");
        assert!(costs.windows(2).all(|pair| pair[0] < pair[1]), "{cost}: {costs:?}");
    }
}

#[test]
fn the_least_energy_is_refused_where_the_start_finds_nothing() {
    let fixture = Fixture::new();
    let strict = ["--set=data.success_translation_m=1e-9", "--minimise=energy", "--runs=runs"];
    let output = fixture.run(&[&["tune", "-c", "small.toml", "-q"], &strict[..]].concat());
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    for part in ["minimise", "registers none of 4", "--run"] {
        assert!(output.stderr.contains(part), "no {part:?}: {}", output.stderr);
    }
    assert!(!fixture.path("runs/latest/result.json").exists());
    assert!(fixture.path("runs/latest/history.jsonl").exists(), "the journal is kept");
}

#[test]
fn a_front_has_each_cost_once_and_goes_on_from_its_journal_to_the_same_points() {
    let fixture = Fixture::new();
    let few = ["front.generations=4", "front.population=8", "front.pairs=2"];
    let few = few.iter().flat_map(|set| ["--set", set]);
    let points = ["--pareto=energy", "--points=5"];
    fixture.tune(&points.into_iter().chain(few).collect::<Vec<_>>());
    let front = fixture.result()["front"].clone();
    let found = front["points"].as_array().expect("a list");
    assert!((2..=5).contains(&found.len()), "{front}");
    let energies: Vec<f64> = found.iter().map(|one| number(&one["cost"]["energy_j"])).collect();
    assert!(energies.windows(2).all(|pair| pair[0] < pair[1]), "cheapest first: {energies:?}");
    let start = number(&front["default"]["cost"]["energy_j"]);
    assert!(energies[0] < start / 100.0, "down to where little is found: {energies:?}");
    for point in found {
        let interval = [0, 1].map(|end| number(&point["interval"][end]));
        let error = number(&point["error"]);
        assert!(interval[0] <= error && error <= interval[1], "{point}");
    }

    // As a run has it that was killed after two generations of four.
    let names = ["front.jsonl", "result.json", "report.html"].map(|name| format!("{RUN}/{name}"));
    let whole: Vec<_> = names.iter().map(|name| fixture.repeatable(name)).collect();
    let journal = fixture.read(&names[0]);
    assert_eq!(journal.lines().count(), 1 + 4);
    let begun: String = journal.split_inclusive('\n').take(1 + 2).collect();
    let stop = |journal: &str| {
        fixture.write(&names[0], journal);
        fs::remove_file(fixture.path(&names[1])).expect("removed");
    };
    stop(&begun);
    fixture.succeed(&["tune", "-q", "--resume", RUN]);
    for (name, whole) in names.iter().zip(&whole) {
        assert!(fixture.repeatable(name) == *whole, "{name} differs");
    }

    // A number that was changed is not believed, and the journal stays as it is.
    let changed = begun.replacen("\"fitness\":0", "\"fitness\":1", 1);
    stop(&changed);
    let output = fixture.run(&["tune", "-q", "--resume", RUN]);
    assert_eq!(output.code, Some(2), "{}", output.stderr);
    assert!(output.stderr.contains("front.jsonl: line 2"), "{}", output.stderr);
    assert_eq!(fixture.read(&names[0]), changed);
}
