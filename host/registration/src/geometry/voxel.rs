//! Voxel downsampling: one point per voxel.

use echoloop_clouds::{Cloud, is_finite};
use echoloop_dispatch::dispatch;
use nalgebra::{Point3, Vector3};

/// Reason why a cloud cannot be downsampled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum VoxelError {
    /// The edge is not a positive number.
    #[error("a voxel of {0} m is not larger than 0")]
    Size(f64),
    /// The cells of the box around the cloud do not fit 64 bits.
    #[error("a voxel of {voxel_m} m is too small for a cloud {extent_m:.0} m wide")]
    TooSmall {
        /// The edge, m.
        voxel_m: f64,
        /// The longest side of the box around the cloud, m.
        extent_m: f64,
    },
}

/// Replaces the points of each voxel by their mean. Its σ_R assumes independent errors of the
/// points. Normals are dropped: estimate them anew.
///
/// ```text
/// cell = ⌊p / voxel⌋ per axis, in f64      mean = Σ p / n, in f64, in the order of the input
/// σ = √(Σ σ²) / n
/// ```
///
/// The grid starts at the frame's origin, so that equal settings cut each scan alike (Open3D starts
/// half a voxel below the least point). The output is ordered by cell, x fastest: the same input
/// gives the same bytes, and another order of the input the same points up to rounding. Non-finite
/// points are skipped.
///
/// # Errors
///
/// [`VoxelError`] when the edge is not positive, or so small that 64 bits cannot number the cells.
pub fn downsample(cloud: &Cloud, voxel_m: f64) -> Result<Cloud, VoxelError> {
    means(cloud, voxel_m, [0.0; 3], mean_sd)
}

/// [`downsample`] with the largest σ_R of each voxel's points: errors that they share, as of
/// saturated echoes, are no smaller in the mean.
pub fn downsample_to_largest_sd(cloud: &Cloud, voxel_m: f64) -> Result<Cloud, VoxelError> {
    means(cloud, voxel_m, [0.0; 3], largest_sd)
}

/// [`downsample`] on Open3D's grid, which starts half a voxel below the least coordinates.
pub fn downsample_open3d(cloud: &Cloud, voxel_m: f64) -> Result<Cloud, VoxelError> {
    let finite = cloud.points.iter().filter(|p| is_finite(p));
    let least = finite.fold([f64::INFINITY; 3], |least, p| {
        [0, 1, 2].map(|axis| least[axis].min(f64::from(p[axis])))
    });
    let start = least.map(|v| if v.is_finite() { v - 0.5 * voxel_m } else { 0.0 });
    means(cloud, voxel_m, start, mean_sd)
}

fn means(
    cloud: &Cloud,
    voxel_m: f64,
    start_m: [f64; 3],
    sd_of: fn(&[f32], &[Run]) -> f32,
) -> Result<Cloud, VoxelError> {
    if !(voxel_m > 0.0 && voxel_m.is_finite()) {
        return Err(VoxelError::Size(voxel_m));
    }
    let points = &cloud.points;
    let Some(grid) = VoxelGrid::around(points, voxel_m, start_m)? else {
        return Ok(Cloud::new(Vec::new()));
    };
    let sorted = sort_by_key(runs_of(&grid, points), grid.last_key);
    let cells = || sorted.chunk_by(|a, b| a.key == b.key);
    let mut means = Cloud::new(cells().map(|cell| mean(points, cell)).collect());
    means.range_sd_m =
        cloud.range_sd_m.as_ref().map(|sds| cells().map(|cell| sd_of(sds, cell)).collect());
    Ok(means)
}

/// Points that follow each other in the input and lie in one cell: scanners write neighbours one
/// after the other, so there are far fewer runs than points to be sorted.
#[derive(Clone, Copy, Default)]
struct Run {
    key: u64,
    first: u32,
    points: u32,
}

impl Run {
    /// The values of its points; none beyond the end of the list.
    fn of<T>(self, all: &[T]) -> &[T] {
        all.get(self.first as usize..)
            .unwrap_or_default()
            .get(..self.points as usize)
            .unwrap_or_default()
    }
}

fn points_in(cell: &[Run]) -> f64 {
    f64::from(cell.iter().map(|run| run.points).sum::<u32>())
}

fn mean(points: &[Point3<f32>], cell: &[Run]) -> Point3<f32> {
    let sum: Vector3<f64> =
        cell.iter().flat_map(|run| run.of(points)).map(|point| point.coords.cast::<f64>()).sum();
    (sum / points_in(cell)).cast::<f32>().into()
}

/// Standard deviation of a mean, from those of its values.
fn mean_sd(sds: &[f32], cell: &[Run]) -> f32 {
    let of_cell = cell.iter().flat_map(|run| run.of(sds));
    let sum: f64 = of_cell.map(|sd| f64::from(*sd) * f64::from(*sd)).sum();
    (sum.sqrt() / points_in(cell)) as f32
}

