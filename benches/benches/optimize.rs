//! CPU time of one generation, ask and tell, in ms, without the evaluations.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use echoloop_cmaes::{CmaEs, CmaEsConfig, Coordinate};

fn generation(criterion: &mut Criterion, kind: &str, coordinates: Vec<Coordinate>, lambda: usize) {
    let n = coordinates.len();
    let mut config = CmaEsConfig::unit_cube(vec![0.5; n], 0.2, 1);
    config.lambda = Some(lambda);
    config.coordinates = coordinates;
    let Ok(mut search) = CmaEs::new(config) else {
        return;
    };
    let worth = |search: &CmaEs| {
        search.ask().iter().map(|c| c.phenotype.iter().sum()).collect::<Vec<f64>>()
    };
    for _ in 0..50 {
        // Warms up: the first covariances are easier to decompose than later ones.
        let _ = search.tell(&worth(&search));
    }
    let values = worth(&search);
    criterion.bench_function(&format!("{kind}/{n}x{lambda}"), |b| {
        b.iter_batched_ref(
            || search.clone(),
            |search| (search.ask(), search.tell(&values)),
            BatchSize::SmallInput,
        );
    });
}

fn generations(criterion: &mut Criterion) {
    use Coordinate::{Choice, Real, Whole};
    for (n, lambda) in [(16, 16), (100, 17)] {
        generation(criterion, "generation", vec![Real; n], lambda);
        generation(criterion, "generation-whole", vec![Whole(21); n], lambda);
        let choices = [vec![Real; n - 3], vec![Choice(2), Choice(3), Choice(4)]].concat();
        generation(criterion, "generation-choices", choices, lambda);
    }
}

criterion_group!(benches, generations);
criterion_main!(benches);
