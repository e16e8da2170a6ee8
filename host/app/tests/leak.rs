//! Held-out pairs judge and do nothing else: with others, with none, judged before or after, a
//! search asks for the same candidates, writes the same journal and chooses the same parameters.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

use echoloop_host::experiment::config::{Override, RunConfig, load};
use echoloop_host::experiment::dataset::{Dataset, ScanPair};
use echoloop_host::experiment::journal::Journal;
use echoloop_host::experiment::objective::Bench;
use echoloop_host::experiment::params::{Parameters, Space};
use echoloop_host::experiment::seed::{Purpose, derive};
use echoloop_host::experiment::tune::{Silent, TuneSearch};
use echoloop_host::link::sensor::{Model, Sensors};

const SMALL: [&str; 9] = [
    "scene.towns=[1]",
    "scanner.columns=48",
    "scanner.rows=16",
    "data.train_pairs=4",
    "data.test_pairs=3",
    "tune.generations=2",
    "tune.population=4",
    "registration.method=icp",
    "data.baseline_m=0.5",
];

fn config(more: &[&str]) -> RunConfig {
    let texts = SMALL.iter().chain(more);
    let overrides: Vec<Override> = texts.map(|text| text.parse().expect(text)).collect();
    load(None, &overrides).expect("a configuration")
}

fn dataset(config: &RunConfig) -> Dataset {
    Dataset::build(config, &|_, _| ()).expect("pairs")
}

/// What a search leaves: its journal and its choice, to the byte.
#[derive(PartialEq)]
struct Left {
    journal: Vec<u8>,
    chosen: Vec<u8>,
}

/// Searches on these pairs. The first line of the journal names what was scanned, the held-out
/// pairs too, so it is that of `named` each time; the checksums of all lines follow it.
fn searched(config: &RunConfig, named: &Dataset, scanned: &Dataset, judged_first: bool) -> Left {
    let sensors = Sensors::in_process(Model::from(config));
    let start = Parameters::start(config, &config.hardware()).expect("a start");
    let (tune, stop) = (&config.tune, AtomicBool::new(false));
    let search = |dataset| TuneSearch {
        config,
        bench: Bench { dataset, sensors: &sensors },
        space: Space::new(
            tune.protocol,
            tune.lidar,
            config.registration.preset,
            start,
            config.hardware(),
        ),
        start,
        stop: &stop,
    };
    let header = search(named).header();
    let search = search(scanned);
    if judged_first {
        search.judge(&start, &Silent).expect("it is judged");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("history.jsonl");
    let mut journal = Journal::create(&path, &header).expect("a journal");
    let tuned = search.run(&mut journal, Vec::new(), &Silent).expect("a search");
    let chosen = (tuned.parameters.values(config), &tuned.origin, &tuned.finalists);
    Left {
        journal: std::fs::read(&path).expect("its journal"),
        chosen: serde_json::to_vec(&chosen).expect("its choice"),
    }
}

/// A start's errors on the held-out pairs.
fn errors(config: &RunConfig, dataset: &Dataset) -> Vec<f64> {
    let sensors = Sensors::in_process(Model::from(config));
    let start = Parameters::start(config, &config.hardware()).expect("a start");
    let (bench, stop) = (Bench { dataset, sensors: &sensors }, AtomicBool::new(false));
    let space = Space::new(
        config.tune.protocol,
        config.tune.lidar,
        config.registration.preset,
        start,
        config.hardware(),
    );
    let search = TuneSearch { config, bench, space, start, stop: &stop };
    let summary = search.judge(&start, &Silent).expect("it is judged");
    summary.errors.iter().map(|error| error.frobenius).collect()
}

#[test]
fn no_place_no_noise_and_no_error_of_a_held_out_pair_reaches_the_search_or_the_choice() {
    for more in [["tune.strategy=fast"], ["tune.strategy=paper"]] {
        let config = config(&more);
        let usual = dataset(&config);
        let elsewhere = dataset(&RunConfig { seed: 77, ..config.clone() });
        let with = |test: Vec<ScanPair>| Dataset { test, ..usual.clone() };
        let lost = {
            // Truths that nobody finds: every judged error is another.
            let mut test = usual.test.clone();
            test.iter_mut().for_each(|pair| pair.truth.translation.vector.x += 30.0);
            with(test)
        };
        let before = searched(&config, &usual, &usual, false);
        let variants = [
            ("other places", with(elsewhere.test.clone()), false),
            ("other errors", lost, false),
            ("the pairs it is tuned on", with(usual.train.clone()), false),
            ("none", with(Vec::new()), false),
            ("judged before the search", usual.clone(), true),
        ];
        for (what, scanned, judged_first) in &variants {
            let after = searched(&config, &usual, scanned, *judged_first);
            assert!(after.journal == before.journal, "{more:?}, {what}: another journal");
            assert!(after.chosen == before.chosen, "{more:?}, {what}: another choice");
        }
        // What should make a difference does.
        let trained_elsewhere = Dataset { train: elsewhere.train.clone(), ..usual.clone() };
        assert!(searched(&config, &usual, &trained_elsewhere, false) != before);
        for (what, scanned, _) in &variants[..3] {
            assert_ne!(errors(&config, scanned), errors(&config, &usual), "{what}");
        }
    }
}

#[test]
fn how_many_pairs_are_held_out_moves_no_pair_to_tune_on_and_none_stands_where_one_is_judged() {
    let [few, many] = [&["data.test_pairs=3"], &["data.test_pairs=6"]].map(|more| {
        let config = config(more);
        dataset(&config)
    });
    assert_eq!(few.train.len(), many.train.len());
    for (a, b) in few.train.iter().zip(&many.train) {
        assert_eq!(a.world_from_sensor, b.world_from_sensor);
        assert_eq!((&a.first.returns, &a.second.returns), (&b.first.returns, &b.second.returns));
    }
    let places = |pairs: &[ScanPair]| -> BTreeSet<String> {
        let poses = pairs.iter().flat_map(|pair| pair.world_from_sensor);
        poses.map(|pose| format!("{:?}", pose.translation.vector)).collect()
    };
    assert!(places(&many.train).is_disjoint(&places(&many.test)));
}

#[test]
fn the_noise_that_judges_is_none_that_was_tuned_on() {
    for seed in [1, 2, u64::MAX] {
        let of = |purpose| (0..20_000).map(move |index| derive(seed, purpose, index));
        let judged: BTreeSet<u64> = of(Purpose::TestNoise).collect();
        for purpose in [Purpose::TrainNoise, Purpose::ShortlistNoise, Purpose::FrontNoise] {
            assert!(of(purpose).all(|noise| !judged.contains(&noise)), "{purpose:?}");
        }
    }
}
