use super::*;
use crate::Constants;

fn free(n: usize, seed: u64) -> CmaEsConfig {
    CmaEsConfig {
        mean: vec![3.0; n],
        sigma: 2.0,
        lambda: None,
        seed,
        constants: Constants::Tutorial,
        bounded: false,
        coordinates: Vec::new(),
        trust: 0.0,
        stops: Stops { target: Some(1e-8), generations: Some(20_000), ..Stops::default() },
    }
}

fn advance(search: &mut CmaEs, f: impl Fn(&[f64]) -> f64) {
    let values: Vec<f64> = search.ask().iter().map(|c| f(&c.phenotype)).collect();
    search.tell(&values).unwrap();
}

/// Evaluations until the target; `None` when the search ends elsewhere.
fn evaluations(config: CmaEsConfig, f: impl Fn(&[f64]) -> f64) -> Option<f64> {
    let mut search = CmaEs::new(config).unwrap();
    while search.stop().is_none() {
        advance(&mut search, &f);
    }
    let evaluations = (search.generation() as usize * search.strategy().lambda) as f64;
    (search.stop() == Some(StopReason::Target)).then_some(evaluations)
}

fn median(n: usize, constants: Constants, f: impl Fn(&[f64]) -> f64) -> f64 {
    let one = |seed| evaluations(CmaEsConfig { constants, ..free(n, seed) }, &f);
    let mut all: Vec<f64> = (0..31).map(|seed| one(seed).expect("the target")).collect();
    all.sort_by(f64::total_cmp);
    all[15]
}

fn ellipsoid(x: &[f64]) -> f64 {
    let n = x.len() as f64 - 1.0;
    x.iter().enumerate().map(|(i, v)| 1e6f64.powf(i as f64 / n) * v * v).sum()
}

fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

fn cigar(x: &[f64]) -> f64 {
    x[0] * x[0] + 1e6 * sphere(&x[1..])
}

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
}

/// A fixed rotation by Householder reflections.
fn rotated(x: &[f64]) -> Vec<f64> {
    let mut y = x.to_vec();
    for k in 1..=x.len() {
        let v: Vec<f64> = (0..x.len()).map(|i| ((i * 7 + k * 13) as f64).sin()).collect();
        let scale = 2.0 * v.iter().zip(&y).map(|(a, b)| a * b).sum::<f64>() / sphere(&v);
        y.iter_mut().zip(&v).for_each(|(y, v)| *y -= scale * v);
    }
    y
}

/// Medians of two published implementations over 15 seeds: benches/record/optimiser.md.
#[test]
fn evaluations_to_the_optimum_are_those_of_published_implementations() {
    type Function = fn(&[f64]) -> f64;
    let table: [(&str, Function, [f64; 2]); 3] = [
        ("sphere", sphere, [708.0, 1483.0]),
        ("ellipsoid", ellipsoid, [1570.0, 4309.0]),
        ("cigar", cigar, [1856.0, 4073.0]),
    ];
    for (name, f, published) in table {
        for (n, published) in [5, 10].into_iter().zip(published) {
            let ours = median(n, Constants::Tutorial, f);
            assert!(
                (ours / published - 1.0).abs() < 0.15,
                "{name} in {n}-D: {ours} against {published}"
            );
        }
    }
}

/// Medians of pycma 4.5 over 201 seeds: benches/record/optimiser.md.
#[test]
fn with_the_default_constants_it_takes_at_most_a_twentieth_more_evaluations_than_pycma() {
    type Function = fn(&[f64]) -> f64;
    let table: [(&str, Function, [f64; 2]); 4] = [
        ("sphere", sphere, [720.0, 1470.0]),
        ("ellipsoid", ellipsoid, [1488.0, 4090.0]),
        ("turned ellipsoid", |x| ellipsoid(&rotated(x)), [1472.0, 4050.0]),
        ("cigar", cigar, [1704.0, 3980.0]),
    ];
    for (name, f, pycma) in table {
        for (n, pycma) in [5, 10].into_iter().zip(pycma) {
            let ours = median(n, Constants::default(), f);
            assert!(ours <= 1.05 * pycma, "{name} in {n}-D: {ours} against {pycma}");
        }
    }
}

