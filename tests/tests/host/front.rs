//! The search for a front of error against energy, on a small problem.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{LazyLock, Mutex};

use echoloop_closed_loop::config::preset::LidarPreset;
use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::dataset::Dataset;
use echoloop_closed_loop::evaluation::objective::Bench;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, FrontPoint, FrontSearch};
use echoloop_closed_loop::parameters::{Parameters, Space};
use echoloop_closed_loop::run_folder::journal::{CandidateRecord, Generation, Journal};
use echoloop_closed_loop::search::{Observer, Silent, TuneError, TuneSearch};
use echoloop_sensors::sensor::{Model, Sensors};

const GENERATIONS: usize = 3;

/// Power of a choice.
const POWER_UW: i32 = 20_000_000;

static CONFIG: LazyLock<RunConfig> = LazyLock::new(|| {
    let small = [
        "scene.towns=[1]",
        "scanner.pattern=grid",
        "scanner.columns=48",
        "scanner.rows=16",
        "data.train_pairs=3",
        "data.test_pairs=3",
        "data.baseline_m=0.5",
        "front.cost=energy",
        "front.points=5",
        "front.population=8",
        "front.generations=3",
        "front.pairs=2",
    ];
    let overrides = small.map(|text| text.parse().expect("an override"));
    load(None, &overrides).expect("a configuration")
});
static TOWN: LazyLock<Dataset> =
    LazyLock::new(|| Dataset::build(&CONFIG, &|_, _| ()).expect("a town"));
static SENSORS: LazyLock<Sensors> = LazyLock::new(|| Sensors::in_process(Model::from(&*CONFIG)));

fn search(stop: &AtomicBool) -> TuneSearch<'_> {
    let (config, device) = (&*CONFIG, CONFIG.device());
    let start = Parameters::start(config, &device).expect("a start");
    let (tune, preset) = (&config.tune, config.registration.preset);
    let space = Space::new(tune.protocol, tune.lidar, preset, start, device);
    TuneSearch {
        config,
        bench: Bench { dataset: &TOWN, sensors: &SENSORS },
        space,
        start,
        warm_starts: Vec::new(),
        stop,
        elsewhere: None,
    }
}

/// A choice: the start with another power, µW.
fn choice(search: &TuneSearch<'_>, power_uw: i32) -> Parameters {
    let mut tuned = search.start;
    tuned.settings.power_uw = power_uw;
    tuned
}

/// Results of start and choice on the held-out pairs.
fn judged(search: &TuneSearch<'_>, power_uw: i32) -> [Summary; 2] {
    [search.start, choice(search, power_uw)]
        .map(|own| search.judge(&own, &Silent).expect("it is judged"))
}

/// Search for the front of a choice with this power, µW.
fn of_choice<'a>(
    search: &'a TuneSearch<'a>,
    power_uw: i32,
    judged: &'a [Summary; 2],
) -> FrontSearch<'a> {
    let tuned = choice(search, power_uw);
    let space = search.space.clone().with_power(LidarPreset::Full);
    FrontSearch { search, space, tuned, judged: judged.each_ref(), cost: CostKind::Energy }
}

/// Front found on a number of threads, resumed after the generations `done`, and its journal.
fn found(
    path: &Path,
    threads: usize,
    power_uw: i32,
    done: &[Generation],
) -> Result<(Vec<u8>, Front), TuneError> {
    let never = AtomicBool::new(false);
    let search = search(&never);
    let judged = judged(&search, power_uw);
    let front = of_choice(&search, power_uw, &judged);
    let mut journal = Journal::create(path, &front.header())?;
    for generation in done {
        journal.add(generation)?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let found = pool.install(|| front.run(&mut journal, done.to_vec(), &Silent))?;
    Ok((std::fs::read(path).expect("a journal"), found))
}

#[test]
fn a_front_is_the_same_on_any_number_of_threads_and_after_a_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let (bytes, front) = found(&at("one"), 1, POWER_UW, &[]).expect("a front");
    let (again, same) = found(&at("three"), 3, POWER_UW, &[]).expect("a front");
    assert!(bytes == again, "the journals differ");
    assert_eq!(front, same);

    let never = AtomicBool::new(false);
    let search = search(&never);
    let header = of_choice(&search, POWER_UW, &judged(&search, POWER_UW)).header();
    let (_, generations) = Journal::resume(&at("one"), &header, false).expect("a journal");
    assert_eq!(generations.len(), GENERATIONS);
    for done in [1, GENERATIONS] {
        let name = format!("after {done}");
        let resumed = found(&at(&name), 2, POWER_UW, &generations[..done]);
        let (again, same) = resumed.expect("a front");
        assert!(bytes == again && front == same, "after {done} generations");
    }

    let other = found(&at("other"), 2, 30_000_000, &generations[..1]).expect_err("another search");
    assert!(matches!(other, TuneError::Diverged { generation: 0, .. }), "{other}");
}

