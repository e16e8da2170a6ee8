//! Sets of pairs: kept in a file, as hard as is asked for.

use crate::fixture::Fixture;
use echoloop_closed_loop::config::load;
use echoloop_closed_loop::dataset::Dataset;
use serde_json::Value;

fn stored(fixture: &Fixture) {
    fixture.succeed(&["store", "-q", "-c", "small.toml", "-o", "kept.pairs"]);
}

fn evaluated(fixture: &Fixture, from: &[&str]) -> Value {
    fixture.succeed(&[&["evaluate", "-q", "--json"], from].concat()).json()
}

#[test]
fn stored_pairs_are_judged_as_traced_ones_and_bring_their_configuration() {
    let fixture = Fixture::new();
    stored(&fixture);
    let traced = evaluated(&fixture, &["-c", "small.toml"]);
    assert_eq!(evaluated(&fixture, &["--stored", "kept.pairs"]), traced);
    // The sensor's settings are free; what the pairs are of is not.
    let weaker = ["--set", "lidar.power=0.01"];
    let from_file = evaluated(&fixture, &[&["--stored", "kept.pairs"], &weaker[..]].concat());
    let from_scene = evaluated(&fixture, &[&["-c", "small.toml"], &weaker[..]].concat());
    assert_eq!(from_file, from_scene);
    assert_ne!(from_file["summary"], traced["summary"]);
}

#[test]
fn a_run_on_stored_pairs_is_the_run_on_traced_ones() {
    let fixture = Fixture::new();
    stored(&fixture);
    let from_stored = fixture.succeed(&["tune", "-q", "--json", "--stored", "kept.pairs"]).json();
    let traced = Fixture::new();
    traced.tuned(&[]);
    let summaries =
        |result: &Value| (result["tuned_summary"].clone(), result["default_summary"].clone());
    assert_eq!(summaries(&from_stored), summaries(&traced.result()));
}

#[test]
fn stored_pairs_of_something_else_are_refused_by_name() {
    let fixture = Fixture::new();
    stored(&fixture);
    fixture.write("cut.pairs", &std::fs::read(fixture.path("kept.pairs")).unwrap()[..900]);
    for (arguments, said) in [
        (&["--stored", "kept.pairs", "--seed", "2"][..], "seed = 1, and 2 is asked for"),
        (&["--stored", "kept.pairs", "--set", "data.test_pairs=9"], "data.test_pairs = 3"),
        (&["--stored", "cut.pairs"], "cut.pairs: cut short or damaged"),
        (&["--stored", "small.toml"], "small.toml: no file of pairs"),
        (&["--stored", "none.pairs"], "none.pairs: cannot be read"),
        (&["--set", "scene.stored=none.pairs"], "none.pairs: cannot be read"),
    ] {
        let output = fixture.run(&[&["evaluate", "-q"], arguments].concat());
        assert_eq!(output.code, Some(2), "{arguments:?}: {}", output.stderr);
        assert!(output.stderr.contains(said), "{arguments:?}: {}", output.stderr);
    }
    let output = fixture.run(&["store", "-q", "-c", "small.toml", "-o", "no/such/kept.pairs"]);
    assert_eq!(output.code, Some(2), "{}", output.stderr);
}

#[test]
fn a_set_says_how_much_its_pairs_share_and_takes_only_those_that_are_asked_for() {
    let fixture = Fixture::new();
    let list = |folder: &str, more: &[&str]| -> Value {
        fixture.succeed(&[&["pairs", "-q", "-c", "small.toml", "-o", folder][..], more].concat());
        serde_json::from_str(&fixture.read(&format!("{folder}/pairs.json"))).expect("JSON")
    };
    let overlaps = |list: &Value| -> Vec<f64> {
        let pairs = list["pairs"].as_array().expect("a list");
        pairs.iter().map(|pair| pair["overlap"].as_f64().expect("a number")).collect()
    };
    let near = list("near", &[]);
    assert!(near["set"]["least_apart_m"].as_f64().unwrap() > 5.0, "{}", near["set"]);
    let far = list("far", &["--set", "data.most_overlap=0.7", "--set", "data.difficulty=5"]);
    assert!(overlaps(&near).iter().all(|&share| share > 0.9), "{:?}", overlaps(&near));
    assert!(overlaps(&far).iter().all(|&share| share <= 0.7), "{:?}", overlaps(&far));
    for (set, said) in [
        ("data.least_overlap=1.5", "data.least_overlap = 1.5"),
        ("data.difficulty=7", "data.difficulty = 7"),
        ("data.most_overlap=0.001", "share too much or too little"),
    ] {
        let output = fixture.run(&["evaluate", "-q", "-c", "small.toml", "--set", set]);
        assert_eq!(output.code, Some(2), "{set}: {}", output.stderr);
        assert!(output.stderr.contains(said), "{set}: {}", output.stderr);
    }
    let both = ["--set", "data.least_overlap=0.6", "--set", "data.most_overlap=0.5"];
    let output = fixture.run(&[&["evaluate", "-q", "-c", "small.toml"], &both[..]].concat());
    assert!(output.stderr.contains("data.least_overlap = 0.6 must be at most"));
}

#[test]
fn the_harder_pairs_are_the_fewer_are_registered_and_the_difficulty_between_is_found() {
    let fixture = Fixture::new();
    let more = ["--pairs", "12"];
    let arguments = ["difficulty", "-q", "--json", "-c", "small.toml", "--recall", "50"];
    let found = fixture.succeed(&[&arguments[..], &more].concat()).json();
    let steps = found["steps"].as_array().expect("steps");
    let successes = |step: &Value| step["successes"].as_u64().expect("a count");
    assert_eq!(successes(&steps[0]), 12, "{found}");
    assert!(successes(&steps[steps.len() - 1]) < 6, "{found}");
    let held_out = &found["found"][0]["held_out"];
    assert!(held_out["difficulty"].as_f64().unwrap() > 0.5, "{found}");
    assert!((2..=10).contains(&successes(held_out)), "{found}");
}

#[test]
fn vehicles_drive_on_between_the_scans_of_a_pair_and_nothing_else_does() {
    let pairs = |interval_s: &str| {
        let sets = [
            "scene.source=old-town",
            "scanner.pattern=grid",
            "scanner.columns=90",
            "scanner.rows=8",
            "scanner.azimuth_deg=360",
            "data.train_pairs=4",
            "data.test_pairs=1",
            interval_s,
        ];
        let overrides: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Dataset::build(&load(None, &overrides).unwrap(), &|_, _| ()).unwrap()
    };
    let (still, moved) = (pairs("data.interval_s=0"), pairs("data.interval_s=2"));
    let (mut changed, mut of) = (0, 0);
    for (a, b) in still.train.iter().zip(&moved.train) {
        assert_eq!(a.world_from_sensor, b.world_from_sensor);
        assert_eq!(a.first.to(&still.beams), b.first.to(&moved.beams));
        let [a, b] = [a.second.to(&still.beams), b.second.to(&moved.beams)];
        let differs = |beam: &usize| a.of(*beam) != b.of(*beam);
        changed += (0..a.len()).filter(differs).count();
        of += a.len();
    }
    assert!(0 < changed && 10 * changed < of, "{changed} of {of} beams");
}