#[test]
fn rosenbrock_takes_as_long_as_published() {
    for (n, published) in [(5, 1634.0), (10, 5051.0)] {
        let mut all: Vec<f64> = (0..31)
            .filter_map(|seed| {
                let config = CmaEsConfig { mean: vec![0.0; n], sigma: 0.1, ..free(n, seed) };
                evaluations(config, rosenbrock)
            })
            .collect();
        assert!(all.len() >= 28, "the local optimum of 5-D may catch a few: {}", all.len());
        all.sort_by(f64::total_cmp);
        let ours = all[all.len() / 2];
        assert!((ours / published - 1.0).abs() < 0.15, "{n}-D: {ours} against {published}");
    }
}

#[test]
fn a_rotation_changes_nothing() {
    let straight = median(10, Constants::Tutorial, ellipsoid);
    let turned = median(10, Constants::Tutorial, |x| ellipsoid(&rotated(x)));
    assert!((turned / straight - 1.0).abs() < 0.08, "{turned} against {straight}");
}

fn run(mut search: CmaEs, generations: usize, f: impl Fn(&[f64]) -> f64) -> CmaEs {
    for _ in 0..generations {
        advance(&mut search, &f);
    }
    search
}

#[test]
fn a_constant_function_does_not_blow_the_step_size_up() {
    let search =
        run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.5; 10], 0.2, 1)).unwrap(), 300, |_| 1.0);
    assert!(
        search.sigma().is_finite() && search.deviations().iter().all(|d| *d <= 1.0 / 3.0 + 1e-12)
    );
    assert!(search.mean().iter().all(|m| (0.0..=1.0).contains(m)));
}

#[test]
fn an_optimum_on_a_face_or_in_a_corner_is_reached() {
    for corner in [[0.0; 6], [1.0; 6], [0.0, 0.5, 1.0, 0.3, 0.0, 1.0]] {
        let f = |x: &[f64]| x.iter().zip(corner).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let search = run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.5; 6], 0.2, 3)).unwrap(), 250, f);
        assert!(f(search.mean()) < 1e-8, "{corner:?}: {:?}", search.mean());
    }
}

#[test]
fn every_phenotype_lies_in_the_cube() {
    let mut search = CmaEs::new(CmaEsConfig::unit_cube(vec![0.0, 1.0, 0.5], 1.0, 5)).unwrap();
    for _ in 0..50 {
        let candidates = search.ask();
        assert!(candidates.iter().flat_map(|c| &c.phenotype).all(|x| (0.0..=1.0).contains(x)));
        let values: Vec<f64> = candidates.iter().map(|c| -sphere(&c.phenotype)).collect();
        search.tell(&values).unwrap();
    }
}

#[test]
fn a_value_that_is_not_finite_ranks_last() {
    let new = || CmaEs::new(CmaEsConfig::unit_cube(vec![0.5; 4], 0.2, 1)).unwrap();
    let last = |bad: f64| {
        let mut search = new();
        let mut values: Vec<f64> = search.ask().iter().map(|c| sphere(&c.phenotype)).collect();
        values[2] = bad;
        search.tell(&values).unwrap();
        search.mean().to_vec()
    };
    assert_eq!(last(f64::NAN), last(1e300));
    assert_eq!(last(f64::INFINITY), last(1e300));
    assert_eq!(last(f64::NEG_INFINITY), last(1e300));
    let mut search = new();
    search.tell(&[f64::NAN; 8]).unwrap();
    assert_eq!((search.mean(), search.generation()), (new().mean(), 1));
}

