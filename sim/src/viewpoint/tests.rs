use super::*;
use crate::scene::{Mesh, SceneKind, generate};

fn places(pairs: &[PosePair]) -> Vec<[f64; 3]> {
    let both = |pair: &PosePair| [pair.world_from_first, pair.world_from_second];
    pairs.iter().flat_map(both).map(|pose| pose.translation.vector.into()).collect()
}

fn flat(a: [f64; 3], b: [f64; 3]) -> f64 {
    ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt()
}

#[test]
fn viewpoints_of_every_kind_stand_two_metres_above_open_ground() {
    for kind in SceneKind::ALL {
        for seed in [1, 2] {
            let scene = generate(kind, seed);
            let caster = Raycaster::new(&scene);
            let plan = PairPlan { count: 20, seed, split: Split::Test, ..PairPlan::default() };
            let pairs = sample_pairs(&scene, &caster, &plan).expect("viewpoints");
            assert_eq!(pairs.len(), 20);
            for place in places(&pairs) {
                let eye = place.map(|x| x as f32);
                let below = caster.cast(eye, [0.0, 0.0, -1.0]).expect("ground below");
                assert!((below.range_m - 2.0).abs() < 0.01, "{kind} {place:?}: {}", below.range_m);
                assert!(
                    caster.cast(eye, [0.0, 0.0, 1.0]).is_none(),
                    "{kind} {place:?} is under a roof"
                );
                let (low, high) = scene.area;
                assert!((0..2).all(|i| eye[i] > low[i] - 5.1 && eye[i] < high[i] + 5.1));
            }
        }
    }
}

#[test]
fn with_a_factor_baselines_lie_between_one_and_the_factor_times_the_least() {
    let scene = generate(SceneKind::Structured, 3);
    let caster = Raycaster::new(&scene);
    let plan = PairPlan { count: 20, baseline_m: 2.0, baseline_factor: 2.0, ..PairPlan::default() };
    let apart = |pair: &PosePair| {
        let [a, b] = [pair.world_from_first, pair.world_from_second];
        flat(a.translation.vector.into(), b.translation.vector.into())
    };
    let pairs = sample_pairs(&scene, &caster, &plan).expect("viewpoints");
    let all: Vec<f64> = pairs.iter().map(apart).collect();
    assert!(all.iter().all(|distance| (2.0..=4.0).contains(distance)), "{all:?}");
    assert!(all.iter().any(|d| *d < 2.7) && all.iter().any(|d| *d > 3.3), "{all:?}");
    // With `farther`, only the first pairs.
    let few = PairPlan { farther: 5, ..plan };
    let few = sample_pairs(&scene, &caster, &few).expect("viewpoints");
    assert_eq!(few[..5], pairs[..5]);
    assert!(few[5..].iter().map(apart).all(|distance| (distance - 2.0).abs() < 1e-9));
    let nearer = PairPlan { baseline_factor: 0.9, ..plan };
    let error = sample_pairs(&scene, &caster, &nearer).expect_err("below 1");
    assert_eq!(error.to_string(), "baseline_factor is 0.9, expected a factor of 1 or more");
}

#[test]
fn the_second_pose_is_a_baseline_away_and_turned_within_the_plan() {
    let scene = generate(SceneKind::Structured, 3);
    let caster = Raycaster::new(&scene);
    for baseline_m in [2.0, 5.0] {
        let plan = PairPlan { count: 10, baseline_m, ..PairPlan::default() };
        for pair in sample_pairs(&scene, &caster, &plan).expect("viewpoints") {
            let [a, b] = [pair.world_from_first, pair.world_from_second];
            let apart = flat(a.translation.vector.into(), b.translation.vector.into());
            assert!((apart - baseline_m).abs() < 1e-9);
            assert!(a.rotation.angle_to(&b.rotation).to_degrees() < 20.0 + 4.0 * 2.0);
            let up = a.rotation * nalgebra::Vector3::z();
            assert!(up.z > (3.0_f64).to_radians().cos());
        }
    }
}

/// A part for training has room for 24 m; farther pairs go from one part to the next.
#[test]
fn either_part_of_a_town_has_pairs_far_apart() {
    for (kind, baseline_m) in SceneKind::ALL.into_iter().zip([25.0, 40.0, 40.0]) {
        let scene = generate(kind, 1001);
        let caster = Raycaster::new(&scene);
        for split in [Split::Train, Split::Test] {
            let plan = PairPlan { count: 2, baseline_m, split, ..PairPlan::default() };
            let pairs = sample_pairs(&scene, &caster, &plan);
            assert_eq!(pairs.map(|pairs| pairs.len()), Ok(2), "{kind} {split:?}");
        }
    }
}