fn largest_sd(sds: &[f32], cell: &[Run]) -> f32 {
    cell.iter().flat_map(|run| run.of(sds)).copied().fold(f32::NAN, f32::max)
}

/// Numbers the cells of the box around a cloud, x fastest.
struct VoxelGrid {
    voxels_per_m: f64,
    /// Corner of cell 0.
    start_m: [f64; 3],
    /// Lowest cell of each axis.
    first: [f64; 3],
    /// Difference of the numbers of neighbouring cells along each axis.
    stride: [u64; 3],
    last_key: u64,
}

impl VoxelGrid {
    /// A grid around the finite points; None without any.
    fn around(
        points: &[Point3<f32>],
        voxel_m: f64,
        start_m: [f64; 3],
    ) -> Result<Option<Self>, VoxelError> {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in points.iter().filter(|p| is_finite(p)) {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        if low[0] > high[0] {
            return Ok(None);
        }
        let voxels_per_m = voxel_m.recip();
        let cell = |axis: usize, v: f32| ((f64::from(v) - start_m[axis]) * voxels_per_m).floor();
        let extent = |axis: usize| f64::from(high[axis]) - f64::from(low[axis]);
        let too_small =
            || VoxelError::TooSmall { voxel_m, extent_m: (0..3).map(extent).fold(0.0, f64::max) };
        let first = [0, 1, 2].map(|axis| cell(axis, low[axis]));
        let (mut stride, mut cells) = ([0; 3], 1u64);
        for axis in 0..3 {
            let count = cell(axis, high[axis]) - first[axis] + 1.0;
            // Beyond 2⁵³ neighbouring cells are no longer distinct numbers.
            if !(count < 2f64.powi(53) && first[axis].abs() < 2f64.powi(53)) {
                return Err(too_small());
            }
            stride[axis] = cells;
            cells = cells.checked_mul(count as u64).ok_or_else(too_small)?;
        }
        Ok(Some(Self { voxels_per_m, start_m, first, stride, last_key: cells - 1 }))
    }

    #[inline(always)]
    fn key(&self, point: &Point3<f32>) -> u64 {
        (0..3)
            .map(|axis| {
                let cell = ((f64::from(point[axis]) - self.start_m[axis]) * self.voxels_per_m)
                    .floor()
                    - self.first[axis];
                cell as u64 * self.stride[axis]
            })
            .sum()
    }
}

dispatch! {
    /// Runs of the finite points, in the order of the input.
    fn runs_of(grid: &VoxelGrid, points: &[Point3<f32>]) -> Vec<Run> = runs_inline;
}

#[inline(always)]
fn runs_inline(grid: &VoxelGrid, points: &[Point3<f32>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (i, point) in (0..).zip(points).filter(|(_, p)| is_finite(p)) {
        let key = grid.key(point);
        match runs.last_mut() {
            Some(run) if run.key == key && run.first + run.points == i => run.points += 1,
            _ => runs.push(Run { key, first: i, points: 1 }),
        }
    }
    runs
}

/// Sorts by key, equal keys in the order they came: one counting pass for every 11 bits that
/// `last_key` has.
fn sort_by_key(mut runs: Vec<Run>, last_key: u64) -> Vec<Run> {
    const BITS: u32 = 11;
    const DIGITS: usize = 1 << BITS;
    let mut sorted = vec![Run::default(); runs.len()];
    for pass in 0..(u64::BITS - last_key.leading_zeros()).div_ceil(BITS) {
        let digit = |key: u64| (key >> (pass * BITS)) as usize % DIGITS;
        let mut starts = [0usize; DIGITS + 1];
        for run in &runs {
            starts[digit(run.key) + 1] += 1;
        }
        for i in 0..DIGITS {
            starts[i + 1] += starts[i];
        }
        for &run in &runs {
            let at = &mut starts[digit(run.key)];
            sorted[*at] = run;
            *at += 1;
        }
        std::mem::swap(&mut runs, &mut sorted);
    }
    runs
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    fn cloud(points: &[[f32; 3]]) -> Cloud {
        Cloud::new(points.iter().map(|&p| p.into()).collect())
    }

    #[test]
    fn each_voxel_gives_the_mean_of_its_points_ordered_by_cell() {
        let points = [
            [1.5, 0.25, 0.25],
            [0.25, 0.5, 0.75],
            [0.75, 0.5, 0.25],
            [-0.5, 0.0, 0.0],
            [0.0, 0.0, -0.25],
        ];
        let expected = [[0.0, 0.0, -0.25], [-0.5, 0.0, 0.0], [0.5, 0.5, 0.5], [1.5, 0.25, 0.25]];
        assert_eq!(downsample(&cloud(&points), 1.0), Ok(cloud(&expected)));
    }

    // Literals of Open3D (MIT), cpp/tests/geometry/PointCloud.cpp, VoxelDownSample.
    #[test]
    fn open3ds_grid_starts_half_a_voxel_below_the_least_point() {
        let points = [
            [0.5, 0.7, 0.6],
            [0.6, 0.5, 0.7],
            [0.7, 0.6, 0.5],
            [0.8, 0.8, 0.8],
            [0.5, 1.6, 2.4],
            [0.6, 1.5, 2.3],
        ];
        let means = |points: &[[f32; 3]]| downsample_open3d(&cloud(points), 1.0).unwrap().points;
        for (mean, expected) in means(&points).iter().zip([[0.65, 0.65, 0.65], [0.55, 1.55, 2.35]])
        {
            assert!((mean.coords - Vector3::from(expected)).norm() < 1e-6, "{mean}");
        }
        // On the frame's own grid 0.9 and 1.2 lie apart; on this one, which starts at 0.4, they do
        // not.
        assert_eq!(means(&[[0.9; 3], [1.2; 3]]).len(), 1);
        assert_eq!(downsample(&cloud(&[[0.9; 3], [1.2; 3]]), 1.0).unwrap().points.len(), 2);
        assert!(matches!(
            downsample_open3d(&cloud(&[[f32::MAX; 3], [f32::MIN; 3]]), 0.1),
            Err(VoxelError::TooSmall { .. })
        ));
    }

    #[test]
    fn a_voxel_too_small_to_number_the_cells_is_an_error_and_not_an_overflow() {
        let wide = cloud(&[[-1e6, -1e6, -1e6], [1e6, 1e6, 1e6]]);
        assert!(matches!(downsample(&wide, 1e-3), Err(VoxelError::TooSmall { .. })));
        assert!(matches!(
            downsample(&cloud(&[[f32::MAX; 3], [f32::MIN; 3]]), 0.1),
            Err(VoxelError::TooSmall { .. })
        ));
        assert_eq!(downsample(&wide, 1.0).unwrap().points.len(), 2);
    }

    #[test]
    fn an_edge_that_is_not_positive_is_refused() {
        for edge in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(
                matches!(downsample(&cloud(&[[1.0; 3]]), edge), Err(VoxelError::Size(_))),
                "{edge}"
            );
        }
    }

    #[test]
    fn a_mean_of_four_is_twice_as_sure_as_each() {
        let points = [[0.1, 0.5, 0.5], [9.5, 0.5, 0.5], [0.3, 0.5, 0.5], [0.5; 3], [0.6, 0.5, 0.5]];
        let mut cloud = cloud(&points);
        cloud.range_sd_m = Some(vec![0.02, 0.05, 0.02, 0.02, 0.02]);
        let sds = downsample(&cloud, 1.0).unwrap().range_sd_m.unwrap();
        assert!((sds[0] - 0.01).abs() < 1e-8 && (sds[1] - 0.05).abs() < 1e-8, "{sds:?}");
    }

    #[test]
    fn errors_that_points_share_are_no_smaller_in_their_mean() {
        let points = [[0.1, 0.5, 0.5], [9.5, 0.5, 0.5], [0.3, 0.5, 0.5], [5.5, 0.5, 0.5]];
        let mut cloud = cloud(&points);
        cloud.range_sd_m = Some(vec![0.02, 0.05, 0.03, f32::NAN]);
        let sds = downsample_to_largest_sd(&cloud, 1.0).unwrap().range_sd_m.unwrap();
        assert!(sds[0] == 0.03 && sds[1].is_nan() && sds[2] == 0.05, "{sds:?}");
    }

    #[test]
    fn non_finite_points_are_skipped_and_no_points_give_no_points() {
        assert_eq!(downsample(&cloud(&[[f32::NAN; 3]]), 1.0), Ok(cloud(&[])));
        let mixed = cloud(&[[f32::INFINITY, 0.0, 0.0], [1.0, 1.0, 1.0]]);
        assert_eq!(downsample(&mixed, 1.0), Ok(cloud(&[[1.0; 3]])));
    }

    proptest! {
        #[test]
        fn the_counting_sort_equals_a_map_of_cells(
            points in prop::collection::vec(prop::array::uniform3(-50.0f32..50.0), 1..300),
            voxel_m in 0.001f64..20.0,
        ) {
            let mut cells = BTreeMap::<[i64; 3], (Vector3<f64>, f64)>::new();
            for p in &points {
                let cell = [2, 1, 0].map(|k| (f64::from(p[k]) * voxel_m.recip()).floor() as i64);
                let (sum, count) = cells.entry(cell).or_default();
                *sum += Vector3::from(*p).cast::<f64>();
                *count += 1.0;
            }
            let expected: Vec<Point3<f32>> =
                cells.values().map(|(sum, n)| (sum / *n).cast::<f32>().into()).collect();
            prop_assert_eq!(downsample(&cloud(&points), voxel_m).unwrap().points, expected);
        }
    }
}
