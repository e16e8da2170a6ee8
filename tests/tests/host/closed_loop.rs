//! The closed loop as a library, on small problems: settings go over the link to the sensor, echoes
//! come back, pairs are registered, better settings are chosen. These tests check that the parts
//! work together, not how well they tune.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::config::preset::{ErrorMean, LidarPreset, PAPER_LIDAR, Preset, Protocol};
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::dataset::{Dataset, Place, Response, ScanPair, respond_at};
use echoloop_closed_loop::evaluation::objective::{Bench, PairError, Worth};
use echoloop_closed_loop::evaluation::scan_cloud::cloud_from_scan;
use echoloop_closed_loop::evaluation::summary::{NoisyPairs, evaluate};
use echoloop_closed_loop::parameters::{Parameters, Space, Values};
use echoloop_closed_loop::run_folder::journal::{Generation, Journal};
use echoloop_closed_loop::search::{Finalist, Observer, Origin, Silent, TuneSearch, Tuned};
use echoloop_closed_loop::seed::Purpose;
use echoloop_clouds::pose::{Pose, relative};
use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Echo, Echoes, Flags, Grid, Hardware, ParameterId, ScanPattern, Settings};
use echoloop_frontend::Receiver;
use echoloop_frontend::{Analog, FrontEnd, Trigger};
use echoloop_frontend::{Return, SceneResponse};
use echoloop_link::settings_hash;
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, ClientError, RetryPolicy};
use echoloop_sensors::sensor::{Detector, Model, Sensor, SensorError, Sensors, View};
use echoloop_sensors::transport::InProcess;
use echoloop_sim::raycast::Raycaster;
use echoloop_sim::scene::{Material, Mesh, Scene};
use nalgebra::{Vector2, Vector3};

const HARDWARE: Hardware = Hardware::REFERENCE;

fn config(more: &[&str]) -> RunConfig {
    let small = [
        "scene.source=structured",
        "scene.towns=[1]",
        "scanner.pattern=grid",
        "scanner.columns=48",
        "scanner.rows=16",
        "data.train_pairs=4",
        "data.test_pairs=3",
        "data.baseline_m=0.5",
        "tune.generations=4",
        "tune.population=6",
        "tune.pairs_per_generation=2",
        "tune.shortlist=2",
    ];
    let overrides = small.iter().chain(more).map(|text| text.parse().expect("an override"));
    load(None, &overrides.collect::<Vec<_>>()).expect("a configuration")
}

/// Stages of a search of both halves.
const OF_BOTH: [&str; 6] =
    ["lidar", "registration", "registration again", "lidar again", "registration last", "joint"];

/// Seed with which the search of the registration improves on its start, so that the sensor is
/// searched again from there, and the final choice has other sensor settings than the start.
const MOVING: &str = "seed=26";

/// The paper's strategy on a small problem.
fn paper(more: &[&str]) -> RunConfig {
    let small = ["scene.source=structured", "scene.towns=[1]", "data.baseline_m=0.5"];
    let few = ["data.train_pairs=4", "data.test_pairs=3"];
    let grid = ["scanner.pattern=grid", "scanner.columns=48", "scanner.rows=16"];
    let texts = small.iter().chain(&few).chain(&grid).chain(&["tune.strategy=paper"]).chain(more);
    let overrides: Vec<_> = texts.map(|text| text.parse().expect("an override")).collect();
    load(None, &overrides).expect("a configuration")
}

/// One town, traced once: scanner and pairs are the same in every test of the search.
static TOWN: LazyLock<Dataset> =
    LazyLock::new(|| Dataset::build(&config(&[]), &|_, _| ()).expect("a town"));

static NEVER: AtomicBool = AtomicBool::new(false);

/// Sensors in process, shared by all tests: it must not matter which one serves which test.
static SENSORS: LazyLock<Sensors> =
    LazyLock::new(|| Sensors::in_process(Model::from(&config(&[]))));

fn search(config: &RunConfig) -> TuneSearch<'_> {
    let start = Parameters::start(config, &config.device()).expect("a start");
    let space = Space::new(
        config.tune.protocol,
        config.tune.lidar,
        config.registration.preset,
        start,
        config.device(),
    );
    let bench = Bench { dataset: &TOWN, sensors: &SENSORS };
    TuneSearch {
        config,
        bench,
        space,
        start,
        warm_starts: Vec::new(),
        stop: &NEVER,
        elsewhere: None,
    }
}

/// Journal and result of a whole search on a number of threads.
fn tuned(config: &RunConfig, threads: usize) -> (Vec<u8>, Tuned) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| run(&search(config), &Silent))
}

/// Whole search with [`MOVING`], for several tests.
static MOVED: LazyLock<(Vec<u8>, Tuned)> = LazyLock::new(|| tuned(&config(&[MOVING]), 2));

/// Whole search with [`BY_ENERGY`], for several tests.
static CHEAPEST: LazyLock<(Vec<u8>, Tuned)> = LazyLock::new(|| tuned(&config(&BY_ENERGY), 2));

/// Journal and result of a whole search with an observer.
fn run(search: &TuneSearch<'_>, observer: &dyn Observer) -> (Vec<u8>, Tuned) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("history.jsonl");
    let mut journal = Journal::create(&path, &search.header()).expect("a journal");
    let tuned = search.run(&mut journal, Vec::new(), observer).expect("a search");
    (std::fs::read(path).expect("a journal"), tuned)
}

/// Error of a training pair in the search, with its noise derived independently: purpose 3, and 32
/// bits of generation, 16 of pair, 16 of candidate.
fn error_in_the_search(
    search: &TuneSearch<'_>,
    parameters: &Parameters,
    (generation, pair, candidate): (u64, usize, u64),
) -> PairError {
    let index = generation << 32 | (pair as u64) << 16 | candidate;
    let noise = echoloop_random::derive(search.config.seed, 3, index);
    let registered = search.bench.register(parameters, pair, &TOWN.train[pair], noise);
    registered.expect("a registration").error
}

/// Training pairs with the noise of the final selection.
fn shortlist_pairs(config: &RunConfig) -> NoisyPairs<'static> {
    NoisyPairs { pairs: &TOWN.train, seed: config.seed, purpose: Purpose::ShortlistNoise }
}

#[test]
fn one_thread_and_two_write_the_same_journal_and_choose_the_same() {
    let (one, chosen_by_one) = tuned(&config(&[MOVING]), 1);
    let (two, chosen_by_two) = &*MOVED;
    assert!(one == *two, "the journals differ");
    assert_eq!(&chosen_by_one, chosen_by_two);
    assert_eq!(
        one.iter().filter(|&&byte| byte == b'\n').count(),
        1 + 3 + 3 + 2 + 2 + 2 + 2,
        "a header, three generations of each half, two of each again, of registration, of both"
    );
}

