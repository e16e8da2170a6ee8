//! The neighbours of all points within a radius.

use echoloop_dispatch::dispatch;
use nalgebra::Point3;
use rayon::prelude::*;

use super::quantile::quantile;

/// Cells a thread takes at a time.
const CHUNK: usize = 64;

/// Bits of a cell's number along each axis.
const BITS: u32 = 21;

/// Cells along each axis; points beyond lie in the outermost.
const MOST_CELLS: u64 = 1 << BITS;

/// Number of points from which the middle of a cloud is estimated.
const SAMPLES: usize = 1000;

/// The neighbours of each point of a cloud within one radius, the point itself included (Open3D's
/// hybrid search).
///
/// Stored as compressed rows (CSR): 8 bytes per neighbour, at most `8 · n · max`, and up to twice
/// as much again while they are found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Neighbours {
    /// Index of the first neighbour of each row, and the end of the last: `[n + 1]`.
    starts: Vec<usize>,
    /// Index of each neighbour.
    indices: Vec<u32>,
    /// Its squared distance, m².
    squared_m2: Vec<f32>,
}

impl Neighbours {
    /// Finds the nearest `max` points strictly within `radius_m` of each point, of equally near
    /// ones those of lower index.
    ///
    /// Points must be finite. A row is ordered by place, not by distance: the same for the same
    /// points, on any number of threads. Candidates come from a grid of cells as wide as the
    /// radius: those of three cells in a row lie together in memory, so a search is nine straight
    /// runs. A k-d tree gave the same rows at six times the cost.
    pub fn within(points: &[Point3<f32>], radius_m: f64, max: usize) -> Self {
        Self::gather(points.len(), rows(points, radius_m, max))
    }

    /// Puts rows found by cell into the order of the points.
    fn gather(points: usize, found: Vec<Rows>) -> Self {
        let mut starts = vec![0; points + 1];
        for rows in &found {
            rows.heads
                .iter()
                .for_each(|&(point, count)| starts[point as usize + 1] = count as usize);
        }
        (0..points).for_each(|i| starts[i + 1] += starts[i]);
        let total = starts[points];
        let (mut indices, mut squared_m2) = (vec![0; total], vec![0.0; total]);
        for rows in found {
            let mut at = 0;
            for &(point, count) in &rows.heads {
                let (to, count) = (starts[point as usize], count as usize);
                indices[to..to + count].copy_from_slice(&rows.indices[at..at + count]);
                squared_m2[to..to + count].copy_from_slice(&rows.squared_m2[at..at + count]);
                at += count;
            }
        }
        Self { starts, indices, squared_m2 }
    }
}

impl Neighbours {
    /// Count of the points.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// True when there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Count of the neighbours of all points together.
    pub fn total(&self) -> usize {
        self.indices.len()
    }

    /// Indices and squared distances, m², of a point's neighbours; none if there is no such point.
    pub fn row(&self, point: usize) -> (&[u32], &[f32]) {
        match (self.starts.get(point), self.starts.get(point + 1)) {
            (Some(&from), Some(&to)) => (&self.indices[from..to], &self.squared_m2[from..to]),
            _ => (&[], &[]),
        }
    }
}

/// The rows of all points.
fn rows(points: &[Point3<f32>], radius_m: f64, max: usize) -> Vec<Rows> {
    let grid = CellGrid::new(points, radius_m);
    let queries = Queries { grid: &grid, radius_m: radius_m as f32, max };
    let rows = |cells: &[Cell]| {
        let mut rows = Rows::default();
        search(&queries, cells, &mut rows);
        rows
    };
    grid.cells.par_chunks(CHUNK).map(rows).collect()
}

/// Largest count of neighbours, and the radius.
struct Queries<'a> {
    grid: &'a CellGrid,
    radius_m: f32,
    max: usize,
}

/// Rows as a thread finds them.
#[derive(Default)]
struct Rows {
    /// Each point, and the count of its neighbours.
    heads: Vec<(u32, u32)>,
    indices: Vec<u32>,
    squared_m2: Vec<f32>,
}

/// Points that follow each other in the grid's order.
struct Cell {
    key: u64,
    from: usize,
    to: usize,
}

/// Points in the order of the cells they lie in, x fastest.
struct CellGrid {
    cells: Vec<Cell>,
    /// Coordinates, one list per axis.
    at: [Vec<f32>; 3],
    /// Each point's index in the input.
    index: Vec<u32>,
}

