//! The search on problems whose fronts are known.

use super::*;

/// Two spheres about 0.25 and 0.75 on the first axis, 0.5 on the others: the front is the line
/// between, √f₁ + √f₂ = ½.
fn double_sphere(x: &[f64]) -> Objectives {
    let from = |centre: f64| {
        let rest = x[1..].iter().map(|x| (x - 0.5).powi(2)).sum::<f64>();
        (x[0] - centre).powi(2) + rest
    };
    [from(0.25), from(0.75)]
}

/// ZDT1 (Zitzler, Deb, Thiele 2000): the front is f₂ = 1 − √f₁.
fn zdt1(x: &[f64]) -> Objectives {
    let g = 1.0 + 9.0 * x[1..].iter().sum::<f64>() / (x.len() - 1) as f64;
    [x[0], g * (1.0 - (x[0] / g).sqrt())]
}

fn config(dimension: usize, population: usize, seed: u64) -> ParetoConfig {
    ParetoConfig { starts: Vec::new(), dimension, population, seed }
}

fn searched(
    config: ParetoConfig,
    generations: u64,
    function: impl Fn(&[f64]) -> Objectives,
) -> Pareto {
    let mut search = Pareto::new(config).unwrap();
    while search.generation() < generations {
        let values: Vec<Objectives> = search.ask().iter().map(|x| function(x)).collect();
        search.tell(&values).unwrap();
    }
    search
}

fn values(search: &Pareto) -> Vec<Objectives> {
    search.population().iter().map(|valued| valued.values).collect()
}

#[test]
fn a_double_sphere_s_front_is_found_to_a_fortieth_of_its_area() {
    // Up to (¼, ¼): ∫ (¼ − (½ − √t)²) dt over 0 to ¼ is 1/16 − 1/96.
    let whole = 1.0 / 16.0 - 1.0 / 96.0;
    for seed in 0..5 {
        let search = searched(config(10, 40, seed), 100, double_sphere);
        let found = hypervolume(&values(&search), [0.25, 0.25]);

        assert!(found > 0.975 * whole && found <= whole, "seed {seed}: {}", found / whole);
        let ranks = ranks(&values(&search));
        assert!(ranks.iter().filter(|&&rank| rank == 0).count() >= 30, "seed {seed}");
    }
}

#[test]
fn zdt1_s_front_is_found_from_end_to_end() {
    // Up to (1.1, 1.1): 1.21 − 1/3.
    let whole = 1.21 - 1.0 / 3.0;
    for seed in 0..5 {
        let search = searched(config(30, 100, seed), 250, zdt1);
        let found = values(&search);
        let area = hypervolume(&found, [1.1, 1.1]);

        assert!(area > 0.985 * whole && area <= whole, "seed {seed}: {}", area / whole);
        let least = |i: usize| found.iter().map(|v| v[i]).fold(f64::INFINITY, f64::min);
        assert!(least(0) < 0.01 && least(1) < 0.03, "seed {seed}: {} {}", least(0), least(1));
    }
}

#[test]
fn the_same_values_lead_to_the_same_points_and_another_seed_to_others() {
    let [a, b] = [0, 1].map(|_| searched(config(5, 12, 3), 8, double_sphere));
    assert_eq!(a.population(), b.population());
    assert_eq!(a.ask(), b.ask());
    let other = searched(config(5, 12, 4), 8, double_sphere);
    assert_ne!(a.ask(), other.ask());
}

#[test]
fn starts_are_asked_first_and_values_that_are_not_finite_are_dropped_first() {
    let starts = vec![vec![0.25; 3], vec![0.5; 3]];
    let mut search = Pareto::new(ParetoConfig { starts, ..config(3, 4, 1) }).unwrap();
    assert_eq!(search.ask()[..2], [vec![0.25; 3], vec![0.5; 3]]);
    search.tell(&[[f64::NAN; 2], [1.0, 2.0], [2.0, 1.0], [0.0, f64::INFINITY]]).unwrap();
    search.tell(&[[3.0, 3.0], [4.0, 4.0], [f64::NAN, 0.0], [5.0, 5.0]]).unwrap();
    let kept = values(&search);
    assert!(kept.iter().flatten().all(|value| value.is_finite()), "{kept:?}");
}

#[test]
fn a_setting_that_cannot_run_is_named() {
    let refused = |config| Pareto::new(config).unwrap_err().to_string();
    assert_eq!(refused(config(0, 8, 1)), "dimension = 0 must be at least 1");
    assert_eq!(refused(config(2, 3, 1)), "population = 3 must be at least 4");
    let starts = |starts| ParetoConfig { starts, ..config(2, 4, 1) };
    assert_eq!(refused(starts(vec![vec![0.5; 2]; 5])), "starts = 5 must be at most a population");
    assert_eq!(
        refused(starts(vec![vec![0.5, 1.5]])),
        "starts = [0.5, 1.5] must be points of the unit cube"
    );
    assert!(refused(starts(vec![vec![0.5]])).contains("points of the unit cube"));
    let mut search = Pareto::new(config(2, 4, 1)).unwrap();
    assert_eq!(
        search.tell(&[[1.0, 1.0]; 3]).unwrap_err().to_string(),
        "told 3 values for 4 candidates"
    );
    assert_eq!(search.generation(), 0);
}