#[test]
fn training_and_test_viewpoints_are_ten_metres_apart() {
    for kind in SceneKind::ALL {
        let scene = generate(kind, 5);
        let caster = Raycaster::new(&scene);
        let plan = |count, split| PairPlan { count, split, ..PairPlan::default() };
        let train =
            places(&sample_pairs(&scene, &caster, &plan(10, Split::Train)).expect("training"));
        let test = places(&sample_pairs(&scene, &caster, &plan(100, Split::Test)).expect("test"));
        let nearest = train
            .iter()
            .flat_map(|a| test.iter().map(|b| flat(*a, *b)))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest >= 10.0, "{kind}: {nearest}");
    }
}

#[test]
fn small_places_are_split_with_a_smaller_gap() {
    let area = ([0.0; 2], [20.0; 2]);
    let [train, test] = [Split::Train, Split::Test].map(|split| Territory::new(area, split));
    assert!(train.gap_m() >= 2.0);
    let spots: Vec<[f64; 2]> =
        (0..400).map(|k| [f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5]).collect();
    let mut both = [0, 0];
    for p in &spots {
        both[0] += usize::from(train.owns(*p));
        both[1] += usize::from(test.owns(*p));
        for q in &spots {
            let apart = ((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1])).sqrt();
            assert!(!(train.owns(*p) && test.owns(*q)) || apart >= train.gap_m());
        }
    }
    assert!(both[0] > 10 && both[1] > 50, "{both:?}");
}

#[test]
fn the_same_seed_gives_the_same_pairs() {
    let scene = generate(SceneKind::Unstructured, 1);
    let caster = Raycaster::new(&scene);
    let plan = PairPlan::default();
    let once = sample_pairs(&scene, &caster, &plan).expect("viewpoints");
    assert_eq!(sample_pairs(&scene, &caster, &plan).expect("viewpoints"), once);
    let other = PairPlan { seed: 1, ..plan };
    assert_ne!(sample_pairs(&scene, &caster, &other).expect("viewpoints"), once);
}

