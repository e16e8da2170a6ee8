//! A yard to scan: a floor, two walls and a box.

use echoloop_clouds::Cloud;
use echoloop_clouds::Pose;
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Pose of the second scan in the frame of the first.
pub(crate) fn second_place() -> Pose {
    Pose::new(Vector3::new(0.5, -0.3, 0.05), Vector3::new(0.0, 0.01, 0.08))
}

/// Cloud of the yard from a sensor at `world_from_sensor`; each seed gives other points.
pub(crate) fn seen_from(seed: u64, world_from_sensor: &Pose) -> Cloud {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let patches = [
        (16_000, [-10.0, -10.0, -1.8], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0]),
        (4000, [-10.0, 10.0, -1.8], [20.0, 0.0, 0.0], [0.0, 0.0, 4.0]),
        (4000, [9.0, -10.0, -1.8], [1.0, 15.0, 0.0], [0.0, 0.0, 4.0]),
        (1000, [-6.0, -5.0, -1.8], [3.0, 0.5, 0.0], [0.0, 0.0, 1.5]),
    ];
    let mut points = Vec::new();
    for (count, corner, a, b) in patches {
        let (corner, a, b) = (Point3::from(corner), Vector3::from(a), Vector3::from(b));
        points.extend((0..count).map(|_| {
            let point = corner + a * rng.random::<f64>() + b * rng.random::<f64>();
            world_from_sensor.inverse_transform_point(&point).cast::<f32>()
        }));
    }
    Cloud::new(points)
}