impl CellGrid {
    fn new(points: &[Point3<f32>], radius_m: f64) -> Self {
        let middle = [0, 1, 2].map(|axis| median(points, axis));
        // A little wider than the radius, so that rounding puts no neighbour two cells away.
        let per_m = 1.0 / (radius_m * 1.000_001).max(f64::MIN_POSITIVE);
        // Counted from the middle: a point far out, if only one, must not widen the cells of all
        // others.
        let cell = |point: &Point3<f32>, axis: usize| {
            let steps =
                ((f64::from(point[axis]) - middle[axis]) * per_m).floor() + (MOST_CELLS / 2) as f64;
            (steps.max(0.0) as u64).min(MOST_CELLS - 1)
        };
        let key = |p: &Point3<f32>| cell(p, 2) << (2 * BITS) | cell(p, 1) << BITS | cell(p, 0);
        let mut keyed: Vec<(u64, u32)> =
            (0..).zip(points).map(|(index, point)| (key(point), index)).collect();
        keyed.sort_unstable();
        let coordinates =
            |axis: usize| keyed.iter().map(|&(_, index)| points[index as usize][axis]).collect();
        let mut cells: Vec<Cell> = Vec::new();
        for run in keyed.chunk_by(|a, b| a.0 == b.0) {
            let from = cells.last().map_or(0, |cell| cell.to);
            cells.push(Cell { key: run[0].0, from, to: from + run.len() });
        }
        Self { cells, at: [0, 1, 2].map(coordinates), index: keyed.iter().map(|k| k.1).collect() }
    }

    /// The points of the 27 cells around one: nine runs of three cells.
    fn runs(&self, key: u64) -> [std::ops::Range<usize>; 9] {
        let last = MOST_CELLS - 1;
        let [x, y, z] = [0, 1, 2].map(|axis| (key >> (axis * BITS)) & last);
        std::array::from_fn(|run| {
            let around =
                |v: u64, step: usize| (v + step as u64).checked_sub(1).filter(|v| *v <= last);
            let (Some(y), Some(z)) = (around(y, run % 3), around(z, run / 3)) else { return 0..0 };
            let row = z << (2 * BITS) | y << BITS;
            let (first, end) = (row | x.saturating_sub(1), row | (x + 1).min(last));
            let from = self.cells.partition_point(|cell| cell.key < first);
            let count =
                self.cells[from..].iter().take(3).take_while(|cell| cell.key <= end).count();
            match count {
                0 => 0..0,
                _ => self.cells[from].from..self.cells[from + count - 1].to,
            }
        })
    }

    /// Adds the points of a run that lie within the radius.
    #[inline(always)]
    fn scan(
        &self,
        at: &[f32; 3],
        run: std::ops::Range<usize>,
        squared: f32,
        found: &mut Candidates,
    ) {
        let [x, y, z] = [0, 1, 2].map(|axis| &self.at[axis][run.clone()]);
        let (indices, squares) = (&mut found.indices, &mut found.squared_m2);
        let mut count = found.count;
        for (((x, y), z), index) in x.iter().zip(y).zip(z).zip(&self.index[run]) {
            let (dx, dy, dz) = (x - at[0], y - at[1], z - at[2]);
            let d = dx * dx + dy * dy + dz * dz;
            // Written in any case, kept only when near: no branch to guess.
            indices[count] = *index;
            squares[count] = d;
            count += usize::from(d < squared);
        }
        found.count = count;
    }
}

/// Median of a sample of the points along an axis; 0 without points.
fn median(points: &[Point3<f32>], axis: usize) -> f64 {
    let some = points.iter().step_by(points.len().div_ceil(SAMPLES).max(1));
    f64::from(quantile(some.map(|p| p[axis]), 0.5))
}

dispatch! {
    /// The rows of the points of some cells.
    fn search(queries: &Queries, cells: &[Cell], rows: &mut Rows) = search_inline;
}

#[inline(always)]
fn search_inline(queries: &Queries, cells: &[Cell], rows: &mut Rows) {
    let Queries { grid, radius_m, max } = *queries;
    let squared = radius_m * radius_m;
    let mut found = Candidates::default();
    for cell in cells {
        let runs = grid.runs(cell.key);
        for query in cell.from..cell.to {
            found.clear(runs.iter().map(|run| run.len()).sum());
            let at = [0, 1, 2].map(|axis| grid.at[axis][query]);
            for run in runs.iter().filter(|run| !run.is_empty()) {
                grid.scan(&at, run.clone(), squared, &mut found);
            }
            found.keep_nearest(max);
            rows.push(grid.index[query], &found);
        }
    }
}

