//! Raster of the cover of the ground of a town: where one may build, and the heights of roads.

use crate::roads::{Lane, LaneKind, RoadNetwork};
use crate::scene::parts::{Frame, Point};
use crate::vector::mix;

/// Height of a kerb, metres.
pub(super) const KERB_M: f64 = 0.13;
/// Margin of a town around its roads, metres.
const MARGIN_M: f64 = 48.0;
/// Side of a cell, metres; larger when a town would have more than `MAX_CELLS`.
const CELL_M: f64 = 0.5;
const MAX_CELLS: f64 = 8e6;
/// Area below which a gap between roads is paved, m²: the middles of crossings.
const INFILL_M2: f64 = 120.0;

/// Cover of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cover {
    /// Open ground.
    Open,
    /// A small gap between roads, paved.
    Infill,
    /// A level part of a road without traffic or pedestrians.
    Paved,
    /// Raised by a kerb: sidewalks and medians.
    Raised,
    /// Driving lanes.
    Driven,
}

impl Cover {
    pub(super) fn of(kind: LaneKind) -> Self {
        match kind {
            LaneKind::Driving | LaneKind::Traffic => Self::Driven,
            LaneKind::Sidewalk | LaneKind::Median => Self::Raised,
            LaneKind::Parking | LaneKind::Shoulder | LaneKind::Rail | LaneKind::Verge => {
                Self::Paved
            }
        }
    }

    /// True for parts of roads.
    pub(super) fn is_road(self) -> bool {
        self >= Self::Paved
    }
}

/// Pieces of a lane, 2 m long at most. Corners: left and right at the start, right and left at the
/// end.
pub(super) fn pieces(lane: &Lane) -> Vec<[Point; 4]> {
    const MAX_M: f64 = 2.0;
    let mut pieces = Vec::new();
    for pair in lane.ribs.windows(2) {
        let [[l0, r0], [l1, r1]] = [pair[0], pair[1]];
        let long = flat(l0, l1).max(flat(r0, r1));
        let count = (long / MAX_M).ceil().max(1.0);
        let at = |a: Point, b: Point, k: usize| mix(a, b, k as f64 / count);
        pieces.extend(
            (0..count as usize)
                .map(|k| [at(l0, l1, k), at(r0, r1, k), at(r0, r1, k + 1), at(l0, l1, k + 1)]),
        );
    }
    pieces
}

/// Horizontal distance.
pub(super) fn flat(a: Point, b: Point) -> f64 {
    ((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])).sqrt()
}

/// Cells to the left, right, below and above a cell of a raster of `[columns, rows]`.
pub(super) fn neighbours(
    [columns, rows]: [usize; 2],
    cell: usize,
) -> impl Iterator<Item = usize> + use<> {
    let (i, j) = (cell % columns, cell / columns);
    let sides = [
        (i > 0).then(|| cell - 1),
        (i + 1 < columns).then_some(cell + 1),
        (j > 0).then(|| cell - columns),
        (j + 1 < rows).then_some(cell + columns),
    ];
    sides.into_iter().flatten()
}

/// Cover, height and occupation of each cell.
pub(super) struct CoverRaster {
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
    pub(super) cell_m: f64,
    size: [usize; 2],
    cover: Vec<Cover>,
    /// Height of the road that covers a cell, kerb included, metres; NaN for open ground.
    level_m: Vec<f32>,
    /// True for cells that are occupied.
    taken: Vec<bool>,
}

impl CoverRaster {
    pub(super) fn new(network: &RoadNetwork) -> Self {
        let (low, high) = network.bounds();
        let (low, high) = (low.map(|x| x - MARGIN_M), high.map(|x| x + MARGIN_M));
        let area = (high[0] - low[0]) * (high[1] - low[1]);
        let cell_m = (area / MAX_CELLS).sqrt().max(CELL_M);
        let size = [0, 1].map(|i| ((high[i] - low[i]) / cell_m) as usize + 1);
        let count = size[0] * size[1];
        let mut raster = Self {
            low,
            high,
            cell_m,
            size,
            cover: vec![Cover::Open; count],
            level_m: vec![f32::NAN; count],
            taken: vec![false; count],
        };
        network.lanes.iter().for_each(|lane| raster.lay(lane));
        raster.infill();
        raster
    }

    fn index(&self, at: [f64; 2]) -> Option<usize> {
        let [i, j] = [0, 1].map(|k| (at[k] - self.low[k]) / self.cell_m);
        let inside = i >= 0.0 && j >= 0.0;
        let [i, j] = [i as usize, j as usize];
        (inside && i < self.size[0] && j < self.size[1]).then(|| j * self.size[0] + i)
    }

