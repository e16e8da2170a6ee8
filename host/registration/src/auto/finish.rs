//! The last centimetre of a registration.

use echoloop_clouds::{Cloud, Pose};
use nalgebra::{Matrix6, Translation3, UnitQuaternion, Vector6};

use super::Clouds;
use crate::covariance::error;
use crate::overlap::{is_within, settled};
use crate::prepared::{Surface, thin};
use crate::{
    Covariance, Gicp, GicpConfig, Icp, IcpConfig, Outcome, PrepareError, Source, StopReason, Target,
};

/// Number of points above which the finest voxels grow: more cost time, and the error is below a
/// millimetre.
const MOST_POINTS: f64 = 100_000.0;

/// Number of neighbours of a normal in the finest fit.
const FINE_NEIGHBOURS: usize = 22;

/// Fits are estimates of one motion if they differ by less than this: a shift, in voxels of the
/// coarsest, …
const ALIKE_VOXELS: f64 = 1.5;

/// … and a turn, rad.
const ALIKE_RAD: f64 = 0.05;

/// Local fits at three voxels, each from the end of the coarser, and their mean.
///
/// No method and no voxel is the best on every sensor: of 16 rings GICP's error is twice that of
/// ICP, of 128 rings it is the smaller one. But each fit has a covariance, and the mean weighs by
/// it ([`mean`]). The finest is ICP, the others are GICP: one, where their voxels are the same, as
/// in rooms.
pub(super) struct Finish {
    coarse: Fit,
    /// The coarser first.
    finer: Vec<Fit>,
    /// Edge of the coarsest voxels, m.
    voxel_m: f64,
}

type Fit = Box<dyn Fn(&Pose) -> Outcome + Send + Sync>;

impl Finish {
    /// Prepares both clouds for motions whose error is a part of `global_voxel_m`.
    pub(super) fn new(clouds: &Clouds, global_voxel_m: f64) -> Result<Self, StopReason> {
        let (target, source) = (clouds.target.cloud(), clouds.source.cloud());
        let mut configs = clouds.suggestions.finish(global_voxel_m, 0.0);
        let excess = target.points.len().max(source.points.len()) as f64 / MOST_POINTS;
        if excess > 1.0 {
            let least_m = (configs[2].voxel_m * excess.sqrt()).min(global_voxel_m);
            configs = clouds.suggestions.finish(global_voxel_m, least_m);
        }
        let [coarse, middle, fine] = configs;
        let finest = match fine.voxel_m == clouds.voxel_m {
            true => [clouds.target.thin.clone(), clouds.source.thin.clone()],
            false => {
                let thin = |cloud| thin(cloud, fine.voxel_m);
                rayon::join(|| thin(target), || thin(source)).into()
            }
        };
        let fine = IcpConfig { normal_neighbours: FINE_NEIGHBOURS, ..fine };
        let gicp = |config| gicp(target, source, GicpConfig::from(config));
        let has_middle = middle.voxel_m < coarse.voxel_m;
        let (first, (second, third)) = rayon::join(
            || gicp(&coarse),
            || rayon::join(|| has_middle.then(|| gicp(&middle)), || icp(finest, fine)),
        );
        let finer = second.into_iter().chain([third]).collect::<Result<_, _>>()?;
        Ok(Self { coarse: first?, finer, voxel_m: coarse.voxel_m })
    }

    /// The mean of the fits from a start that converge, each from the end of the last of them. The
    /// coarsest alone where none does, where it leaves a direction open, and where it finds no
    /// motion.
    pub(super) fn from(&self, start: &Pose, unit_m: f32) -> Outcome {
        let first = (self.coarse)(start);
        if !is_found(&first) {
            return first;
        }
        let mut iterations = first.iterations;
        let mut kept: Vec<Outcome> = Vec::new();
        kept.extend(first.stop.is_success().then(|| first.clone()));
        for fit in &self.finer {
            let next = fit(&kept.last().unwrap_or(&first).target_from_source);
            iterations += next.iterations;
            let is_alike = |one: &Outcome| {
                let [one, other] = [one, &next].map(|fit| &fit.target_from_source);
                is_within(one, other, ALIKE_VOXELS * self.voxel_m, ALIKE_RAD)
            };
            if next.stop.is_success() && is_found(&next) && kept.iter().all(is_alike) {
                kept.push(next);
            }
        }
        match mean(&kept) {
            Some(mean) => Outcome { iterations, ..mean },
            None => settled(first, unit_m, |from| (self.coarse)(from)),
        }
    }
}