#[test]
fn the_fast_search_moves_each_half_then_each_again_then_registration_then_both() {
    let (_, tuned) = tuned(&config(&["tune.population=0", "seed=2"]), 2);
    let stages: Vec<&str> = tuned.generations.iter().map(|g| &*g.stage).collect();
    let turns = [
        ["lidar", "registration"].repeat(3),
        ["registration again", "lidar again"].repeat(2),
        ["registration last"; 2].into(),
        ["joint"; 2].into(),
    ];
    assert_eq!(stages, turns.concat());
    let moved = |generation: &Generation| -> Vec<bool> {
        let first = &generation.candidates[0].point;
        let differs = |i: usize| generation.candidates.iter().any(|c| c.point[i] != first[i]);
        (0..first.len()).map(differs).collect()
    };
    let sensor = LidarPreset::Usual.parameters(false).len();
    let both = sensor + 8;
    for generation in &tuned.generations {
        let (own, size) = match &*generation.stage {
            "joint" => (0..both, both),
            stage if stage.starts_with("lidar") => (0..sensor, sensor),
            _ => (sensor..both, 8),
        };
        assert_eq!(generation.candidates.len(), size, "{}", generation.stage);
        for (i, moved) in moved(generation).into_iter().enumerate() {
            assert_eq!(moved, own.contains(&i), "{}, axis {i}", generation.stage);
            assert_eq!(generation.deviations[i] > 0.0, moved);
        }
    }
}

#[test]
fn protocols_make_about_as_many_registrations_when_their_number_is_given() {
    for (more, stages) in [
        ("tune.protocol=joint", &OF_BOTH[..]),
        ("tune.protocol=lidar", &["lidar", "lidar again"]),
        ("tune.protocol=registration", &["registration", "registration again"]),
        ("tune.sampler=random", &["joint"]),
    ] {
        let config = config(&["tune.registrations=600", more]);
        let search = search(&config);
        let names: Vec<_> = search.stages().into_iter().map(|stage| stage.name).collect();
        assert_eq!(names, stages, "{more}");
        assert!(
            (540..=660).contains(&search.registrations()),
            "{more}: {}",
            search.registrations()
        );
    }
}

#[test]
fn a_steered_sensor_s_search_begins_at_the_best_aim_of_the_survey_or_at_the_start() {
    // At first the sensor looks up: most aims are better.
    let upwards = ["scanner.pattern=steered", "lidar.tilt=24", "lidar.elevation_span=40"];
    let small = ["tune.generations=1", "tune.protocol=lidar", "tune.objective=error"];
    let config = |survey| config(&[&upwards[..], &small, &[survey]].concat());
    let surveyed = config("tune.survey=6");
    let dataset = Dataset::build(&surveyed, &|_, _| ()).expect("a town");
    let sensors = Sensors::in_process(Model::from(&surveyed));
    let bench = Bench { dataset: &dataset, sensors: &sensors };
    let at = TuneSearch { bench, ..search(&surveyed) };
    let (_, tuned) = run(&at, &Silent);
    let aims: Vec<&Finalist> =
        tuned.finalists.iter().filter(|f| f.origin.starts_with("survey ")).collect();
    assert_eq!(aims.len(), 6);
    let start = at.space.values(&at.start);
    let moved = ["lidar.columns", "lidar.elevation_span", "lidar.rows", "lidar.tilt"];
    for aim in &aims {
        for (name, value) in &aim.values {
            let is_own = (value / start[name] - 1.0).abs() < 1e-9 || *value == start[name];
            assert!(is_own || moved.contains(&&**name), "{name}: {value}");
        }
    }
    for field in ["lidar.elevation_span", "lidar.rows", "lidar.tilt"] {
        let values: BTreeSet<u64> = aims.iter().map(|aim| aim.values[field].to_bits()).collect();
        assert_eq!(values.len(), 6, "{field}");
    }
    let narrowest = aims.iter().map(|aim| aim.values["lidar.elevation_span"]).fold(90.0, f64::min);
    assert!((30.0..40.0).contains(&narrowest), "{narrowest}");
    // None was eliminated: there are too few pairs.
    let best = aims.iter().min_by(|a, b| a.fitness.total_cmp(&b.fitness)).expect("aims");
    let mut parameters = at.start;
    assert!(best.values.iter().all(|(name, value)| parameters.set(name, *value)));
    assert_eq!(tuned.generations[0].mean, at.space.point(&parameters));
    let unsurveyed = config("tune.survey=0");
    let (_, plain) = run(&TuneSearch { config: &unsurveyed, ..at }, &Silent);
    assert_eq!(plain.generations[0].mean, search(&unsurveyed).space.start_point());
}

#[test]
fn an_aim_that_may_be_better_by_chance_is_not_where_the_search_begins() {
    // Of both seeds an aim has half the start's error, of one by two standard errors.
    let small = ["tune.generations=1", "tune.protocol=lidar", "tune.survey=6"];
    let aim = ["lidar.tilt=-18", "lidar.elevation_span=48", "lidar.rows=28", "lidar.columns=225"];
    let others = ["scanner.pattern=steered", "tune.objective=error", "data.train_pairs=8"];
    for (seed, begins_at_the_aim) in [("seed=15", false), ("seed=16", true)] {
        let config = config(&[&small[..], &aim, &others, &[seed]].concat());
        let dataset = Dataset::build(&config, &|_, _| ()).expect("a town");
        let sensors = Sensors::in_process(Model::from(&config));
        let bench = Bench { dataset: &dataset, sensors: &sensors };
        let at = TuneSearch { bench, ..search(&config) };
        let (_, tuned) = run(&at, &Silent);
        let fitness = |of: &str| {
            let own = tuned.finalists.iter().filter(|f| f.origin.starts_with(of));
            own.map(|f| f.fitness).fold(1.0, f64::min)
        };
        assert!(fitness("survey ") < 0.51 * fitness("start"), "{seed}");
        let begins_at_the_start = tuned.generations[0].mean == at.space.start_point();
        assert_eq!(begins_at_the_start, !begins_at_the_aim, "{seed}");
    }
}

#[test]
fn random_points_are_drawn_from_all_of_the_ranges_whatever_was_found_before() {
    let (_, tuned) = tuned(&config(&["tune.sampler=random", "tune.generations=5"]), 2);
    let points: Vec<&Vec<f64>> =
        tuned.generations.iter().flat_map(|g| &g.candidates).map(|c| &c.point).collect();
    assert_eq!(points.len(), 5 * 6);
    for axis in 0..points[0].len() {
        let values = || points.iter().map(|point| point[axis]);
        let mean = values().sum::<f64>() / 30.0;
        // Of thirty even draws: mean 0.5 ± 0.053, the extremes within 0.2 of the ends.
        assert!((0.25..0.75).contains(&mean), "axis {axis}: {mean}");
        assert!(values().fold(1.0, f64::min) < 0.2, "axis {axis}");
        assert!(values().fold(0.0, f64::max) > 0.8, "axis {axis}");
    }
    assert!(tuned.finalists.iter().all(|f| !f.origin.ends_with("mean")), "there is none");
}