#[test]
fn the_same_values_lead_to_the_same_state_byte_for_byte() {
    let f = |x: &[f64]| sphere(x) + x[0].sin();
    let first = run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.4; 7], 0.2, 9)).unwrap(), 40, f);
    let again = run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.4; 7], 0.2, 9)).unwrap(), 40, f);
    assert_eq!(first.ask(), again.ask());
    assert_eq!(first.sigma().to_bits(), again.sigma().to_bits());
    let other = run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.4; 7], 0.2, 10)).unwrap(), 40, f);
    assert_ne!(first.ask(), other.ask());
}

#[test]
fn settings_that_cannot_run_are_named() {
    let error = |change: fn(&mut CmaEsConfig)| {
        let mut config = CmaEsConfig::unit_cube(vec![0.5; 2], 0.2, 1);
        change(&mut config);
        CmaEs::new(config).map(|_| ()).unwrap_err().field
    };
    assert_eq!(error(|c| c.mean.clear()), "mean");
    assert_eq!(error(|c| c.mean[0] = 1.5), "mean");
    assert_eq!(error(|c| c.sigma = f64::NAN), "sigma");
    assert_eq!(error(|c| c.lambda = Some(1)), "lambda");
    assert_eq!(error(|c| c.trust = f64::NAN), "trust");
    assert_eq!(error(|c| c.coordinates = vec![Coordinate::Whole(3)]), "coordinates");
    assert_eq!(
        error(|c| c.coordinates = vec![Coordinate::Real, Coordinate::Whole(0)]),
        "coordinates"
    );
    let mut search = CmaEs::new(CmaEsConfig::unit_cube(vec![0.5; 2], 0.2, 1)).unwrap();
    assert_eq!(search.tell(&[1.0]), Err(TellError { told: 1, asked: 6 }));
}

#[test]
fn correlated_parameters_show_as_correlated() {
    let valley = |x: &[f64]| 1e4 * (x[0] - x[1]).powi(2) + (x[0] + x[1] - 1.0).powi(2);
    let search =
        run(CmaEs::new(CmaEsConfig::unit_cube(vec![0.3, 0.6], 0.2, 2)).unwrap(), 60, valley);
    assert!(search.correlations()[0][1] > 0.9, "{:?}", search.correlations());
}

/// Evaluations to 1e-10 on ten real and ten discrete coordinates; the scale makes one whole number
/// one real unit. `None` when it takes 2000 generations or more.
fn mixed(
    count: usize,
    discrete: Coordinate,
    seed: u64,
    f: fn(&[f64], &[f64]) -> f64,
) -> Option<f64> {
    let (n, width) = (20, count as f64);
    let first = if count == 2 { -0.5 } else { -width / 2.0 };
    let start = candidate_generator(seed, 0, u64::MAX).normals(n);
    let uniform = start.iter().map(|z| 2.0 + libm::erf(z / std::f64::consts::SQRT_2));
    let mean = uniform
        .enumerate()
        .map(|(i, x)| if count == 2 && i >= n / 2 { 0.5 } else { (x - first) / width });
    let config = CmaEsConfig {
        mean: mean.collect(),
        sigma: 1.0 / width,
        coordinates: [[Coordinate::Real; 10], [discrete; 10]].concat(),
        stops: Stops { target: Some(1e-10), generations: Some(2000), ..Stops::default() },
        ..free(n, seed)
    };
    let value = |x: &[f64]| {
        let real: Vec<f64> = x.iter().map(|u| first + u * width).collect();
        let whole: Vec<f64> = real[n / 2..]
            .iter()
            .map(|v| v.round().clamp(first + 0.5, first + width - 0.5))
            .collect();
        f(&real[..n / 2], &whole)
    };
    evaluations(config, value)
}

fn zeros(whole: &[f64]) -> f64 {
    whole.iter().map(|b| 1.0 - b).sum()
}

fn steep(real: &[f64]) -> f64 {
    let last = real.len() as f64 - 1.0;
    real.iter().enumerate().map(|(i, x)| 1e6f64.powf(i as f64 / last) * x * x).sum()
}