/// One point's neighbours, as they are found.
#[derive(Default)]
struct Candidates {
    indices: Vec<u32>,
    squared_m2: Vec<f32>,
    count: usize,
    order: Vec<(f32, u32)>,
}

impl Candidates {
    /// Makes room for the candidates, and one more that is written but not kept.
    fn clear(&mut self, candidates: usize) {
        self.count = 0;
        if self.indices.len() <= candidates {
            self.indices.resize(candidates + 1, 0);
            self.squared_m2.resize(candidates + 1, 0.0);
        }
    }

    fn keep_nearest(&mut self, max: usize) {
        if self.count <= max {
            return;
        }
        let Some(last) = max.checked_sub(1) else {
            self.count = 0;
            return;
        };
        self.order.clear();
        self.order.extend(
            self.squared_m2.iter().copied().zip(self.indices.iter().copied()).take(self.count),
        );
        let farther = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let limit = *self.order.select_nth_unstable_by(last, farther).1;
        let mut kept = 0;
        for i in 0..self.count {
            let this = (self.squared_m2[i], self.indices[i]);
            (self.squared_m2[kept], self.indices[kept]) = this;
            kept += usize::from(farther(&this, &limit).is_le());
        }
        self.count = kept;
    }
}

impl Rows {
    fn push(&mut self, point: u32, found: &Candidates) {
        self.heads.push((point, found.count as u32));
        self.indices.extend_from_slice(&found.indices[..found.count]);
        self.squared_m2.extend_from_slice(&found.squared_m2[..found.count]);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::tests::scanned::nearest_first;
    use crate::tests::on_threads;

    /// Coordinates on a coarse lattice (many ties and duplicates), anywhere, and on a line.
    fn points() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop_oneof![
            prop::collection::vec(
                prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.5)),
                0..300
            ),
            prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..300),
            prop::collection::vec((-900.0f32..900.0).prop_map(|x| [x, 1.0, -2.0]), 0..300),
        ]
    }

    fn row(all: &Neighbours, point: usize) -> Vec<(f32, u32)> {
        let (indices, squared) = all.row(point);
        let mut row: Vec<(f32, u32)> =
            squared.iter().copied().zip(indices.iter().copied()).collect();
        row.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        row
    }

    proptest! {
        #[test]
        fn rows_are_those_of_a_full_scan(
            raw in points(),
            radius in 0.1f32..30.0,
            max in 0usize..60,
        ) {
            let points: Vec<Point3<f32>> = raw.iter().map(|&p| p.into()).collect();
            let all = Neighbours::within(&points, f64::from(radius), max);
            prop_assert_eq!(all.len(), points.len());
            for (i, query) in points.iter().enumerate() {
                let mut expected = nearest_first(&points, query, radius);
                expected.truncate(max);
                prop_assert_eq!(row(&all, i), expected);
            }
        }
    }

    #[test]
    fn a_cloud_far_wider_than_its_radius_needs_no_more_room_than_its_points() {
        let points: Vec<Point3<f32>> =
            [-1e30, 0.0, 1e-3, 1e30].map(|x| Point3::new(x, x, x)).to_vec();
        let all = Neighbours::within(&points, 0.1, 10);
        assert_eq!((all.total(), all.row(1).0.len()), (6, 2));
        assert_eq!(all.row(99).0.len(), 0);
    }

    #[test]
    fn one_point_far_away_does_not_widen_the_cells_of_the_others() {
        let mut points: Vec<Point3<f32>> =
            (0..4000).map(|i| Point3::new((i % 63) as f32, (i / 63) as f32, 0.0)).collect();
        points.push(Point3::new(1e12, 0.0, 0.0));
        let grid = CellGrid::new(&points, 1.5);
        assert!(grid.cells.len() > 1000, "{} cells", grid.cells.len());
    }

    #[test]
    fn one_thread_and_two_give_the_same_rows() {
        let points: Vec<Point3<f32>> = (0..20_000)
            .map(|i| {
                let a = i as f32;
                Point3::new(a.sin() * 20.0, (a * 1.7).cos() * 20.0, (a * 0.01).sin())
            })
            .collect();
        let on = |threads| on_threads(threads, || Neighbours::within(&points, 0.8, 20));
        assert!(on(1) == on(2));
    }
}