#[test]
fn the_winners_of_both_halves_put_together_are_a_finalist() {
    // Here both halves find something better than the start.
    let (_, both) = tuned(&config(&["seed=61"]), 2);
    let combined = both.finalists.iter().find(|finalist| finalist.origin == "halves combined");
    let combined = combined.expect("both halves moved");
    assert_eq!(combined.pairs, 4, "all training pairs");
    // Each of its values is one of its half's finalists.
    for (section, stage) in [("lidar.", "lidar,"), ("registration.", "registration,")] {
        let own = |values: &Values| -> Vec<(String, f64)> {
            let own = values.iter().filter(|(name, _)| name.starts_with(section));
            own.map(|(name, value)| (name.clone(), *value)).collect()
        };
        let of_half = both.finalists.iter().filter(|f| f.origin.starts_with(stage));
        let found = of_half.filter(|f| own(&f.values) == own(&combined.values)).count();
        assert!(found > 0, "{section}: {:?}", own(&combined.values));
    }
}

#[test]
fn each_half_goes_on_from_the_other_s_winner() {
    // Here both halves find something better than the start.
    let config = config(&["seed=61"]);
    let (_, both) = tuned(&config, 2);
    let space = search(&config).space;
    let start = space.start_point();
    for (stage, moved) in
        [("registration again", space.lidar_axes()), ("lidar again", space.registration_axes())]
    {
        let first = both.generations.iter().find(|g| g.stage == stage).expect("the stage");
        let differs = |i: &usize| (first.mean[*i] - start[*i]).abs() > 1e-9;
        let found: Vec<usize> = (0..start.len()).filter(differs).collect();
        assert!(!found.is_empty() && found.iter().all(|i| moved.contains(i)), "{stage}: {found:?}");
    }
}

#[test]
fn the_paper_s_search_evaluates_all_pairs_and_takes_the_best_candidate() {
    let given = config(&["tune.strategy=paper"]).tune;
    assert_eq!((given.pairs_per_generation, given.generations), (2, 4), "given keys stay");
    let config = paper(&["tune.generations=2"]);
    assert_eq!((config.tune.error_cap, config.tune.error_mean), (0.0, ErrorMean::Arithmetic));
    let (_, tuned) = tuned(&config, 2);
    let seen: Vec<_> = tuned.generations.iter().flat_map(|g| &g.candidates).collect();
    assert_eq!(seen.len(), 2 * 16, "a population of the number of axes");
    assert!(seen.iter().all(|c| !c.values.contains_key("lidar.gain_slope")), "the paper's eight");
    for candidate in &seen {
        let errors: Vec<f64> = candidate.errors.iter().map(|e| e.frobenius).collect();
        assert_eq!(errors.len(), 4);
        assert_eq!(candidate.fitness, errors.iter().sum::<f64>() / 4.0);
    }
    let least = seen.iter().map(|c| c.fitness).fold(f64::INFINITY, f64::min);
    let best = seen.iter().find(|c| c.fitness == least).expect("a best");
    assert_eq!(search(&config).space.values(&tuned.parameters), best.values);
    assert_eq!((tuned.registrations, tuned.finalists.len()), (2 * 16 * 4, 1));
}

/// Counts registrations.
#[derive(Default)]
struct Count(AtomicUsize);