fn gicp(target: &Cloud, source: &Cloud, config: GicpConfig) -> Result<Fit, StopReason> {
    let gicp = Gicp::new(config).map_err(|_| StopReason::BadSettings)?;
    let surface = sharing_normals(&config);
    let prepare = |cloud| Target::prepare(cloud, surface);
    let clouds = rayon::join(|| prepare(target), || prepare(source));
    Ok(fit(clouds, move |target, source, start| gicp.align(target, source, start)))
}

/// Of clouds that are as thin as it takes them, in the order of a tree.
fn icp(
    [target, source]: [Result<Cloud, PrepareError>; 2],
    config: IcpConfig,
) -> Result<Fit, StopReason> {
    let icp = Icp::new(config).map_err(|_| StopReason::BadSettings)?;
    let surface = sharing_normals(&config);
    let clouds = rayon::join(
        || target.map(|cloud| Target::of_thinned(cloud, &surface).0),
        || source.map(|cloud| Source::of_thinned(cloud, &surface)),
    );
    Ok(fit(clouds, move |target, source, start| icp.align(target, source, start)))
}

/// The fits' errors are as small as with a normal for each point.
fn sharing_normals(config: impl Into<Surface>) -> Surface {
    Surface { shares_normals: true, ..config.into() }
}

/// A method with both clouds as it takes them.
fn fit<S: Send + Sync + 'static>(
    (target, source): (Result<Target, PrepareError>, Result<S, PrepareError>),
    align: impl Fn(&Target, &S, &Pose) -> Outcome + Send + Sync + 'static,
) -> Fit {
    Box::new(move |start| {
        let (target, source) = (target.as_ref().map_err(|e| *e), source.as_ref().map_err(|e| *e));
        Outcome::of_prepared(target, source, start, |target, source| align(target, source, start))
    })
}

/// True when a fit ended at a motion that it determines in all directions.
fn is_found(fit: &Outcome) -> bool {
    use StopReason::{Converged, MaxIterations};
    matches!(fit.stop, Converged | MaxIterations) && fit.covariance.is_some()
}

