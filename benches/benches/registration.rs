//! CPU time of each stage of a registration on one thread, in ms per cloud or pair.
//!
//! `synthetic/70k` is a randomly sampled yard; with ECHOLOOP_DATA set, `small_gicp/70k` and
//! `carla/71k` are the pairs of those names. `icp` and `gicp` align prepared clouds, as
//! small_gicp's `align` does; `register` goes from points to motion.

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, criterion_group, criterion_main};
use echoloop_benches::cpu::{CpuTime, on_one_thread};
use echoloop_clouds::Pose;
use echoloop_clouds::{Cloud, read_cloud};
use echoloop_registration::geometry::{normals, voxel};
use echoloop_registration::{
    Gicp, GicpConfig, Icp, IcpConfig, Registration, Source, Target, suggest,
};
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

/// Stages shared by both methods.
fn preparation(criterion: &mut Criterion<CpuTime>, name: &str, target: &Cloud) {
    let config = IcpConfig::outdoor();
    let Ok(thin) = voxel::downsample(target, config.voxel_m) else {
        return;
    };
    criterion.bench_function(&format!("voxel/{name}"), |b| {
        b.iter(|| voxel::downsample(black_box(target), 0.3))
    });
    criterion.bench_function(&format!("normals/{name}"), |b| {
        b.iter(|| {
            normals::from_points(
                black_box(&thin.points),
                config.normal_radius_m,
                config.normal_neighbours,
            )
        });
    });
    criterion.bench_function(&format!("target/{name}"), |b| {
        b.iter(|| Target::prepare(black_box(target), &config))
    });
    criterion.bench_function(&format!("source/{name}"), |b| {
        b.iter(|| Source::prepare(black_box(target), &config))
    });
}

fn alignment(criterion: &mut Criterion<CpuTime>, name: &str, target: &Cloud, source: &Cloud) {
    let (config, gicp_config) = (IcpConfig::outdoor(), GicpConfig::outdoor());
    let (Ok(icp), Ok(gicp)) = (Icp::new(config), Gicp::new(gicp_config)) else {
        return;
    };
    let (Ok(to), Ok(from)) = (Target::prepare(target, &config), Source::prepare(source, &config))
    else {
        return;
    };
    let (Ok(to_surface), Ok(surface)) =
        (Target::prepare(target, &gicp_config), Target::prepare(source, &gicp_config))
    else {
        return;
    };
    let start = Pose::identity();
    println!("{name}: {} points become {}, source {}", target.points.len(), to.len(), from.len());
    criterion.bench_function(&format!("icp/{name}"), |b| {
        b.iter(|| icp.align(black_box(&to), &from, &start))
    });
    criterion.bench_function(&format!("gicp/{name}"), |b| {
        b.iter(|| gicp.align(black_box(&to_surface), &surface, &start));
    });
    criterion.bench_function(&format!("register/{name}"), |b| {
        b.iter(|| icp.register(black_box(target), source, &start));
    });
}

fn suggested(criterion: &mut Criterion<CpuTime>, name: &str, target: &Cloud, source: &Cloud) {
    let start = Pose::identity();
    let (Ok(icp), Ok(gicp)) =
        (Icp::new(suggest(target, source)), Gicp::new(GicpConfig::from(&suggest(target, source))))
    else {
        return;
    };
    criterion.bench_function(&format!("register_suggested/{name}"), |b| {
        b.iter(|| icp.register(black_box(target), source, &start));
    });
    criterion.bench_function(&format!("register_suggested_gicp/{name}"), |b| {
        b.iter(|| gicp.register(black_box(target), source, &start));
    });
}

fn stages(criterion: &mut Criterion<CpuTime>, name: &str, target: &Cloud, source: &Cloud) {
    preparation(criterion, name, target);
    alignment(criterion, name, target, source);
    suggested(criterion, name, target, source);
}

fn registration(criterion: &mut Criterion<CpuTime>) {
    let motion = Pose::new(Vector3::new(0.4, 0.2, 0.0), Vector3::new(0.0, 0.0, 0.02));
    stages(criterion, "synthetic/70k", &yard(1, &Pose::identity()), &yard(2, &motion));
    let Some(data) = std::env::var_os("ECHOLOOP_DATA").map(PathBuf::from) else {
        eprintln!("skipped: ECHOLOOP_DATA is unset, so no real pair is timed");
        return;
    };
    let pairs = [
        ("small_gicp/70k", "pair_small_gicp/target.ply", "pair_small_gicp/source.ply"),
        ("carla/71k", "pairs_carla/scan_4188.ply", "pairs_carla/scan_4255.ply"),
    ];
    for (name, target, source) in pairs {
        match (read_cloud(&data.join(target)), read_cloud(&data.join(source))) {
            (Ok((target, _)), Ok((source, _))) => stages(criterion, name, &target, &source),
            (Err(error), _) | (_, Err(error)) => eprintln!("skipped: {error}"),
        }
    }
}

criterion_group! {
    name = benches;
    config = on_one_thread(30);
    targets = registration
}
criterion_main!(benches);