/// Medians over 15 seeds of CyberAgent's CMAwM, and for choices of its CatCMAwM.
#[test]
fn whole_numbers_and_choices_take_at_most_as_long_as_published() {
    use Coordinate::{Choice, Whole};
    type Function = fn(&[f64], &[f64]) -> f64;
    let sphere_bits: Function = |real, bits| sphere(real) + zeros(bits);
    let steep_bits: Function = |real, bits| steep(real) + zeros(bits);
    let table: [(&str, Coordinate, Function, f64); 6] = [
        ("SphereInt", Whole(21), |real, whole| sphere(real) + sphere(whole), 3777.0),
        ("EllipsoidInt", Whole(21), |real, whole| steep(&[real, whole].concat()), 8279.0),
        ("SphereOneMax", Whole(2), sphere_bits, 3811.0),
        ("EllipsoidOneMax", Whole(2), steep_bits, 11130.0),
        ("SphereOneMax", Choice(2), sphere_bits, 2457.0),
        ("EllipsoidOneMax", Choice(2), steep_bits, 5639.0),
    ];
    for (name, discrete, f, published) in table {
        let count = if let Whole(count) | Choice(count) = discrete { count } else { 0 };
        let mut all: Vec<f64> =
            (0..15).filter_map(|seed| mixed(count, discrete, seed, f)).collect();
        assert_eq!(all.len(), 15, "{name}, {discrete:?}: every run succeeds");
        all.sort_by(f64::total_cmp);
        let ratio = all[7] / published;
        assert!((0.8..1.1).contains(&ratio), "{name}, {discrete:?}: {} of {published}", all[7]);
    }
}

#[test]
fn without_the_margin_two_values_settle_too_early() {
    let f: fn(&[f64], &[f64]) -> f64 = |real, whole| sphere(real) + zeros(whole);
    let successes = (0..15).filter(|&seed| mixed(2, Coordinate::Real, seed, f).is_some()).count();
    assert!(successes < 12, "{successes} of 15");
}