/// The mean of some fits of one motion, by covariance intersection (Julier and Uhlmann, "A
/// non-divergent estimation algorithm in the presence of unknown correlations", 1997) with equal
/// weights: fits of the same clouds share errors, so three do not tell more than their mean does.
/// None without a fit whose covariance can be inverted.
///
/// ```text
/// C⁻¹ = Σ Cᵢ⁻¹ / n      ξ = C Σ Cᵢ⁻¹ ξᵢ / n      Tᵢ = exp(ξᵢ) T, T the last
/// ```
///
/// The rest is the last fit's, the finest.
fn mean(fits: &[Outcome]) -> Option<Outcome> {
    let last = fits.last()?;
    let about = last.target_from_source;
    let known = |fit: &Outcome| {
        let inverse = fit.covariance?.0.cholesky()?.inverse();
        Some((inverse, inverse * error(&about, &fit.target_from_source)))
    };
    let known: Vec<(Matrix6<f64>, Vector6<f64>)> = fits.iter().filter_map(known).collect();
    let share = 1.0 / known.len().max(1) as f64;
    let information = known.iter().map(|(inverse, _)| inverse * share).sum::<Matrix6<f64>>();
    let right = known.iter().map(|(_, right)| right * share).sum::<Vector6<f64>>();
    let covariance = information.cholesky()?.inverse();
    let moved = covariance * right;
    let turn = UnitQuaternion::from_scaled_axis(moved.fixed_rows::<3>(0).into_owned());
    let shift = Translation3::from(moved.fixed_rows::<3>(3).into_owned());
    Some(Outcome {
        target_from_source: Pose::from_parts(shift, turn) * about,
        covariance: Some(Covariance(covariance)),
        ..last.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fit that ended at `shift_m`, with these standard deviations.
    fn fit(shift_m: [f64; 3], sd_m: [f64; 3], stop: StopReason) -> Outcome {
        let [x, y, z] = sd_m;
        let sds = Vector6::new(1e-3, 1e-3, 1e-3, x, y, z);
        let [dx, dy, dz] = shift_m;
        Outcome {
            covariance: Some(Covariance(Matrix6::from_diagonal(&sds.component_mul(&sds)))),
            iterations: 3,
            ..Outcome::nothing(&Pose::translation(dx, dy, dz), stop)
        }
    }

    fn finished(fits: [Outcome; 3]) -> Outcome {
        let fits = fits.map(|end| Box::new(move |_: &Pose| end.clone()) as Fit);
        finish(fits).from(&Pose::identity(), 1.0)
    }

    fn finish([coarse, middle, fine]: [Fit; 3]) -> Finish {
        Finish { coarse, finer: vec![middle, fine], voxel_m: 0.3 }
    }

    #[test]
    fn a_room_has_one_fit_less_since_its_coarser_voxels_are_the_same() {
        for (step_m, finer) in [(0.1, 1), (0.5, 2)] {
            let at = |i: i16| [f32::from(i % 100 - 50), f32::from(i / 100 - 50), -10.0];
            let points = (0..10_000).map(|i| at(i).map(|v| v * step_m).into());
            let floor = Cloud::new(points.collect());
            let finish = Finish::new(&Clouds::new(&floor, &floor, 1.0), 1.0);
            assert_eq!(finish.map(|finish| finish.finer.len()), Ok(finer), "{step_m}");
        }
    }

    #[test]
    fn along_each_axis_the_fit_counts_that_is_the_surest() {
        use StopReason::Converged;
        let both = mean(&[
            fit([5.0, 0.0, 0.1], [0.001, 0.1, 0.01], Converged),
            fit([5.2, 0.1, 0.3], [0.1, 0.001, 0.01], Converged),
        ]);
        let both = both.expect("covariances that can be inverted");
        let found = both.target_from_source.translation.vector;
        assert!((found - nalgebra::Vector3::new(5.0, 0.1, 0.2)).norm() < 1e-3, "{found}");
    }

    #[test]
    fn fits_that_share_their_clouds_are_no_surer_together() {
        let one = || fit([1.0, 2.0, 3.0], [0.01, 0.02, 0.03], StopReason::Converged);
        let same = mean(&[one(), one(), one()]);
        let sds =
            same.and_then(|same| same.covariance).map(|covariance| covariance.translation_sd_m());
        let is_same = |sds: [f64; 3]| {
            sds.iter().zip([0.01, 0.02, 0.03]).all(|(sd, own)| (sd - own).abs() < 1e-9)
        };
        assert!(sds.is_some_and(is_same), "{sds:?}");
    }

    #[test]
    fn a_fit_that_did_not_converge_or_is_elsewhere_does_not_count() {
        use StopReason::{Converged, MaxIterations, TooFewPairs};
        let sure = [0.001; 3];
        let coarse = || fit([0.1, 0.0, 0.0], [0.02; 3], Converged);
        for odd in [
            fit([0.2, 0.0, 0.0], sure, MaxIterations),
            fit([0.2, 0.0, 0.0], sure, TooFewPairs),
            fit([3.0, 0.0, 0.0], sure, Converged),
        ] {
            let end = finished([coarse(), odd.clone(), coarse()]);
            assert!((end.target_from_source.translation.x - 0.1).abs() < 1e-9, "{odd:?}");
        }
        let lost = fit([0.2, 0.0, 0.0], sure, MaxIterations);
        let end = finished([lost.clone(), coarse(), coarse()]);
        assert!((end.target_from_source.translation.x - 0.1).abs() < 1e-9, "{end:?}");
        assert_eq!(finished([lost.clone(), lost.clone(), lost]).iterations, 6, "begun again");
    }

    #[test]
    fn a_fit_begins_where_the_last_one_that_converged_ended_or_the_first() {
        use StopReason::{Converged, MaxIterations};
        let moving = |by_m: f64, stop| -> Fit {
            Box::new(move |start: &Pose| {
                fit([start.translation.x + by_m, 0.0, 0.0], [0.01; 3], stop)
            })
        };
        let end_m = |fits: [Fit; 3]| {
            let end = finish(fits).from(&Pose::identity(), 1.0);
            (end.target_from_source.translation.x, end.iterations)
        };
        // The mean of 0.1, 0.12 and 0.13 m, of as sure fits.
        let all = [moving(0.1, Converged), moving(0.02, Converged), moving(0.01, Converged)];
        let (found_m, iterations) = end_m(all);
        assert!((found_m - 0.35 / 3.0).abs() < 1e-9 && iterations == 9, "{found_m}");
        // Of 0.12 and 0.13 m: the first ran out of iterations, and does not count.
        let lost = [moving(0.1, MaxIterations), moving(0.02, Converged), moving(0.01, Converged)];
        let (found_m, _) = end_m(lost);
        assert!((found_m - 0.125).abs() < 1e-9, "{found_m}");
    }

    #[test]
    fn where_the_coarsest_leaves_a_direction_open_the_others_do_not_close_it() {
        use StopReason::{Converged, Degenerate};
        let open = fit([0.1, 0.0, 0.0], [5.0, 0.02, 0.02], Degenerate);
        let closed = || fit([0.3, 0.0, 0.0], [0.001; 3], Converged);
        let end = finished([open, closed(), closed()]);
        assert_eq!(end.stop, Degenerate);
        assert_eq!(end.target_from_source.translation.x, 0.1);
    }
}
