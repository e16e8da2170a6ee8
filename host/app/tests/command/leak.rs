//! Held-out pairs judge and do nothing else: with others, with none, judged before or after, a
//! search asks for the same candidates, writes the same journal and chooses the same parameters.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use echoloop_closed_loop::config::{Override, RunConfig, load};
use echoloop_closed_loop::dataset::{Dataset, ScanPair};
use echoloop_closed_loop::evaluation::objective::Bench;
use echoloop_closed_loop::parameters::{Parameters, Space};
use echoloop_closed_loop::run_folder::journal::Journal;
use echoloop_closed_loop::search::{Silent, TuneSearch};
use echoloop_closed_loop::seed::{Purpose, derive};
use echoloop_frontend::{Analog, FrontEnd, ScanNoise, SceneResponse, Trigger};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::RetryPolicy;
use echoloop_sensors::sensor::{Model, Sensor, SensorError, Sensors};
use echoloop_sensors::serve::Viewpoints;
use echoloop_sensors::transport::InProcess;

const SMALL: [&str; 10] = [
    "scene.towns=[1]",
    "scanner.pattern=grid",
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

/// A search for what the configuration says, that nobody stops.
fn of<'a>(config: &'a RunConfig, dataset: &'a Dataset, sensors: &'a Sensors) -> TuneSearch<'a> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let start = Parameters::start(config, &config.device()).expect("a start");
    let (tune, preset) = (&config.tune, config.registration.preset);
    let space = Space::new(tune.protocol, tune.lidar, preset, start, config.device());
    TuneSearch {
        config,
        bench: Bench { dataset, sensors },
        space,
        start,
        warm_starts: Vec::new(),
        stop: &NEVER,
        elsewhere: None,
    }
}

/// Results of a search: its journal and its choice, to the byte.
#[derive(PartialEq)]
struct Left {
    journal: Vec<u8>,
    chosen: Vec<u8>,
}

/// Searches on these pairs. The first line of the journal names what was scanned, the held-out
/// pairs too, so it is that of `named` each time; the checksums of all lines follow it.
fn searched(config: &RunConfig, named: &Dataset, scanned: &Dataset, judged_first: bool) -> Left {
    let sensors = Sensors::in_process(Model::from(config));
    let header = of(config, named, &sensors).header();
    let search = of(config, scanned, &sensors);
    if judged_first {
        search.judge(&search.start, &Silent).expect("it is judged");
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
    let search = of(config, dataset, &sensors);
    let summary = search.judge(&search.start, &Silent).expect("it is judged");
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

/// Views asked of a sensor: viewpoints by their number, each with the seed of its noise.
type Asked = BTreeSet<(u32, u64)>;

/// Shows viewpoints, and notes which.
struct Noting {
    shown: Viewpoints,
    noise: Option<ScanNoise>,
    asked: Arc<Mutex<Asked>>,
}

impl FrontEnd for Noting {
    fn adc_bits(&self) -> u32 {
        self.shown.adc_bits()
    }

    fn name_noise(&mut self, noise: Option<ScanNoise>) {
        self.noise = noise;
        self.shown.name_noise(noise);
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        let seed = self.noise.expect("every request says what decides its noise").seed;
        self.asked.lock().expect("nobody panicked").insert((trigger.frame, seed));
        self.shown.capture(analog, trigger, codes);
    }
}

/// Sensors that have all viewpoints of some pairs before them, as boards on a turntable do, and
/// what they are asked for.
fn noting(config: &RunConfig, dataset: &Dataset) -> (Sensors, Arc<Mutex<Asked>>) {
    let mut views: Vec<Arc<SceneResponse>> = Vec::new();
    let nothing = Arc::new(SceneResponse::empty(dataset.beams.pattern().beams()));
    for pair in dataset.train.iter().chain(&dataset.test) {
        for (viewpoint, view) in pair.viewpoints.into_iter().zip([&pair.first, &pair.second]) {
            let needed = views.len().max(viewpoint as usize);
            views.resize(needed, Arc::clone(&nothing));
            views[viewpoint as usize - 1] = view.to(&dataset.beams);
        }
    }
    let (model, asked) = (Model::from(config), Arc::new(Mutex::new(Asked::new())));
    let noted = Arc::clone(&asked);
    let open = move || {
        let shown = Viewpoints::new(&model, views.clone(), 0);
        let front_end = Noting { shown, noise: None, asked: Arc::clone(&noted) };
        let sensor = PcSensor::new(front_end, model.pattern, model.hardware);
        Sensor::numbered(Box::new(InProcess(sensor)), RetryPolicy::default())
            .map_err(SensorError::client("noting"))
    };
    (Sensors::opened_by("noting", usize::MAX, open), asked)
}

#[test]
fn a_search_asks_for_no_held_out_view_and_no_noise_that_judges_and_the_judgement_for_no_other() {
    for more in [
        ["tune.strategy=fast", "registration.method=icp"],
        ["tune.strategy=paper", "registration.method=icp"],
        ["tune.strategy=fast", "registration.method=fgr"],
        ["tune.strategy=fast", "registration.method=mac"],
    ] {
        let config = config(&more);
        let dataset = dataset(&config);
        let (sensors, asked) = noting(&config, &dataset);
        let search = of(&config, &dataset, &sensors);
        let folder = tempfile::tempdir().expect("a folder");
        let mut journal =
            Journal::create(&folder.path().join("a"), &search.header()).expect("a journal");
        let tuned = search.run(&mut journal, Vec::new(), &Silent).expect("a search");
        let views = |pairs: &[ScanPair]| -> BTreeSet<u32> {
            pairs.iter().flat_map(|pair| pair.viewpoints).collect()
        };
        let take = || std::mem::take(&mut *asked.lock().expect("nobody panicked"));
        let split = |asked: Asked| -> (BTreeSet<u32>, BTreeSet<u64>) { asked.into_iter().unzip() };
        let judging: BTreeSet<u64> =
            (0..1_000).map(|pair| derive(config.seed, Purpose::TestNoise, pair)).collect();

        let (seen, noise) = split(take());
        assert_eq!(seen, views(&dataset.train), "{more:?}: what a search sees");
        assert!(noise.is_disjoint(&judging), "{more:?}: it hears noise that judges");
        search.judge(&tuned.parameters, &Silent).expect("it is judged");
        let (seen, noise) = split(take());
        assert_eq!(seen, views(&dataset.test), "{more:?}: what is judged on");
        assert!(noise.is_subset(&judging), "{more:?}: other noise judges");
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
    }
    let of_train = |dataset: &Dataset| dataset.views().take(2 * dataset.train.len()).collect();
    let [of_few, of_many]: [Vec<_>; 2] = [&few, &many].map(of_train);
    assert_eq!(of_few, of_many);
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
