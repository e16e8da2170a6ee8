use super::*;
use crate::scene::{MATERIALS, Mesh, SceneKind, generate};

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
    let scene = Scene {
        name: "plain".into(),
        mesh,
        materials: MATERIALS.to_vec(),
        area: ([-50.0; 2], [50.0; 2]),
    };
    let heard = std::cell::Cell::new(0);
    let progress = |found, tried| {
        assert_eq!((found, tried), (0, heard.get() + 1));
        heard.set(tried);
    };
    let caster = Raycaster::new(&scene);
    let error = sample_pairs_aloud(&scene, &caster, &PairPlan::default(), &progress)
        .expect_err("nothing to see");
    let ViewpointError::NoViewpoint { found: 0, rejected, attempts, .. } = &error else {
        panic!("{error}")
    };
    assert_eq!(*attempts, heard.get()); // a large place is not silent
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
    assert_eq!(error.to_string(), "baseline_m is NaN, which is no distance in metres");
}