    /// Marks the cells of a lane: the higher kind of cover wins, and the lowest height of a kind.
    fn lay(&mut self, lane: &Lane) {
        let cover = Cover::of(lane.kind);
        let rise = if cover == Cover::Raised { KERB_M } else { 0.0 };
        let step = 0.5 * self.cell_m;
        for [l0, r0, r1, l1] in pieces(lane) {
            let count = |a: f64, b: f64| (a.max(b) / step).ceil().max(1.0);
            let (along, across) =
                (count(flat(l0, l1), flat(r0, r1)), count(flat(l0, r0), flat(l1, r1)));
            for i in 0..=along as usize {
                let t = i as f64 / along;
                let (left, right) = (mix(l0, l1, t), mix(r0, r1, t));
                for j in 0..=across as usize {
                    let [x, y, z] = mix(left, right, j as f64 / across);
                    let Some(cell) = self.index([x, y]) else { continue };
                    let z = (z + rise) as f32;
                    if cover > self.cover[cell] || self.level_m[cell].is_nan() {
                        (self.cover[cell], self.level_m[cell]) = (cover, z);
                    } else if cover == self.cover[cell] {
                        self.level_m[cell] = self.level_m[cell].min(z);
                    }
                }
            }
        }
    }

    /// Paves the small gaps between roads.
    fn infill(&mut self) {
        let most = (INFILL_M2 / (self.cell_m * self.cell_m)) as usize;
        let mut seen = vec![false; self.cover.len()];
        for start in 0..self.cover.len() {
            if seen[start] || self.cover[start] != Cover::Open {
                continue;
            }
            let (mut gap, mut next) = (vec![start], 0);
            seen[start] = true;
            while next < gap.len() {
                for beside in neighbours(self.size, gap[next]) {
                    if !seen[beside] && self.cover[beside] == Cover::Open {
                        seen[beside] = true;
                        gap.push(beside);
                    }
                }
                next += 1;
            }
            if gap.len() <= most {
                gap.into_iter().for_each(|cell| self.cover[cell] = Cover::Infill);
            }
        }
    }

    pub(super) fn cover(&self, at: [f64; 2]) -> Cover {
        self.index(at).map_or(Cover::Open, |cell| self.cover[cell])
    }

    /// Height of the road that covers a point, kerb included.
    pub(super) fn level(&self, at: [f64; 2]) -> Option<f64> {
        let level = f64::from(self.level_m[self.index(at)?]);
        (!level.is_nan()).then_some(level)
    }

    /// Lowest road within a square of half side `reach_m` around a point.
    pub(super) fn lowest(&self, at: [f64; 2], reach_m: f64) -> Option<f64> {
        let steps = (reach_m / self.cell_m).ceil() as i32;
        let offsets = || (-steps..=steps).map(|k| f64::from(k) * self.cell_m);
        let around = offsets().flat_map(|dx| offsets().map(move |dy| [at[0] + dx, at[1] + dy]));
        around.filter_map(|at| self.level(at)).reduce(f64::min)
    }

    /// Cells of a rectangle in a frame, between two corners; `None` outside the raster.
    fn rectangle(&self, frame: &Frame, low: [f64; 2], high: [f64; 2]) -> Vec<Option<usize>> {
        let count = |i: usize| ((high[i] - low[i]) / (0.7 * self.cell_m)).ceil().max(1.0) as usize;
        let size = [count(0), count(1)];
        let at = |i: usize, k: usize| low[i] + (high[i] - low[i]) * k as f64 / size[i] as f64;
        let mut cells = Vec::with_capacity((size[0] + 1) * (size[1] + 1));
        for j in 0..=size[1] {
            for i in 0..=size[0] {
                let [x, y, _] = frame.at([at(0, i), at(1, j), 0.0]);
                cells.push(self.index([x, y]));
            }
        }
        cells
    }

    /// Occupies a rectangle of open ground, if all of it is free.
    pub(super) fn take(&mut self, frame: &Frame, low: [f64; 2], high: [f64; 2]) -> bool {
        self.take_if(frame, low, high, |cover| cover == Cover::Open)
    }

    /// Occupies a rectangle of wanted cover, if all of it is free.
    pub(super) fn take_if(
        &mut self,
        frame: &Frame,
        low: [f64; 2],
        high: [f64; 2],
        is_wanted: impl Fn(Cover) -> bool,
    ) -> bool {
        let cells = self.rectangle(frame, low, high);
        let is_free = |cell: &Option<usize>| {
            cell.is_some_and(|cell| is_wanted(self.cover[cell]) && !self.taken[cell])
        };
        let free = cells.iter().all(is_free);
        if free {
            cells.into_iter().flatten().for_each(|cell| self.taken[cell] = true);
        }
        free
    }

    /// Occupies a square of open ground around a point, if all of it is free.
    pub(super) fn take_spot(&mut self, at: [f64; 2], half_m: f64) -> bool {
        let frame = Frame::new([at[0], at[1], 0.0], 0.0);
        self.take(&frame, [-half_m; 2], [half_m; 2])
    }
}
