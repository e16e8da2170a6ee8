//! CPU time of mutual matching on one thread, in ms per pair of clouds.
//!
//! `synthetic/n` has clustered histograms. `ECHOLOOP_FEATURES=source.f32,target.f32` (33
//! little-endian f32 a row) adds a pair of one's own.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use echoloop_benches::cpu::{CpuTime, on_one_thread};
use echoloop_registration::features::{DIMENSIONS, Features, matching};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random features of three histograms that each sum to 200, clustered around `centres` shapes.
fn histograms(seed: u64, rows: usize, centres: usize) -> Features {
    let shapes = &mut ChaCha8Rng::seed_from_u64(7);
    let shapes: Vec<[f32; DIMENSIONS]> =
        (0..centres).map(|_| std::array::from_fn(|_| shapes.random::<f32>().powi(4))).collect();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut row = || {
        let [a, b] = [0, 1].map(|_| shapes[rng.random_range(0..centres)]);
        let share = rng.random::<f32>();
        let mut row: [f32; DIMENSIONS] = std::array::from_fn(|i| {
            (a[i] * share + b[i] * (1.0 - share)) * (0.9 + 0.2 * rng.random::<f32>())
        });
        for block in row.chunks_mut(11) {
            let scale = 200.0 / block.iter().sum::<f32>();
            block.iter_mut().for_each(|x| *x *= scale);
        }
        row
    };
    Features { rows: (0..rows).map(|_| row()).collect() }
}

fn read(path: &str) -> Option<Features> {
    let bytes = std::fs::read(Path::new(path)).ok()?;
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    Some(Features { rows: values.as_chunks().0.to_vec() })
}

fn pair(criterion: &mut Criterion<CpuTime>, name: &str, source: &Features, target: &Features) {
    criterion.bench_function(&format!("matching/{name}"), |b| {
        b.iter(|| black_box(matching::mutual(black_box(source), black_box(target))));
    });
    criterion.bench_function(&format!("matching-baseline/{name}"), |b| {
        b.iter(|| black_box(matching::mutual_baseline(black_box(source), black_box(target))));
    });
}

fn benches(criterion: &mut Criterion<CpuTime>) {
    for rows in [5000, 20_000] {
        let (source, target) = (histograms(1, rows, 200), histograms(2, rows, 200));
        pair(criterion, &format!("synthetic/{rows}"), &source, &target);
    }
    let files = std::env::var("ECHOLOOP_FEATURES").unwrap_or_default();
    match files.split_once(',').and_then(|(source, target)| Some((read(source)?, read(target)?))) {
        Some((source, target)) => {
            pair(criterion, &format!("given/{}", source.rows.len()), &source, &target)
        }
        None => eprintln!("skipped: given features (ECHOLOOP_FEATURES is not two files)"),
    }
}

criterion_group! {
    name = matching_benches;
    config = on_one_thread(10);
    targets = benches
}
criterion_main!(matching_benches);
