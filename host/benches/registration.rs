//! Time of each stage of a registration on one thread, in ms a cloud or a pair.
//!
//! `synthetic/70k` is a yard sampled at random; `small_gicp/70k` the pair of that name, when ECHOLOOP_DATA is set.

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, criterion_group, criterion_main};
use echoloop_host::cloud::kdtree::KdTree;
use echoloop_host::cloud::{Cloud, normals, read_cloud, voxel};
use echoloop_host::pose::Pose;
use echoloop_host::registration::{Icp, IcpConfig, Registration, Source, Target, suggest};
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A floor 60 m wide, three walls and a box, seen from 1.8 m above the floor.
fn yard(seed: u64, world_from_sensor: &Pose) -> Cloud {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let patches = [
        (40_000, [-30.0, -30.0, -1.8], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0]),
        (10_000, [-30.0, 15.0, -1.8], [60.0, 0.0, 0.0], [0.0, 0.0, 8.0]),
        (10_000, [25.0, -30.0, -1.8], [3.0, 45.0, 0.0], [0.0, 0.0, 8.0]),
        (5000, [-25.0, -20.0, -1.8], [0.0, 30.0, 0.0], [0.0, 0.0, 8.0]),
        (5000, [-6.0, -5.0, -1.8], [4.0, 0.5, 0.0], [0.0, 0.0, 1.5]),
    ];
    let mut points = Vec::new();
    for (count, corner, a, b) in patches {
        let (corner, a, b) = (Point3::from(corner), Vector3::from(a), Vector3::from(b));
        points.extend((0..count).map(|_| {
            let point = corner + a * rng.random::<f64>() + b * rng.random::<f64>();
            world_from_sensor.inverse_transform_point(&point).cast()
        }));
    }
    Cloud::new(points)
}

fn stages(criterion: &mut Criterion, name: &str, target: &Cloud, source: &Cloud) {
    let config = IcpConfig::outdoor();
    let Ok(thin) = voxel::downsample(target, config.voxel_m) else {
        return;
    };
    let tree = KdTree::new(&thin.points);
    let (Ok(icp), Ok(coarse)) = (Icp::new(config), Icp::new(suggest(target, source))) else {
        return;
    };
    let (Ok(to), Ok(from)) = (Target::prepare(target, &config), Source::prepare(source, &config)) else {
        return;
    };
    let start = Pose::identity();
    println!("{name}: {} points become {}, source {}", target.points.len(), to.len(), from.len());
    criterion.bench_function(&format!("voxel/{name}"), |b| b.iter(|| voxel::downsample(black_box(target), 0.3)));
    criterion.bench_function(&format!("tree/{name}"), |b| b.iter(|| KdTree::new(black_box(&thin.points))));
    criterion.bench_function(&format!("normals/{name}"), |b| {
        b.iter(|| normals::of_tree(black_box(&tree), config.normal_radius_m, config.normal_neighbours));
    });
    criterion.bench_function(&format!("icp/{name}"), |b| b.iter(|| icp.align(black_box(&to), &from, &start)));
    criterion.bench_function(&format!("register/{name}"), |b| {
        b.iter(|| icp.register(black_box(target), source, &start));
    });
    criterion.bench_function(&format!("register_suggested/{name}"), |b| {
        b.iter(|| coarse.register(black_box(target), source, &start));
    });
}

fn registration(criterion: &mut Criterion) {
    // Fails only when a pool exists already; then the figures are for that one.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).build_global();
    let motion = Pose::new(Vector3::new(0.4, 0.2, 0.0), Vector3::new(0.0, 0.0, 0.02));
    stages(criterion, "synthetic/70k", &yard(1, &Pose::identity()), &yard(2, &motion));
    let Some(data) = std::env::var_os("ECHOLOOP_DATA").map(PathBuf::from) else {
        eprintln!("skipped: ECHOLOOP_DATA is unset, so no real pair is timed");
        return;
    };
    let read = |file: &str| read_cloud(&data.join("pair_small_gicp").join(file));
    match (read("target.ply"), read("source.ply")) {
        (Ok((target, _)), Ok((source, _))) => stages(criterion, "small_gicp/70k", &target, &source),
        (Err(error), _) | (_, Err(error)) => eprintln!("skipped: {error}"),
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30);
    targets = registration
}
criterion_main!(benches);
