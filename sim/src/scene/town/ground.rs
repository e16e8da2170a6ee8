//! Ground of a town: it meets the edges of roads and is smooth in between.

use std::collections::VecDeque;

use super::cover_raster::{CoverRaster, neighbours};
use crate::scene::material::Surface;
use crate::scene::parts::{Builder, Point};
use crate::scene::value_noise::{Noise, ramp};

/// Side of a cell, metres; larger when there would be more than `MAX_CELLS`.
const CELL_M: f64 = 1.0;
const MAX_CELLS: f64 = 230_000.0;
/// Depth of the ground below the road that covers it, and below the road beside it, metres.
const UNDER_M: f64 = 0.06;
const BESIDE_M: f64 = 0.03;
/// Distance from roads at which hills begin, and further distance to their full height, metres.
const CALM_M: f64 = 4.0;
const RISE_M: f64 = 30.0;
/// Smoothing sweeps over the heights between roads.
const SWEEPS: usize = 120;
/// Distances of the coarse rows around the grid, metres: a LiDAR sees beyond the edge of a town.
const APRON: [f64; 8] = [6.0, 12.0, 18.0, 26.0, 34.0, 44.0, 54.0, 64.0];

/// Heights on a grid.
pub(super) struct Ground {
    low: [f64; 2],
    cell_m: f64,
    size: [usize; 2],
    heights_m: Vec<f64>,
    /// Approximate distance from the nearest road, metres.
    away_m: Vec<f64>,
}

impl Ground {
    pub(super) fn new(raster: &CoverRaster, relief: Noise, relief_m: f64) -> Self {
        let wide = [0, 1].map(|i| raster.high[i] - raster.low[i]);
        let cell_m = (wide[0] * wide[1] / MAX_CELLS).sqrt().max(CELL_M);
        let size = wide.map(|w| (w / cell_m) as usize + 1);
        let mut ground = Self {
            low: raster.low,
            cell_m,
            size,
            heights_m: vec![f64::NAN; size[0] * size[1]],
            away_m: vec![f64::INFINITY; size[0] * size[1]],
        };
        let known = ground.pin(raster);
        ground.fill(&known);
        ground.even_out(&known);
        ground.raise(relief, relief_m);
        ground
    }

    fn position(&self, k: usize) -> [f64; 2] {
        let [i, j] = [k % self.size[0], k / self.size[0]].map(|n| n as f64 * self.cell_m);
        [self.low[0] + i, self.low[1] + j]
    }

    /// Sets the heights under roads and beside them; returns true for each cell that is set.
    fn pin(&mut self, raster: &CoverRaster) -> Vec<bool> {
        // The diagonal of a cell, so that no face overhangs a lower road.
        let reach_m = 1.45 * self.cell_m;
        let mut known = vec![false; self.heights_m.len()];
        for (k, is_known) in known.iter_mut().enumerate() {
            let at = self.position(k);
            let Some(lowest) = raster.lowest(at, reach_m) else { continue };
            let drop = if raster.cover(at).is_road() { UNDER_M } else { BESIDE_M };
            self.heights_m[k] = lowest - drop;
            self.away_m[k] = 0.0;
            *is_known = true;
        }
        known
    }

    /// Fills heights from the roads outward: each is the mean of its known neighbours.
    fn fill(&mut self, known: &[bool]) {
        let mut queue: VecDeque<usize> = (0..known.len()).filter(|k| known[*k]).collect();
        while let Some(k) = queue.pop_front() {
            for beside in neighbours(self.size, k) {
                if !self.heights_m[beside].is_nan() {
                    continue;
                }
                let around = neighbours(self.size, beside).map(|n| self.heights_m[n]);
                let (sum, count) = around
                    .filter(|h| !h.is_nan())
                    .fold((0.0, 0), |(sum, count), h| (sum + h, count + 1));
                self.heights_m[beside] = sum / f64::from(count);
                self.away_m[beside] = self.away_m[k] + self.cell_m;
                queue.push_back(beside);
            }
        }
    }

    /// Smooths the heights that are not set: each becomes the mean of its neighbours.
    fn even_out(&mut self, known: &[bool]) {
        for _ in 0..SWEEPS {
            for k in (0..known.len()).filter(|k| !known[*k]) {
                let (sum, count) = neighbours(self.size, k)
                    .fold((0.0, 0), |(sum, count), n| (sum + self.heights_m[n], count + 1));
                self.heights_m[k] = sum / f64::from(count.max(1));
            }
        }
    }

    /// Adds hills away from the roads.
    fn raise(&mut self, relief: Noise, relief_m: f64) {
        for k in 0..self.heights_m.len() {
            let [x, y] = self.position(k);
            let rise_m = relief_m * ramp(self.away_m[k], CALM_M, CALM_M + RISE_M);
            self.heights_m[k] += rise_m * relief.at(x, y);
        }
    }

    /// Column and row of a point, each with the fraction of a cell beyond it.
    fn cell(&self, at: [f64; 2]) -> [(usize, f64); 2] {
        [0, 1].map(|i| {
            let x = ((at[i] - self.low[i]) / self.cell_m).clamp(0.0, (self.size[i] - 2) as f64);
            (x as usize, x - x.floor())
        })
    }

    /// Height at a point.
    pub(super) fn height(&self, at: [f64; 2]) -> f64 {
        let [(i, u), (j, v)] = self.cell(at);
        let of = |i: usize, j: usize| self.heights_m[j * self.size[0] + i];
        let row = |j: usize| of(i, j) * (1.0 - u) + of(i + 1, j) * u;
        row(j) * (1.0 - v) + row(j + 1) * v
    }

    /// Approximate distance of a point from the nearest road, metres.
    pub(super) fn away(&self, at: [f64; 2]) -> f64 {
        let [(i, _), (j, _)] = self.cell(at);
        self.away_m[j * self.size[0] + i]
    }

    pub(super) fn point(&self, at: [f64; 2]) -> Point {
        [at[0], at[1], self.height(at)]
    }

    /// Builds its faces; `surface` gives the surface at a point.
    pub(super) fn build(&self, b: &mut Builder, surface: impl Fn([f64; 2]) -> Surface) {
        let lines = [0, 1].map(|i| self.lines(i));
        let clamped =
            |line: usize, i: usize| line.saturating_sub(APRON.len()).min(self.size[i] - 1);
        let point = |i: usize, j: usize| {
            let height = self.heights_m[clamped(j, 1) * self.size[0] + clamped(i, 0)];
            [lines[0][i], lines[1][j], height]
        };
        let middle = |axis: usize, k: usize| 0.5 * (lines[axis][k] + lines[axis][k + 1]);
        b.sheet(lines[0].len() - 1, lines[1].len() - 1, point, |i, j| {
            surface([middle(0, i), middle(1, j)])
        });
    }

    fn lines(&self, axis: usize) -> Vec<f64> {
        let at = |k: usize| self.low[axis] + k as f64 * self.cell_m;
        let last = at(self.size[axis] - 1);
        let before = APRON.iter().rev().map(|far| at(0) - far);
        let inside = (0..self.size[axis]).map(at);
        before.chain(inside).chain(APRON.iter().map(|far| last + far)).collect()
    }
}
