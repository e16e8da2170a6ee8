//! A registration method of one's own: start here.
//!
//! ```sh
//! cargo run --release -p echoloop-examples --example own_method   # two generated yards
//! cargo run --release -p echoloop-examples --example own_method -- target.ply source.ply
//! ```
//!
//! A method is a type that implements [`Registration`]: it gets two clouds and an initial pose, and
//! returns an [`Outcome`] with the pose and the reason to stop. Another method can refine its
//! result ([`Refined`]). Add it to the table of `host/registration/src/tests.rs`, which tries it on
//! known motions, both directions, several starts and every bad cloud we know of.

use std::error::Error;
use std::path::Path;

use echoloop_clouds::pose::{Pose, rotation_error_deg, translation_error_m};
use echoloop_clouds::{Cloud, read_cloud};
use echoloop_registration::geometry::kdtree::KdTree;
use echoloop_registration::geometry::voxel;
use echoloop_registration::refine::Refined;
use echoloop_registration::{Icp, Outcome, Registration, StopReason, suggest};
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

#[path = "common/yard.rs"]
mod yard;

/// Point-to-point ICP (Besl and McKay 1992): pairs nearest points, aligns the pairs, repeats.
struct PointToPoint {
    voxel_m: f64,
    max_pair_distance_m: f64,
    max_iterations: usize,
}

impl Registration for PointToPoint {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let thin = |cloud| voxel::downsample(cloud, self.voxel_m);
        let (Ok(target), Ok(source)) = (thin(target), thin(source)) else {
            return Outcome::nothing(initial, StopReason::BadSettings);
        };
        let tree = KdTree::new(&target.points);
        let mut outcome = Outcome::nothing(initial, StopReason::MaxIterations);
        while outcome.iterations < self.max_iterations {
            let moved =
                source.points.iter().map(|point| outcome.target_from_source * point.cast::<f64>());
            let pairs: Vec<_> = moved.filter_map(|s| Some((s, self.nearest(&tree, &s)?))).collect();
            let Some(step) = least_squares(&pairs) else {
                return Outcome::nothing(initial, StopReason::TooFewPairs);
            };
            outcome.target_from_source = step * outcome.target_from_source;
            outcome.iterations += 1;
            outcome.pairs = pairs.len();
            outcome.inlier_fraction = pairs.len() as f64 / source.points.len() as f64;
            let squares: f64 = pairs.iter().map(|(s, q)| (s - q).norm_squared()).sum();
            outcome.rmse_m = (squares / pairs.len() as f64).sqrt();
            if step.translation.vector.norm() < 1e-3 && step.rotation.angle() < 1e-4 {
                outcome.stop = StopReason::Converged;
                break;
            }
        }
        outcome
    }
}

impl PointToPoint {
    fn nearest(&self, tree: &KdTree, point: &Point3<f64>) -> Option<Point3<f64>> {
        let index = tree.nearest(&point.cast(), self.max_pair_distance_m as f32)?;
        Some(tree.points()[index as usize].cast())
    }
}

/// The motion with the least Σ |T s - q|²: Arun, Huang and Blostein 1987.
fn least_squares(pairs: &[(Point3<f64>, Point3<f64>)]) -> Option<Pose> {
    let n = (pairs.len() >= 3).then_some(pairs.len() as f64)?;
    let s_mean = pairs.iter().map(|(s, _)| s.coords).sum::<Vector3<f64>>() / n;
    let q_mean = pairs.iter().map(|(_, q)| q.coords).sum::<Vector3<f64>>() / n;
    let h: Matrix3<f64> =
        pairs.iter().map(|(s, q)| (q.coords - q_mean) * (s.coords - s_mean).transpose()).sum();
    let svd = h.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mirrored =
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * mirrored * v_t));
    Some(Pose::from_parts(Translation3::from(q_mean - rotation * s_mean), rotation))
}

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let (target, source, truth) = match &files[..] {
        [target, source] => {
            (read_cloud(Path::new(target))?.0, read_cloud(Path::new(source))?.0, None)
        }
        [] => {
            let truth = yard::second_place();
            (yard::seen_from(1, &Pose::identity()), yard::seen_from(2, &truth), Some(truth))
        }
        _ => return Err("usage: own_method [TARGET SOURCE]".into()),
    };
    let own = PointToPoint { voxel_m: 0.3, max_pair_distance_m: 1.0, max_iterations: 50 };
    let alone = own.register(&target, &source, &Pose::identity());
    let refined = Refined { global: own, local: Icp::new(suggest(&target, &source))? };
    let finished = refined.register(&target, &source, &Pose::identity());
    for (name, outcome) in [("own", alone), ("own, then ICP", finished)] {
        println!("{name}: {}, {} steps, {} pairs", outcome.stop, outcome.iterations, outcome.pairs);
        println!("{:.5}", outcome.target_from_source.to_homogeneous());
        if let Some(truth) = &truth {
            let found = &outcome.target_from_source;
            println!(
                "{:.4} m and {:.4}° from the truth",
                translation_error_m(found, truth),
                rotation_error_deg(found, truth)
            );
        }
    }
    Ok(())
}