#[test]
fn whole_numbers_at_the_ends_of_the_cube_are_reached() {
    for goal in [[0.125, 0.875, 0.375], [0.875, 0.125, 0.625]] {
        let f = |x: &[f64]| {
            x[3].powi(2) + x.iter().zip(goal).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        let config = CmaEsConfig {
            coordinates: [[Coordinate::Whole(4); 3].as_slice(), &[Coordinate::Real]].concat(),
            ..CmaEsConfig::unit_cube(vec![0.375, 0.375, 0.875, 0.5], 0.2, 4)
        };
        let search = run(CmaEs::new(config).unwrap(), 150, f);
        let cell = |u: f64| ((u * 4.0).floor().min(3.0) + 0.5) / 4.0;
        let found: Vec<f64> = search.mean()[..3].iter().map(|&m| cell(m)).collect();
        assert_eq!(found, goal);
        assert!(search.mean().iter().all(|m| (0.0..=1.0).contains(m)));
    }
}

/// Number of wrong names; there are three, and the right one is the coordinate's index modulo 3.
fn wrong_names(x: &[f64]) -> f64 {
    let names = x.iter().map(|u| (u * 3.0) as usize);
    names.enumerate().map(|(i, name)| f64::from(u8::from(name != i % 3))).sum()
}

#[test]
fn a_search_with_choices_only_finds_the_right_names() {
    let mut config = CmaEsConfig::unit_cube(vec![0.1; 12], 0.2, 1);
    config.coordinates = vec![Coordinate::Choice(3); 12];
    config.stops.generations = Some(2_000);
    let mut search = CmaEs::new(config).unwrap();
    assert_eq!(search.stop(), None);
    while search.stop().is_none() {
        assert!(search.ask().iter().flat_map(|c| &c.phenotype).all(|x| (0.0..=1.0).contains(x)));
        advance(&mut search, wrong_names);
    }
    assert_eq!(search.stop(), Some(StopReason::TolX));
    assert_eq!(wrong_names(search.mean()), 0.0);
    assert!(search.generation() < 400, "{}", search.generation());
}

/// Real and whole numbers and choices, mixed.
fn of_all_kinds(seed: u64) -> CmaEsConfig {
    use Coordinate::{Choice, Real, Whole};
    let mut config = CmaEsConfig::unit_cube(vec![0.3, 0.6, 0.5, 0.9, 0.2, 0.5], 0.2, seed);
    config.coordinates = vec![Choice(3), Real, Whole(4), Choice(2), Real, Whole(21)];
    config
}

#[test]
fn coordinates_of_all_kinds_find_their_optimum_in_one_search() {
    let goal = [5.0 / 6.0, 0.8, 0.125, 0.25, 0.1, 0.5];
    let f = |x: &[f64]| x.iter().zip(goal).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    for seed in 0..20 {
        let search = run(CmaEs::new(of_all_kinds(seed)).unwrap(), 80, f);
        let off: Vec<f64> = search.mean().iter().zip(goal).map(|(a, b)| (a - b).abs()).collect();
        assert!(off[0] + off[3] < 1e-12 && off[1] + off[4] < 1e-3, "{seed}: {off:?}");
        assert!(off[2] < 0.125 && off[5] < 0.5 / 21.0, "{seed}: {off:?}");
    }
}

#[test]
fn probabilities_mean_and_deviation_of_a_choice_are_those_of_its_names() {
    let search =
        run(CmaEs::new(of_all_kinds(1)).unwrap(), 30, |x| (x[0] - 0.5).abs() + x[3] * x[1]);
    let likely = |i| search.probabilities(i).unwrap().iter().copied().fold(0.0, f64::max);
    assert!(likely(0) > 0.8 && likely(3) > 0.8, "{search:?}");
    assert_eq!([1, 2, 4, 5, 6].map(|i| search.probabilities(i)), [None; 5]);
    assert_eq!((search.mean()[0], search.mean()[3]), (0.5, 0.25));
    let correlations = search.correlations();
    assert!((0..6).all(|i| (correlations[i][i] - 1.0).abs() < 1e-12));
    assert!((1..6).all(|j| correlations[0][j] == 0.0 && correlations[j][0] == 0.0));
    assert!(search.deviations()[0] < 0.2, "{:?}", search.deviations());
}

#[test]
fn with_choices_too_the_same_values_lead_to_the_same_state() {
    let f = |x: &[f64]| x[0] * x[4] + (x[2] - x[5]).abs() + x[3];
    let [first, again] = [(); 2].map(|()| run(CmaEs::new(of_all_kinds(9)).unwrap(), 40, f));
    assert_eq!(first.ask(), again.ask());
    assert_eq!(first.ask(), first.ask());
    assert_eq!(first.deviations(), again.deviations());
    let mut blind = CmaEs::new(of_all_kinds(9)).unwrap();
    let before = blind.probabilities(0).unwrap().to_vec();
    blind.tell(&[f64::NAN; 9]).unwrap();
    assert_eq!(blind.probabilities(0).unwrap(), before, "nothing is learned from nothing");
}

/// Results of the version before choices: published searches must be reproducible.
#[test]
fn searches_without_choices_never_change() {
    let mut config = CmaEsConfig::unit_cube(vec![0.3, 0.6, 0.5, 0.9, 0.2], 0.2, 7);
    config.constants = Constants::Tutorial;
    let [real, four, many] = [Coordinate::Real, Coordinate::Whole(4), Coordinate::Whole(21)];
    config.coordinates = vec![real, four, real, real, many];
    let slope = |i: usize, x: f64| {
        let i = i as f64;
        (i + 1.0) * (x - 0.1 * i) * (x - 0.15 * i)
    };
    let search = run(CmaEs::new(config).unwrap(), 40, |x| {
        x.iter().enumerate().map(|(i, &x)| slope(i, x)).sum()
    });
    let mean = [
        0.003952345242950733,
        0.24114516459189472,
        0.25221080892787967,
        0.3769386216523917,
        0.49974418002153803,
    ];
    assert_eq!((search.mean(), search.sigma()), (mean.as_slice(), 0.012967374742347838));
}