impl Observer for Count {
    fn evaluated(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn every_registration_is_counted_and_no_finalist_runs_twice_on_a_pair() {
    let config = config(&[MOVING]);
    let count = Count::default();
    let (_, tuned) = run(&search(&config), &count);
    assert_eq!(count.0.into_inner(), tuned.registrations);
    let raced: usize = tuned.finalists.iter().map(|f| f.pairs).sum();
    // Six candidates per generation, on all four pairs in registration's, else on two.
    let of_stages = 3 * (2 + 4) + 2 * (4 + 2) + 2 * 4 + 2 * 2;
    assert_eq!(tuned.registrations, 6 * of_stages + raced);
    let different: BTreeSet<String> =
        tuned.finalists.iter().map(|f| format!("{:?}", f.values)).collect();
    assert_eq!(different.len(), tuned.finalists.len());
}

#[test]
fn the_cost_of_scans_is_recorded_when_it_counts_and_decides_between_equal_errors() {
    let error = tuned(&config(&["tune.objective=error", "tune.generations=1"]), 2).1;
    assert!(error.generations.iter().flat_map(|g| &g.candidates).all(|c| c.cost.is_none()));
    // All errors are at the cap, so only energy differs.
    let energy = &CHEAPEST.1;
    let energy_j = |p: &Parameters| {
        f64::from(p.settings.power_uw) * f64::from(p.settings.pulse_width_ps) * 1e-18
    };
    let start = search(&config(&[])).start;
    for candidate in energy.generations.iter().flat_map(|g| &g.candidates) {
        let parameters = search(&config(&BY_ENERGY)).space.parameters(&candidate.point).0;
        let ratio = energy_j(&parameters) / energy_j(&start);
        assert!((candidate.fitness / (1e-7 * ratio) - 1.0).abs() < 1e-9, "{}", candidate.fitness);
    }
    assert!(energy_j(&energy.parameters) < 0.5 * energy_j(&start));
}

#[test]
fn each_part_is_searched_as_it_would_be_alone_and_its_winner_is_a_finalist() {
    // The way to the cube and back changes the last bits of a value.
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs();
    let whole = config(&[MOVING]);
    let (_, both) = &*MOVED;
    for stage in ["lidar", "registration"] {
        // Alone it has twice the generations.
        let protocol = format!("tune.protocol={stage}");
        let half = config(&[&protocol, "tune.generations=3", MOVING]);
        let (_, alone) = tuned(&half, 2);
        let of_half = both.generations.iter().filter(|generation| generation.stage == stage);
        let of_half: Vec<&Generation> = of_half.collect();
        assert_eq!(of_half.len(), alone.generations.len(), "{stage}");
        for (beside, alone) in of_half.into_iter().zip(&alone.generations) {
            assert_eq!(beside.pairs, alone.pairs, "{stage}");
            assert!(close(beside.sigma, alone.sigma), "{stage}");
            for (beside, alone) in beside.candidates.iter().zip(&alone.candidates) {
                assert_eq!(beside.settings, alone.settings, "{stage}");
                assert!(close(beside.fitness, alone.fitness), "{stage}");
            }
        }
        let winner = search(&whole).space.values(&alone.parameters);
        let is_winner = |values: &Values| values.iter().all(|(name, &v)| close(v, winner[name]));
        let found = both.finalists.iter().find(|finalist| is_winner(&finalist.values));
        let pairs = found.map(|finalist| finalist.pairs);
        assert_eq!(pairs, Some(whole.data.train_pairs), "{stage}: {winner:?}");
    }
}

/// Result of a search whose choice is checked on these pairs, and its number of registrations.
fn checked(config: &RunConfig, check: Vec<ScanPair>) -> (Tuned, usize) {
    let dataset = Dataset { check, ..TOWN.clone() };
    let bench = Bench { dataset: &dataset, sensors: &SENSORS };
    let count = Count::default();
    let (_, tuned) = run(&TuneSearch { bench, ..search(config) }, &count);
    (tuned, count.0.into_inner())
}

/// Keys that put all errors at the cap, so that energy alone decides: other sensor settings are
/// always ahead.
const BY_ENERGY: [&str; 5] = [
    "tune.error_cap=1e-7",
    "tune.error_mean=arithmetic",
    "tune.weights.energy=1",
    "data.success_translation_m=100",
    "data.success_rotation_deg=180",
];

#[test]
fn a_joint_choice_stands_when_it_is_ahead_on_held_back_pairs() {
    let config = config(&BY_ENERGY);
    let (_, unchecked) = &*CHEAPEST;
    assert_eq!(unchecked.check, None);
    let (found, made) = checked(&config, TOWN.test.clone());
    assert_eq!((found.parameters, &found.origin), (unchecked.parameters, &unchecked.origin));
    assert_eq!(found.finalists, unchecked.finalists, "the final selection is the same");
    let check = found.check.expect("a check");
    assert!(check.holds && check.ahead == 99.0 && check.pairs == 3, "{check:?}");
    assert!(found.registrations >= unchecked.registrations + 2 * 3, "two on three pairs at least");
    assert_eq!(found.registrations, made);
}

#[test]
fn a_choice_that_is_not_ahead_on_held_back_pairs_yields_to_the_start() {
    let config = config(&["tune.objective=error", MOVING]);
    let winner = tuned(&config, 2).1;
    assert_ne!(winner.parameters.settings, search(&config).start.settings, "else nothing to check");
    // Without returns, both have the error of the initial guess.
    let beams = TOWN.beams.pattern().beams();
    let nothing = Response::Fixed(Arc::new(SceneResponse::empty(beams)));
    let mut blind = TOWN.test.clone();
    blind.iter_mut().for_each(|p| (p.first, p.second) = (nothing.clone(), nothing.clone()));
    let (found, made) = checked(&config, blind);
    let check = found.check.as_ref().expect("a check");
    assert!(!check.holds && check.ahead == 0.0 && check.pairs == 3, "{check:?}");
    assert_eq!((&*check.of, &*found.origin), ("start", "start"));
    assert_eq!(found.parameters, search(&config).start);
    // The start, registration's half and the choice, on three pairs each; the sensor's, too, where
    // that is another.
    assert!(found.registrations >= winner.registrations + 3 * 3);
    assert_eq!(found.registrations, made);
}

#[test]
fn a_half_alone_is_checked_against_the_start() {
    let own = [&BY_ENERGY[..], &["tune.protocol=lidar"]].concat();
    let (found, _) = checked(&config(&own), TOWN.test.clone());
    let check = found.check.expect("a check");
    assert!(check.holds && check.of == "start" && check.pairs == 3, "{check:?}");
}

#[test]
fn a_choice_is_checked_against_every_warm_start() {
    let own = [&BY_ENERGY[..], &["tune.protocol=lidar"]].concat();
    let config = config(&own);
    let dataset = Dataset { check: TOWN.test.clone(), ..TOWN.clone() };
    let with = |powers: &[f64]| {
        let bench = Bench { dataset: &dataset, sensors: &SENSORS };
        let mut search = TuneSearch { bench, ..search(&config) };
        for &power in powers {
            let mut warm = search.start;
            assert!(warm.set("lidar.power", power));
            search.warm_starts.push(warm);
        }
        run(&search, &Silent).1
    };
    // The search begins at what has less light; nothing follows from the other.
    let (one, two) = (with(&[20.0]), with(&[20.0, 40.0]));
    assert_eq!(one.parameters, two.parameters);
    let more = dataset.train.len() + dataset.check.len();
    assert_eq!(two.registrations, one.registrations + more);
}

#[test]
fn a_choice_that_loses_a_held_back_pair_does_not_stand_however_cheap_it_is() {
    // Errors above the cap count the same, and here a success is bounded: the choice, which has
    // little light, loses none of the training pairs and one of the others.
    let config = config(&[&BY_ENERGY[..3], &["seed=5"]].concat());
    let (found, _) = checked(&config, TOWN.test.clone());
    let check = found.check.as_ref().expect("a check");
    assert!(!check.holds && check.ahead > 1.0, "{check:?}");
    assert_eq!(found.origin, check.of);
}

#[test]
fn minimising_a_cost_makes_no_check() {
    let config = config(&["tune.minimise=energy", "tune.generations=1"]);
    assert_eq!(checked(&config, TOWN.test.clone()).0.check, None);
}

#[test]
fn when_registration_keeps_its_start_the_sensor_goes_on_from_its_own_winner() {
    let config = config(&BY_ENERGY);
    let (journal, found) = &*CHEAPEST;
    let search = search(&config);
    let start = search.space.start_point();
    for stage in ["registration again", "lidar again"] {
        let first = found.generations.iter().find(|g| g.stage == stage).expect("the stage");
        let moved = first.mean.iter().zip(&start).enumerate();
        let moved: Vec<usize> =
            moved.filter(|(_, (a, b))| (*a - *b).abs() > 1e-9).map(|(i, _)| i).collect();
        let sensor = search.space.lidar_axes();
        assert!(!moved.is_empty() && moved.iter().all(|i| sensor.contains(i)), "{moved:?}");
    }
    // Its journal can be resumed.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("history.jsonl");
    std::fs::write(&path, journal).expect("a journal");
    let (mut journal, done) = Journal::resume(&path, &search.header(), false).expect("a journal");
    let again = search.run(&mut journal, done, &Silent).expect("a search");
    assert_eq!(&again, found);
}

#[test]
fn two_candidates_of_each_stage_s_later_generations_are_finalists() {
    let (_, tuned) = tuned(&config(&["tune.generations=6", MOVING]), 2);
    for stage in OF_BOTH {
        let own = tuned.generations.iter().filter(|generation| generation.stage == stage);
        let own: Vec<u32> = own.map(|generation| generation.generation).collect();
        let late = &own[own.len() / 2..];
        let mut raced = Vec::new();
        for finalist in &tuned.finalists {
            match Origin::read(&finalist.origin) {
                Some(Origin::Candidate { stage: of, generation, .. }) if of == stage => {
                    raced.push(generation);
                }
                _ => {}
            }
        }
        assert!(raced.iter().all(|generation| late.contains(generation)), "{stage}: {raced:?}");
        assert_eq!(raced.len(), late.len().min(2), "{stage}: {raced:?} of {own:?}");
    }
}

#[test]
fn viewpoints_are_numbered_training_pairs_first() {
    let pairs = TOWN.train.iter().chain(&TOWN.test);
    let numbers: Vec<u32> = pairs.flat_map(|pair| pair.viewpoints).collect();
    assert_eq!(numbers, (1..=14).collect::<Vec<_>>());
    assert_eq!(TOWN.test[0].viewpoints, [2 * 4 + 1, 2 * 4 + 2]);
    for (number, scene) in numbers.iter().zip(TOWN.views()) {
        let pair = TOWN
            .train
            .iter()
            .chain(&TOWN.test)
            .find(|pair| pair.viewpoints.contains(number))
            .expect("a pair");
        let response = if number % 2 == 1 { &pair.first } else { &pair.second };
        assert!(Arc::ptr_eq(&scene, &response.to(&TOWN.beams)));
    }
}

#[test]
fn one_sensor_for_all_threads_gives_the_errors_of_one_for_each() {
    let config = config(&[]);
    let model = Model::from(&config);
    let one = Sensors::opened_by("one", 1, move || {
        Sensor::in_process(&model).map_err(SensorError::client("one"))
    });
    let of = |sensors: &Sensors| {
        let bench = Bench { dataset: &TOWN, sensors };
        let start = search(&config).start;
        evaluate(&bench, &start, &shortlist_pairs(&config), &|| ()).expect("errors")
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("threads");
    pool.install(|| assert_eq!(of(&one), of(&SENSORS)));
}

#[test]
fn another_seed_gives_another_search() {
    let (one, _) = tuned(&config(&["tune.generations=1"]), 2);
    let (other, _) = tuned(&config(&["tune.generations=1", "seed=2"]), 2);
    assert!(one != other);
}

#[test]
fn every_candidate_is_recorded_with_the_sensor_s_hash_of_its_settings() {
    let config = config(&["tune.generations=3", "tune.objective=error"]);
    let (_, tuned) = tuned(&config, 2);
    let search = search(&config);
    let mut sensor = Sensor::in_process(&Model::from(&config)).expect("a sensor");
    let candidates: Vec<_> = tuned.generations.iter().flat_map(|g| &g.candidates).collect();
    assert_eq!(candidates.len(), 6 * tuned.generations.len());
    assert!(tuned.generations.len() > 2 + 2, "both halves, then both");
    for candidate in &candidates {
        let mut by_name = search.start;
        for (name, value) in &candidate.values {
            assert!(by_name.set(name, *value), "{name}");
        }
        assert_eq!(by_name, search.space.parameters(&candidate.point).0);
        assert_eq!(candidate.settings, settings_hash(&by_name.settings));
        assert_eq!(sensor.configure(&by_name.settings).expect("accepted"), candidate.settings);
        assert_eq!(sensor.client.read_settings().expect("settings"), by_name.settings);
        assert_eq!(candidate.fitness, Worth::from(&config.tune).of(&candidate.errors));
    }
    let different: BTreeSet<u32> = candidates.iter().map(|c| c.settings).collect();
    assert!(different.len() > candidates.len() / 3, "the search varies the sensor");
}

#[test]
fn every_recorded_error_is_that_of_a_training_pair_with_the_noise_of_the_recipe() {
    for (common, own) in [("tune.common_noise=true", 0), ("tune.common_noise=false", 1)] {
        let config = config(&[common, "tune.generations=3"]);
        let (_, tuned) = tuned(&config, 2);
        let search = search(&config);
        // Each half draws as it would alone, in turns; the others go on after both.
        let again = ["registration again", "lidar again"].map(|stage| (stage, 2));
        let mut turns = BTreeMap::from(again);
        turns.extend([("registration last", 3), ("joint", 4)]);
        for generation in &tuned.generations {
            let turn = turns.entry(&*generation.stage).or_insert(0);
            let g = *turn;
            *turn += 1;
            let is_shared = generation.stage.starts_with("registration");
            assert_eq!(generation.pairs.len(), if is_shared { 4 } else { 2 });
            for (number, candidate) in (1..).zip(&generation.candidates) {
                let parameters = search.space.parameters(&candidate.point).0;
                let again = generation.pairs.iter().map(|&pair| {
                    error_in_the_search(&search, &parameters, (g, pair, own * number))
                });
                assert_eq!(candidate.errors, again.collect::<Vec<_>>(), "{common}");
            }
        }
    }
}

#[test]
fn a_pair_s_error_counts_at_most_the_cap() {
    let worth = |cap: &str| {
        let plain = ["tune.generations=1", "tune.error_mean=arithmetic", "tune.objective=error"];
        let (_, tuned) = tuned(&config(&[&plain[..], &[cap]].concat()), 2);
        let searched: Vec<f64> =
            tuned.generations[0].candidates.iter().map(|c| c.fitness).collect();
        (searched, tuned.finalists.iter().map(|f| f.fitness).collect::<Vec<f64>>())
    };
    // No registration is as good as a ten-thousandth of a millimetre: all errors are at the cap.
    let (searched, chosen) = worth("tune.error_cap=1e-7");
    assert!(searched.iter().chain(&chosen).all(|&worth| worth == 1e-7), "{searched:?} {chosen:?}");
    let (searched, chosen) = worth("tune.error_cap=0");
    assert!(searched.iter().chain(&chosen).all(|&worth| worth > 1e-4), "{searched:?} {chosen:?}");
}

#[test]
fn parameters_are_judged_on_test_pairs_with_noise_of_their_own() {
    let config = config(&[]);
    let search = search(&config);
    let judged = search.judge(&search.start, &Silent).expect("a judgement").errors;
    assert_eq!(judged.len(), 3);
    for (pair, error) in TOWN.test.iter().zip(&judged) {
        let noise = echoloop_random::derive(config.seed, 5, error.pair as u64);
        let again = search.bench.register(&search.start, error.pair, pair, noise);
        assert_eq!(*error, again.expect("a registration").error);
    }
}

/// Position of the sensor for every scan of some pairs, x and y, m.
fn places(pairs: &[ScanPair]) -> Vec<Vector2<f64>> {
    let both = pairs.iter().flat_map(|pair| pair.world_from_sensor);
    both.map(|pose| pose.translation.vector.xy()).collect()
}

#[test]
fn test_viewpoints_are_at_least_ten_metres_from_training_viewpoints() {
    for scene in ["structured", "semi-structured", "unstructured"] {
        let scene = format!("scene.source=\"{scene}\"");
        let config =
            config(&[&scene, "scene.towns=[1,2]", "data.train_pairs=8", "data.test_pairs=20"]);
        let data = Dataset::build(&config, &|_, _| ()).expect("two towns");
        assert_eq!((data.train.len(), data.test.len()), (8, 20));
        let towns: BTreeSet<&str> = data.train.iter().map(|pair| &*pair.place).collect();
        assert_eq!(towns.len(), 2);
        for town in towns {
            let of = |pairs: &[ScanPair]| -> Vec<ScanPair> {
                pairs.iter().filter(|pair| pair.place == town).cloned().collect()
            };
            let [train, test] = [&data.train, &data.test].map(|pairs| places(&of(pairs)));
            assert_eq!((train.len(), test.len()), (8, 20));
            let apart = |a: &Vector2<f64>| test.iter().map(|b| (a - b).norm()).fold(1e9, f64::min);
            let nearest_m = train.iter().map(apart).fold(1e9, f64::min);
            assert!(nearest_m >= 10.0, "{town}: {nearest_m} m");
        }
    }
}

#[test]
fn the_choice_is_at_least_as_good_as_the_start_on_the_training_pairs() {
    // Here no finalist is beyond the limit of lost pairs and plain mean, so fitness orders them.
    for seed in ["seed=2", "seed=8"] {
        let config = config(&[seed, "tune.objective=error"]);
        let (_, tuned) = tuned(&config, 2);
        let search = search(&config);
        let worth = |parameters: &Parameters| {
            let errors = evaluate(&search.bench, parameters, &shortlist_pairs(&config), &|| ());
            Worth::from(&config.tune).of(&errors.expect("errors"))
        };
        let (start, chosen) = (worth(&search.start), worth(&tuned.parameters));
        assert!(chosen <= start, "{seed}: {chosen} after {start}");
        let is_chosen = |finalist: &Finalist| finalist.origin == tuned.origin;
        assert_eq!(tuned.finalists.iter().find(|f| is_chosen(f)).map(|f| f.fitness), Some(chosen));
        let of_start =
            tuned.finalists.iter().find(|f| f.origin == "start").expect("the start is a finalist");
        assert_eq!(of_start.fitness, start);
        assert!(tuned.finalists.is_sorted_by(|a, b| a.fitness <= b.fitness || a.pairs > b.pairs));
    }
}

#[test]
fn the_default_protocol_searches_nothing() {
    let config = config(&["tune.protocol=default"]);
    let (journal, tuned) = tuned(&config, 2);
    assert_eq!(journal.iter().filter(|&&byte| byte == b'\n').count(), 1, "only a header");
    assert_eq!(tuned.parameters, search(&config).start);
    assert!(tuned.generations.is_empty() && tuned.finalists.is_empty());
}

#[test]
fn each_protocol_changes_its_own_axes_and_no_others() {
    let device = config(&[]).device();
    let start = Parameters::start(&config(&[]), &device).expect("a start");
    let lidar: BTreeSet<String> =
        PAPER_LIDAR.iter().map(|id| format!("lidar.{}", id.parameter().name)).collect();
    let registration: BTreeSet<String> = start
        .values(Preset::Outdoor)
        .into_keys()
        .filter(|name| name.starts_with("registration."))
        .collect();
    let table = [
        (Protocol::Default, BTreeSet::new()),
        (Protocol::Lidar, lidar.clone()),
        (Protocol::Registration, registration.clone()),
        (Protocol::Joint, &lidar | &registration),
    ];
    for (protocol, own) in table {
        let space = Space::new(protocol, LidarPreset::Paper, Preset::Outdoor, start, device);
        assert_eq!(
            space.axes().iter().map(|axis| axis.name.to_owned()).collect::<BTreeSet<_>>(),
            own
        );
        let mut changed = BTreeSet::new();
        for corner in [0.0, 0.25, 0.75, 1.0] {
            let (parameters, _) = space.parameters(&vec![corner; space.axes().len()]);
            parameters.settings.check(&HARDWARE).expect("every constraint holds");
            let both =
                parameters.values(Preset::Outdoor).into_iter().zip(start.values(Preset::Outdoor));
            changed
                .extend(both.filter(|(after, before)| after != before).map(|((name, _), _)| name));
        }
        assert_eq!(changed, own, "{}", protocol.name());
    }
}

/// Targets of known range and echo height, one a beam, for a sensor in process.
struct Targets {
    pattern: ScanPattern,
    receiver: Receiver,
    response: Arc<SceneResponse>,
    ranges_m: Vec<f64>,
}

const COLUMNS: u16 = 32;
const ROWS: u16 = 16;

impl Targets {
    /// The echo of beam i has `height(i / beams)` of full scale at the default power and gain.
    fn new(height: impl Fn(f64) -> f64) -> Self {
        let pattern = ScanPattern::Grid(Grid { columns: COLUMNS, rows: ROWS, ..Grid::default() });
        let receiver = Receiver::default();
        let beams = pattern.beams();
        // 17 mm apart, so that every sub-sample phase occurs.
        let ranges_m: Vec<f64> = (0..beams).map(|i| 20.0 + 0.017 * f64::from(i)).collect();
        let power_w = f64::from(Settings::default().power_uw) / 1e6;
        let returns = ranges_m.iter().zip(0..).map(|(&range_m, i)| {
            let full_scale =
                receiver.peak_current_ua(power_w, range_m, 1.0) / receiver.full_scale_ua;
            let strength = height(f64::from(i) / f64::from(beams)) / full_scale;
            Return { range_m: range_m as f32, strength_per_m2: strength as f32 }
        });
        let response = SceneResponse {
            beams: (0..=beams).collect(),
            returns: returns.collect(),
            ..SceneResponse::default()
        };
        Self { pattern, receiver, response: Arc::new(response), ranges_m }
    }

    fn sensor(&self) -> Sensor {
        sensor(&self.receiver, self.pattern)
    }

    fn view(&self) -> View<'_> {
        View { scene: &self.response, noise_seed: 5, scan: 1, viewpoint: 1 }
    }

    fn scan(&self, settings: &Settings) -> Vec<Echoes> {
        let mut sensor = self.sensor();
        sensor.configure(settings).expect("accepted settings");
        sensor.scan(&self.view()).expect("a scan")
    }

    /// Range errors of the echoes within a metre of their target, m.
    fn errors_m(&self, scan: &[Echoes]) -> Vec<f64> {
        let pairs =
            scan.iter().zip(&self.ranges_m).flat_map(|(echoes, range)| echoes.iter().zip([range]));
        pairs
            .map(|(echo, range)| echo.range_m() - range)
            .filter(|error| error.abs() < 1.0)
            .collect()
    }
}

fn model(receiver: &Receiver, pattern: ScanPattern) -> Model {
    Model { receiver: receiver.clone(), pattern, hardware: HARDWARE, detector: Detector::Firmware }
}

fn sensor(receiver: &Receiver, pattern: ScanPattern) -> Sensor {
    Sensor::in_process(&model(receiver, pattern)).expect("a sensor")
}

fn count(scan: &[Echoes]) -> usize {
    scan.iter().map(|echoes| echoes.len()).sum()
}

fn mean(scan: &[Echoes], what: impl Fn(&Echo) -> f64) -> f64 {
    scan.iter().flatten().map(what).sum::<f64>() / count(scan) as f64
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

fn amplitude(scan: &[Echoes]) -> f64 {
    mean(scan, |echo| echo.amplitude_fraction().to_num())
}

#[test]
fn twice_the_power_or_six_decibels_double_every_amplitude() {
    let targets = Targets::new(|_| 0.2);
    let half = Settings { power_uw: 37_500_000, ..Settings::default() };
    let louder = Settings { gain_cdb: 602, ..half };
    let [half, full, louder] =
        [half, Settings::default(), louder].map(|s| amplitude(&targets.scan(&s)));
    assert!((half - 0.1).abs() < 0.002, "{half}");
    assert!((full / half - 2.0).abs() < 0.03, "power: {full} after {half}");
    assert!((louder / half - 2.0).abs() < 0.03, "gain: {louder} after {half}");
}

#[test]
fn a_pulse_twice_as_wide_makes_echoes_twice_as_wide() {
    let targets = Targets::new(|_| 0.4);
    let width = |pulse_width_ps| {
        let settings = Settings { power_uw: 40_000_000, pulse_width_ps, ..Settings::default() };
        mean(&targets.scan(&settings), |echo| echo.width_ns().to_num())
    };
    let (narrow, wide) = (width(5_000), width(10_000));
    assert!((wide / narrow - 2.0).abs() < 0.1, "{wide} ns after {narrow} ns");
}

#[test]
fn a_higher_noise_floor_or_snr_threshold_lets_fewer_echoes_pass() {
    let targets = Targets::new(|share| 0.2 * share);
    let beams = targets.ranges_m.len() as f64;
    let low = Settings { noise_floor_ppm: 20_000, ..Settings::default() };
    let high = Settings { noise_floor_ppm: 100_000, ..low };
    let [low, high] = [low, high].map(|s| count(&targets.scan(&s)) as f64 / beams);
    // The noise of the amplitude, which is compared with the floor, is below 1 % of full scale.
    assert!(
        (low - 0.9).abs() < 0.05 && (high - 0.5).abs() < 0.05,
        "{low} and {high} of all echoes"
    );

    let targets = Targets::new(|share| 0.02 * share);
    let bold = Settings { noise_floor_ppm: 100, snr_threshold_milli: 4_000, ..Settings::default() };
    let shy = Settings { snr_threshold_milli: 8_000, ..bold };
    let [bold, shy] = [bold, shy].map(|s| targets.scan(&s));
    assert!(count(&shy) + 20 < count(&bold), "{} after {}", count(&shy), count(&bold));
    assert!(shy.iter().flatten().all(|echo| echo.snr_ratio().to_num::<f64>() > 7.9));
}

#[test]
fn a_lower_saturation_level_flags_whole_echoes_as_saturated() {
    let targets = Targets::new(|_| 0.5);
    let saturated = |saturation_ppm| {
        let scan = targets.scan(&Settings { saturation_ppm, ..Settings::default() });
        mean(&scan, |echo| f64::from(u8::from(echo.flags.contains(Flags::SATURATED))))
    };
    assert_eq!((saturated(1_000_000), saturated(300_000)), (0.0, 1.0));
}

#[test]
fn more_bins_improve_the_range_and_upsampling_does_not_worsen_it() {
    let targets = Targets::new(|_| 0.02);
    let half_gs = Settings { bins: 397, ..Settings::default() };
    let error = |settings: &Settings| {
        let errors = targets.errors_m(&targets.scan(settings));
        assert!(errors.len() * 10 > targets.ranges_m.len() * 9, "{} echoes", errors.len());
        rms(&errors)
    };
    let (plain, upsampled) = (error(&half_gs), error(&Settings { upsampling: 8, ..half_gs }));
    let finer = error(&Settings { bins: 1_588, ..Settings::default() });
    println!("weak echoes, 0.5 GS/s: {plain:.4} m, by 8: {upsampled:.4} m; 2 GS/s: {finer:.4} m");
    assert!(upsampled <= 1.02 * plain, "{upsampled} m after {plain} m");
    assert!(finer < plain, "{finer} m after {plain} m");
}

/// A front end without light that records its settings.
#[derive(Default)]
struct Spy(Vec<(Analog, usize)>);

impl FrontEnd for Spy {
    fn adc_bits(&self) -> u32 {
        12
    }

    fn capture(&mut self, analog: &Analog, _: Trigger, codes: &mut [u16]) {
        self.0.push((*analog, codes.len()));
        codes.fill(100);
    }
}

#[test]
fn committed_power_width_gain_and_clock_reach_the_front_end() {
    let pattern = ScanPattern::Grid(Grid { columns: 1, rows: 1, ..Grid::default() });
    let sensor = PcSensor::new(Spy::default(), pattern, HARDWARE);
    let mut client = Client::connect(InProcess(sensor), RetryPolicy::default()).expect("a sensor");
    let mut seen = |settings: Option<Settings>| {
        let refused = settings.map(|s| client.configure(&s).is_err());
        client.scan(1).expect("a scan");
        let (analog, samples) = client.transport_mut().0.front_end_mut().0.pop().expect("a shot");
        (refused, analog, samples)
    };
    let asked = Settings {
        power_uw: 20_000_000,
        pulse_width_ps: 8_000,
        gain_cdb: -550,
        bins: 1_000,
        ..Settings::default()
    };
    let period_ns = f64::from(sample_period_fs(1_000, &HARDWARE)) / 1e6;
    let (_, before, samples) = seen(None);
    assert_eq!(
        (before.power_w, before.pulse_width_ns, before.gain_db, samples),
        (75.0, 5.0, 0.0, 800)
    );
    let (refused, analog, samples) = seen(Some(asked));
    assert_eq!((refused, samples), (Some(false), 1_000));
    assert_eq!((analog.power_w, analog.pulse_width_ns, analog.gain_db), (20.0, 8.0, -5.5));
    assert_eq!(analog.sample_period_ns, period_ns);
    let too_strong = Settings { power_uw: 100_000_000, pulse_width_ps: 20_000, ..asked };
    assert_eq!(seen(Some(too_strong)), (Some(true), analog, samples), "a refusal changes nothing");
}

/// Value of a parameter other than its default, valid with the other defaults.
fn other(id: ParameterId) -> f64 {
    match id {
        ParameterId::Power => 50.0,
        ParameterId::Gain => 6.0,
        ParameterId::NoiseFloor => 0.02,
        ParameterId::SnrThreshold => 6.0,
        ParameterId::Saturation => 0.5,
        ParameterId::PulseWidth => 4.0,
        ParameterId::WaveformResolution => 1600.0,
        _ => 4.0,
    }
}

#[test]
fn parameters_of_the_dsp_do_not_reach_the_front_end() {
    let pattern = ScanPattern::Grid(Grid { columns: 1, rows: 1, ..Grid::default() });
    let sensor = PcSensor::new(Spy::default(), pattern, HARDWARE);
    let mut client = Client::connect(InProcess(sensor), RetryPolicy::default()).expect("a sensor");
    let mut seen = |settings: &Settings| {
        client.configure(settings).expect("accepted");
        client.scan(1).expect("a scan");
        client.transport_mut().0.front_end_mut().0.pop().expect("a shot")
    };
    let usual = seen(&Settings::default());
    for id in PAPER_LIDAR {
        let mut settings = Settings::default();
        settings.set(id, Some(id.parameter().to_code(other(id))));
        let is_analog = id.parameter().acts_in.contains("front end")
            || id.parameter().acts_in.contains("clock");
        assert_eq!(seen(&settings) != usual, is_analog, "{id}");
    }
}

#[test]
fn a_refused_setting_changes_no_echo() {
    let targets = Targets::new(|_| 0.3);
    let mut sensor = targets.sensor();
    sensor.configure(&Settings { gain_cdb: 300, ..Settings::default() }).expect("accepted");
    let before = sensor.scan(&targets.view()).expect("a scan");
    let bad = Settings { upsampling: 3, ..Settings::default() };
    let error = sensor.configure(&bad).expect_err("three is no power of two");
    assert!(
        matches!(error, ClientError::Refused(_)) && error.to_string().contains("upsampling 3"),
        "{error}"
    );
    assert_eq!(sensor.scan(&targets.view()).expect("a scan"), before);
}

/// A scene of rectangles, each given by three corners, with one material of this reflectance.
fn rectangles(corners: &[[[f32; 3]; 3]], reflectance_905nm: f32) -> Place {
    let mut mesh = Mesh::default();
    for &[a, b, c] in corners {
        let first = mesh.vertices.len() as u32;
        let d = std::array::from_fn(|i| a[i] + c[i] - b[i]);
        mesh.vertices.extend([a, b, c, d]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.materials.extend([0, 0]);
    }
    let material = Material { name: "test", reflectance_905nm, specular_f0: 0.0, roughness: 1.0 };
    let area = ([-30.0; 2], [30.0; 2]);
    let scene = Scene { materials: vec![material], ..Scene::new("test", mesh, area) };
    let caster = Raycaster::new(&scene);
    Place { scene, caster, later: None }
}

#[test]
fn a_scan_of_a_wall_is_unbiased_at_every_albedo() {
    const WALL_M: f64 = 18.0;
    let pattern = ScanPattern::Grid(Grid {
        columns: 48,
        rows: 16,
        azimuth_cdeg: 5_000,
        elevation_cdeg: 2_000,
    });
    let config = config(&[]);
    let beams = Beams::new(pattern);
    let directions = beams.directions(1);
    let x = WALL_M as f32;
    println!("albedo    yaw     bias      rms   points");
    for albedo in [0.05, 0.1, 0.3, 0.6, 0.9] {
        let place =
            Arc::new(rectangles(&[[[x, -60.0, -20.0], [x, 60.0, -20.0], [x, 60.0, 20.0]]], albedo));
        for yaw_deg in [0.0_f64, 25.0] {
            let pose = Pose::new(Vector3::zeros(), Vector3::new(0.0, 0.0, yaw_deg.to_radians()));
            let response = Arc::new(respond_at(&config, &place, &pose, 1, &beams));
            let mut sensor = sensor(&config.receiver, pattern);
            sensor.configure(&Settings::default()).expect("accepted");
            let view = View { scene: &response, noise_seed: 3, scan: 1, viewpoint: 1 };
            let cloud = cloud_from_scan(&sensor.scan(&view).expect("a scan"), &directions);
            let off: Vec<f64> =
                cloud.points.iter().map(|p| (pose * p.cast::<f64>()).x - WALL_M).collect();
            let (bias, rms) = (off.iter().sum::<f64>() / off.len() as f64, rms(&off));
            println!(
                "{albedo:>6} {yaw_deg:>5}° {:>6.1} mm {:>5.1} mm {:>7}",
                1e3 * bias,
                1e3 * rms,
                off.len()
            );
            assert!(
                off.len() * 100 >= directions.len() * 99,
                "albedo {albedo}, {yaw_deg}°: {} points",
                off.len()
            );
            assert!(
                bias.abs() < 5e-3 && rms < 0.03,
                "albedo {albedo}, {yaw_deg}°: bias {bias} m, rms {rms} m"
            );
            assert!(off.iter().all(|d| d.abs() < 0.15), "albedo {albedo}, {yaw_deg}°");
        }
    }
}

/// The five visible sides of a box on the ground.
fn block([x, y]: [f32; 2], [dx, dy, dz]: [f32; 3]) -> [[[f32; 3]; 3]; 5] {
    let (u, v) = (x + dx, y + dy);
    [
        [[x, y, 0.0], [u, y, 0.0], [u, y, dz]],
        [[x, v, 0.0], [u, v, 0.0], [u, v, dz]],
        [[x, y, 0.0], [x, v, 0.0], [x, v, dz]],
        [[u, y, 0.0], [u, v, 0.0], [u, v, dz]],
        [[x, y, dz], [u, y, dz], [u, v, dz]],
    ]
}

#[test]
fn registration_finds_the_motion_between_two_scans_of_a_yard() {
    let ground = [[-40.0, -40.0, 0.0], [40.0, -40.0, 0.0], [40.0, 40.0, 0.0]];
    let blocks = [
        block([-20.0, 14.0], [44.0, 8.0, 9.0]),
        block([22.0, -18.0], [6.0, 30.0, 7.0]),
        block([8.0, -9.0], [4.0, 3.0, 2.5]),
        block([12.0, 5.0], [2.0, 5.0, 3.5]),
        block([-6.0, -20.0], [20.0, 5.0, 6.0]),
    ];
    let mut sides = vec![ground];
    sides.extend(blocks.iter().flatten());
    let place = Arc::new(rectangles(&sides, 0.3));
    let pattern = ScanPattern::Grid(Grid {
        columns: 128,
        rows: 64,
        azimuth_cdeg: 18_000,
        elevation_cdeg: 6_000,
    });
    let beams = Beams::new(pattern);
    let config = config(&[]);
    let start = Parameters::start(&config, &config.device()).expect("a start");
    let pose = |v: [f64; 3], turn_deg: [f64; 3]| {
        Pose::new(Vector3::from(v), Vector3::from(turn_deg.map(f64::to_radians)))
    };
    let first = pose([0.0, 0.0, 2.0], [0.5, -0.5, 10.0]);
    let look =
        |pose: &Pose| Response::Fixed(Arc::new(respond_at(&config, &place, pose, 1, &beams)));
    let (train, test, check) = (Vec::new(), Vec::new(), Vec::new());
    let dataset = Dataset { beams: beams.clone(), train, test, check, triangles: 0 };
    let sensors = Sensors::in_process(model(&config.receiver, pattern));
    let bench = Bench { dataset: &dataset, sensors: &sensors };
    for (shift, turn) in
        [([0.3, -0.2, 0.05], [0.0, 0.5, 13.0]), ([0.0, 0.5, -0.05], [0.0, 0.0, 7.0])]
    {
        let second = pose([shift[0], shift[1], 2.0 + shift[2]], turn);
        let truth = relative(&first, &second);
        let pair = ScanPair {
            place: "yard".into(),
            truth,
            world_from_sensor: [first, second],
            first: look(&first),
            second: look(&second),
            viewpoints: [1, 2],
            overlap: 1.0,
        };
        let back = ScanPair {
            place: "yard".into(),
            truth: truth.inverse(),
            world_from_sensor: [second, first],
            first: pair.second.clone(),
            second: pair.first.clone(),
            viewpoints: [2, 1],
            overlap: 1.0,
        };
        for pair in [pair, back] {
            let error = bench.register(&start, 0, &pair, 9).expect("a registration").error;
            println!(
                "{:.1} mm, {:.3}°, {}",
                1e3 * error.translation_m,
                error.rotation_deg,
                error.stop
            );
            assert!(error.translation_m < 0.05 && error.rotation_deg < 0.3, "{error:?}");
            assert_eq!(error.stop, "Still");
        }
    }
}
