//! CPU time of MAC on one thread, from matches to a motion, in ms.
//!
//! `synthetic/N` has N matches, 4 % of them right. `published/5678`, with ECHOLOOP_DATA set, has
//! the matches of the method's own demonstration at both of its thresholds (scores above 0.999 and
//! 0.99 at τ = 0.1 m); its C++ takes 7.8 s for the first.

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, criterion_group, criterion_main};
use echoloop_benches::cpu::{CpuTime, on_one_thread};
use echoloop_clouds::Pose;
use echoloop_registration::features::PointPair;
use echoloop_registration::{Mac, MacConfig};
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random matches in a scene 80 m wide; right ones are off by 5 cm.
fn matches(count: usize) -> Vec<PointPair> {
    let rng = &mut ChaCha8Rng::seed_from_u64(3);
    let truth = Pose::new(Vector3::new(8.0, -3.0, 0.2), Vector3::new(0.0, 0.0, 1.9));
    let mut place =
        |half: f64| Point3::from([0; 3].map(|_| (rng.random::<f64>() - 0.5) * 2.0 * half));
    let pair = |i: usize| {
        let source = place(40.0);
        let off = place(0.05).coords;
        PointPair {
            source,
            target: if i.is_multiple_of(25) { truth * source + off } else { place(40.0) },
        }
    };
    (0..count).map(pair).collect()
}

/// Matches from lines of six numbers: the point in the source, and in the target.
fn published() -> Option<Vec<PointPair>> {
    let path =
        PathBuf::from(std::env::var_os("ECHOLOOP_DATA")?).join("mac_correspondences/corr_data.txt");
    let numbers = |line: &str| {
        line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>()
    };
    let pair = |line: &str| match numbers(line)?.as_slice() {
        &[a, b, c, d, e, f] => {
            Some(PointPair { source: [a, b, c].into(), target: [d, e, f].into() })
        }
        _ => None,
    };
    std::fs::read_to_string(path).ok()?.lines().map(pair).collect()
}

fn mac(criterion: &mut Criterion<CpuTime>) {
    let mut run = |name: &str, config: MacConfig, pairs: &[PointPair]| {
        let Ok(mac) = Mac::new(config) else { return };
        criterion
            .bench_function(&format!("mac/{name}"), |b| b.iter(|| mac.solve(black_box(pairs))));
    };
    for count in [1000, 2000, 5000, 10_000] {
        run(&format!("synthetic/{count}"), MacConfig::outdoor(), &matches(count));
    }
    match published() {
        Some(pairs) => {
            let strict = MacConfig::indoor();
            run("published/5678", strict, &pairs);
            run(
                "published-0.99/5678",
                MacConfig { length_tolerance_m: 0.1 * f64::sqrt(0.01), ..strict },
                &pairs,
            );
        }
        None => {
            eprintln!("skipped: ECHOLOOP_DATA is unset, so the published matches are not timed")
        }
    }
}

criterion_group! {
    name = benches;
    config = on_one_thread(10);
    targets = mac
}
criterion_main!(benches);
