//! CPU time of ray casting on one thread: Mray/s in the default scenes, along the default scanner's
//! beams of 25 sub-rays, from viewpoints of pairs.
//!
//! `KIND-SEED/beams` casts the rays of a scan, `/alone` the same rays one by one, `/obvhs` with the
//! library alone: its medium build, its traversal and its triangle test. `/build` builds the
//! hierarchy, and `/scan` makes a whole scan, in beams per second.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use echoloop_benches::cpu::{CpuTime, on_one_thread};
use echoloop_closed_loop::config::RunConfig;
use echoloop_sim::raycast::Raycaster;
use echoloop_sim::scanner::{self, BeamOptics, sub_rays};
use echoloop_sim::scene::{Mesh, Scene, SceneKind, generate};
use echoloop_sim::viewpoint::{PairPlan, Split, sample_pairs};
use nalgebra::Isometry3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

/// A viewpoint in a scene.
fn viewpoint(scene: &Scene, caster: &Raycaster, seed: u64) -> Option<Isometry3<f64>> {
    let config = RunConfig::default();
    let plan = PairPlan {
        count: 1,
        baseline_m: config.data.baseline_m,
        heading_range_deg: config.data.heading_range_deg,
        tilt_range_deg: config.data.tilt_range_deg,
        height_m: config.scanner.height_m,
        seed,
        split: Split::Test,
        ..PairPlan::default()
    };
    Some(sample_pairs(scene, caster, &plan).ok()?.first()?.world_from_first)
}

/// Ray casting with the library alone.
struct Plain {
    bvh: Bvh2,
    triangles: Vec<Triangle>,
}

impl Plain {
    fn new(mesh: &Mesh) -> Self {
        let triangle = |t: usize| {
            let [v0, v1, v2] = mesh.corners(t).map(Into::into);
            Triangle { v0, v1, v2 }
        };
        let triangles: Vec<Triangle> = (0..mesh.triangles.len()).map(triangle).collect();
        let build = BvhBuildParams::medium_build();
        let bvh = build_bvh2_from_tris(&triangles, build, &mut Duration::default());
        let ordered = bvh.primitive_indices.iter().map(|&t| triangles[t as usize]).collect();
        Self { bvh, triangles: ordered }
    }

    fn meets(&self, origin: [f32; 3], direction: [f32; 3]) -> bool {
        let (ray, mut hit) = (Ray::new_inf(origin.into(), direction.into()), RayHit::none());
        self.bvh.ray_traverse(ray, &mut hit, |ray, slot| self.triangles[slot].intersect(ray))
    }
}

fn town(criterion: &mut Criterion<CpuTime>, kind: SceneKind, seed: u64) {
    let scene = generate(kind, seed);
    let caster = Raycaster::new(&scene);
    let Some(pose) = viewpoint(&scene, &caster, seed) else {
        return eprintln!("skipped: nowhere to stand in {kind:?} {seed}");
    };
    let config = RunConfig::default();
    let beams = config.scanner.beams();
    let directions: Vec<[f32; 3]> = beams.directions(1).iter().map(|&d| d.into()).collect();
    let optics = BeamOptics {
        divergence_mrad: config.receiver.divergence_mrad,
        subrays: config.receiver.subrays,
        mirrors: false,
        cats_eye_m2: 0.0,
    };
    let origin: [f32; 3] = pose.translation.vector.cast::<f32>().into();
    let rays: Vec<Vec<[f32; 3]>> =
        directions.iter().map(|direction| sub_rays(direction, &optics, &pose)).collect();
    let count = rays.iter().map(Vec::len).sum::<usize>() as u64;

    let mut group = criterion.benchmark_group(scene.name.clone());
    group.throughput(Throughput::Elements(count));
    group.bench_function("beams", |b| {
        let hits = |beam: &Vec<_>| caster.cast_beam(origin, beam).iter().flatten().count();
        b.iter(|| black_box(&rays).iter().map(hits).sum::<usize>());
    });
    group.bench_function("alone", |b| {
        let hit = |&&ray: &&[f32; 3]| caster.cast(origin, ray).is_some();
        b.iter(|| black_box(&rays).iter().flatten().filter(hit).count());
    });
    let plain = Plain::new(&scene.mesh);
    group.bench_function("obvhs", |b| {
        let hit = |&&ray: &&[f32; 3]| plain.meets(origin, ray);
        b.iter(|| black_box(&rays).iter().flatten().filter(hit).count());
    });
    group.throughput(Throughput::Elements(scene.mesh.triangles.len() as u64));
    group.bench_function("build", |b| b.iter(|| Raycaster::new(black_box(&scene))));
    group.throughput(Throughput::Elements(directions.len() as u64));
    group.bench_function("scan", |b| {
        b.iter(|| scanner::scan(&caster, &scene.materials, &pose, black_box(&directions), &optics));
    });
}

fn towns(criterion: &mut Criterion<CpuTime>) {
    for kind in [SceneKind::Structured, SceneKind::SemiStructured, SceneKind::Unstructured] {
        for seed in [1, 7, 51] {
            town(criterion, kind, seed);
        }
    }
}

criterion_group! {
    name = benches;
    config = on_one_thread(10);
    targets = towns
}
criterion_main!(benches);