#[test]
fn an_empty_plain_has_no_viable_viewpoint_and_says_why() {
    let mesh = Mesh {
        vertices: vec![[-500.0, -500.0, 0.0], [500.0, -500.0, 0.0], [0.0, 900.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        materials: vec![0],
    };
    let scene = Scene::new("plain", mesh, ([-50.0; 2], [50.0; 2]));
    let heard = std::cell::Cell::new(0);
    let progress = |found, tried| {
        assert_eq!((found, tried), (0, heard.get() + 1));
        heard.set(tried);
    };
    let caster = Raycaster::new(&scene);
    let error = sample_pairs_between(&scene, [&caster; 2], &PairPlan::default(), &Some, &progress)
        .expect_err("nothing to see");
    let ViewpointError::NoViewpoint { found: 0, rejected, attempts, .. } = &error else {
        panic!("{error}")
    };
    assert_eq!(*attempts, heard.get());
    assert!(rejected.structure > 0 && rejected.footing == 0);
    assert!(
        error.to_string().starts_with("plain has no viable viewpoint for pair 0 of 10"),
        "{error}"
    );
}

#[test]
fn a_senseless_plan_names_its_field() {
    let scene = generate(SceneKind::Structured, 1);
    let plan = PairPlan { baseline_m: f64::NAN, ..PairPlan::default() };
    let error = sample_pairs(&scene, &Raycaster::new(&scene), &plan).expect_err("no baseline");
    assert_eq!(error.to_string(), "baseline_m is NaN, expected a distance in metres");
}

fn mesh_scene(vertices: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Scene {
    let materials = vec![0; triangles.len()];
    let mesh = Mesh { vertices, triangles, materials };
    Scene::new("mesh", mesh, ([-12.0; 2], [12.0; 2]))
}

/// Square of ± `half` at a height, in cells of a metre.
fn sheet(half: i32, z: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = 2 * half as u32 + 1;
    let vertices =
        (-half..=half).flat_map(|y| (-half..=half).map(move |x| [x as f32, y as f32, z])).collect();
    let cell = |(x, y): (u32, u32)| {
        let at = y * side + x;
        [[at, at + 1, at + side + 1], [at, at + side + 1, at + side]]
    };
    let cells = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| (x, y)));
    (vertices, cells.flat_map(cell).collect())
}

/// Scene of two meshes.
fn both(
    (mut vertices, mut triangles): (Vec<[f32; 3]>, Vec<[u32; 3]>),
    (more, theirs): (Vec<[f32; 3]>, Vec<[u32; 3]>),
) -> Scene {
    let first = vertices.len() as u32;
    vertices.extend(more);
    triangles.extend(theirs.into_iter().map(|t| t.map(|v| v + first)));
    mesh_scene(vertices, triangles)
}

fn placed_in(scene: &Scene) -> (Standpoint, bool) {
    let caster = Raycaster::new(scene);
    let plan = PairPlan::default();
    sample_pairs(scene, &caster, &plan).expect_err("no pair fits");
    let standpoint = find_standpoint(scene, &caster, &plan).expect("a place for one");
    (standpoint, stands_off_ground(scene, &caster, &standpoint.world_from_sensor))
}

#[test]
fn a_single_sensor_stands_on_open_ground_without_structure_in_view() {
    let (vertices, triangles) = sheet(40, 0.5);
    let (standpoint, off_ground) = placed_in(&mesh_scene(vertices, triangles));
    assert_eq!(
        (standpoint.footing, standpoint.sees_enough, off_ground),
        (Footing::Open, false, false)
    );
    assert!((standpoint.world_from_sensor.translation.vector.z - 2.5).abs() < 1e-6);
}

#[test]
fn a_single_sensor_stands_on_the_ground_below_a_canopy_and_not_on_it() {
    let scene = both(sheet(40, 0.0), sheet(40, 4.0));
    let (standpoint, off_ground) = placed_in(&scene);
    assert_eq!((standpoint.footing, off_ground), (Footing::Covered, false));
    assert!((standpoint.world_from_sensor.translation.vector.z - 2.0).abs() < 1e-6);
    let above = Isometry3::translation(0.3, 0.4, 6.0);
    assert!(stands_off_ground(&scene, &Raycaster::new(&scene), &above), "on the canopy");
    // Under a canopy of 1.5 m no sensor fits: it stands on it, and is reported so.
    let (standpoint, off_ground) = placed_in(&both(sheet(40, 0.0), sheet(40, 1.5)));
    assert_eq!((standpoint.footing, off_ground), (Footing::Top, true));
}

#[test]
fn a_sensor_on_a_crown_without_ground_around_it_is_off_the_ground() {
    let (vertices, triangles) = sheet(4, 7.0);
    let (standpoint, off_ground) = placed_in(&mesh_scene(vertices, triangles));
    assert_eq!((standpoint.footing, off_ground), (Footing::Top, true));
    // A slab is ground, because its underside faces down.
    let (vertices, triangles) = sheet(40, -3.0);
    let under = triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect();
    let slab = both(sheet(40, 0.0), (vertices, under));
    let z = find_standpoint(&slab, &Raycaster::new(&slab), &PairPlan::default())
        .expect("a place")
        .world_from_sensor
        .translation
        .vector
        .z;
    assert!((z - 2.0).abs() < 1e-6, "{z}");
}

#[test]
fn a_speck_without_room_for_a_sensor_is_refused() {
    let speck = mesh_scene(vec![[0.0; 3], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]], vec![[0, 1, 2]]);
    let error = find_standpoint(&speck, &Raycaster::new(&speck), &PairPlan::default())
        .expect_err("nowhere")
        .to_string();
    assert!(error.starts_with("mesh has no place where a sensor could stand, after"), "{error}");
}

#[test]
fn sensors_stand_on_roads_where_there_are_some_and_face_along_them() {
    let mut scene = generate(SceneKind::Unstructured, 3);
    let line = |k: i32| Placement {
        at: [20.0 - 40.0 * f64::from(k.rem_euclid(2)), f64::from(k), 0.0],
        heading_rad: std::f64::consts::FRAC_PI_2,
    };
    scene.roads = (-60..60).map(line).collect();
    let plan = PairPlan { count: 5, heading_range_deg: 20.0, ..PairPlan::default() };
    for pair in sample_pairs(&scene, &Raycaster::new(&scene), &plan).expect("pairs on two lines") {
        let from_first = pair.world_from_first;
        assert!((from_first.translation.x.abs() - 20.0).abs() <= 0.5, "{from_first}");
        let ahead = from_first.rotation * nalgebra::Vector3::x();
        assert!(ahead.y > 0.99, "{ahead}");
    }
}