#[test]
fn a_repeated_candidate_is_not_evaluated_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let never = AtomicBool::new(false);
    let search = search(&never);
    let judged = judged(&search, POWER_UW);
    let front = of_choice(&search, POWER_UW, &judged);
    let read = |name: &str| {
        let journal = Journal::resume(&at(name), &front.header(), false);
        journal.expect("a journal").1
    };
    found(&at("whole"), 2, POWER_UW, &[]).expect("a front");
    // No registration gives this stop reason: an error that has it comes from the journal.
    const MARK: &str = "of the journal";
    let mut first = read("whole").swap_remove(0);
    let errors = first.candidates.iter_mut().flat_map(|candidate| &mut candidate.errors);
    errors.for_each(|error| error.stop = MARK.into());
    found(&at("marked"), 2, POWER_UW, &[first]).expect("a front");
    let marked = read("marked");
    let parameters = |c: &CandidateRecord| front.space.parameters(&c.point).0;
    let known: Vec<Parameters> = marked[0].candidates.iter().map(parameters).collect();
    let mut again = 0;
    for candidate in marked[1..].iter().flat_map(|generation| &generation.candidates) {
        let is_known = known.contains(&parameters(candidate));
        assert!(candidate.errors.iter().all(|error| (error.stop == MARK) == is_known));
        again += usize::from(is_known);
    }
    assert!(again > 0, "none comes again");
}

#[test]
fn a_front_has_its_ends_and_names_the_cheapest_point_as_good_as_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, front) = found(&folder.path().join("a"), 2, POWER_UW, &[]).expect("a front");
    assert!((2..=5).contains(&front.points.len()), "{} points", front.points.len());
    let energies: Vec<f64> = front.points.iter().map(|p| p.mark.cost.energy_j).collect();
    assert!(energies.is_sorted(), "{energies:?}");
    assert!(energies[0] < 1e-2 * front.default.cost.energy_j, "{energies:?}");
    assert_eq!(front.default.cost.energy_j, 48.0 * 16.0 * 375e-9);
    assert!((front.tuned.cost.energy_j / front.default.cost.energy_j - 20.0 / 75.0).abs() < 1e-12);
    for point in &front.points {
        let [low, high] = point.mark.interval;
        assert!(low <= point.mark.error && point.mark.error <= high, "{point:?}");
        let difference = point.mark.error - front.default.error;
        assert!((point.comparison.difference - difference).abs() < 1e-12);
    }
    if let Some(cheapest) = front.cheapest_as_good() {
        let at = front.points.iter().position(|point| point == cheapest).expect("one of them");
        assert!(front.points[..at].iter().all(|point| point.comparison.is_worse()));
        let verdict = front.verdict();
        assert!(verdict.contains("energy, as far as 3 pairs tell"), "{verdict}");
    }
}

#[test]
fn a_stopped_search_keeps_its_journal() {
    let folder = tempfile::tempdir().expect("a folder");
    let stop = AtomicBool::new(true);
    let search = search(&stop);
    let judged = judged(&search, POWER_UW);
    let front = of_choice(&search, POWER_UW, &judged);
    let path = folder.path().join("a");
    let mut journal = Journal::create(&path, &front.header()).expect("a journal");
    let stopped = front.run(&mut journal, Vec::new(), &Silent).expect_err("nobody waits");
    assert!(matches!(stopped, TuneError::Interrupted { generations: 0 }), "{stopped}");
    assert!(Journal::resume(&path, &front.header(), false).is_ok());
}

/// Registrations of the last stage, as announced and as made.
#[derive(Default)]
struct Last(Mutex<(usize, usize)>);

impl Observer for Last {
    fn evaluated(&self) {
        self.0.lock().expect("nobody panicked").1 += 1;
    }

    fn stage(&self, _name: &str, registrations: usize) {
        *self.0.lock().expect("nobody panicked") = (registrations, 0);
    }
}

#[test]
fn start_and_choice_are_not_judged_again_when_they_are_on_the_front() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let never = AtomicBool::new(false);
    let search = search(&never);
    // A choice that nothing dominates: a point of an earlier front.
    let (_, front) = found(&at("before"), 2, POWER_UW, &[]).expect("a front");
    let mut on_both = 0;
    for (number, point) in front.points.iter().enumerate() {
        let tuned = search.start.with_values(&point.values, &*CONFIG, &CONFIG.device());
        let tuned = tuned.expect("parameters");
        let judged = [search.start, tuned].map(|own| search.judge(&own, &Silent).expect("judged"));
        let front = FrontSearch { tuned, ..of_choice(&search, 1, &judged) };
        let mut journal =
            Journal::create(&at(&number.to_string()), &front.header()).expect("a journal");
        let last = Last::default();
        let found = front.run(&mut journal, Vec::new(), &last).expect("a front");
        let known = [search.start, tuned].map(|own| own.values(&*CONFIG));
        let is_known = |point: &&FrontPoint| known.contains(&point.values);
        let rest = found.points.iter().filter(|point| !is_known(point)).count();
        let (announced, made) = last.0.into_inner().expect("nobody panicked");
        assert_eq!((announced, made), (3 * rest, 3 * rest));
        on_both += found.points.len() - rest;
    }
    assert!(on_both > 0, "none of {} stayed on a front", front.points.len());
}
