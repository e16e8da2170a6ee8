//! Ground and rocks.

use super::{Builder, Point, Surface, add};
use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Ground out to `half_m` with cells of `fine_m`, then an apron of `apron_m` with coarse cells.
///
/// The apron avoids a cliff at the horizon: a LiDAR sees 120 m, beyond the edge of the scene.
pub(crate) fn ground(
    b: &mut Builder,
    half_m: f64,
    fine_m: f64,
    apron_m: f64,
    height: &impl Fn(f64, f64) -> f64,
    surface: impl Fn(f64, f64) -> Surface,
) {
    let lines = grid_lines(half_m, fine_m, apron_m);
    let cells = lines.len() - 1;
    let middle = |k: usize| 0.5 * (lines[k] + lines[k + 1]);
    b.sheet(
        cells,
        cells,
        |i, j| [lines[i], lines[j], height(lines[i], lines[j])],
        |i, j| surface(middle(i), middle(j)),
    );
}

fn grid_lines(half_m: f64, fine_m: f64, apron_m: f64) -> Vec<f64> {
    let fine = (2.0 * half_m / fine_m) as usize;
    let coarse = (apron_m / 8.0) as usize;
    let out = |k: usize| half_m + apron_m * k as f64 / coarse as f64;
    let left = (1..=coarse).rev().map(|k| -out(k));
    let inside = (0..=fine).map(|k| -half_m + 2.0 * half_m * k as f64 / fine as f64);
    left.chain(inside).chain((1..=coarse).map(out)).collect()
}

/// A boulder of about `radius_m` round a point.
pub(crate) fn rock(b: &mut Builder, at: Point, radius_m: f64, rng: &mut Generator) {
    let noise = Noise { seed: (rng.unit() * 1e15) as u64, scale_m: 0.9, octaves: 3 };
    let squash = [rng.range(0.8, 1.3), rng.range(0.7, 1.1), rng.range(0.6, 1.0)];
    let (columns, rows) = (18, 10);
    let point = |i: usize, j: usize| {
        let turn = std::f64::consts::TAU * (i % columns) as f64 / columns as f64;
        let polar = std::f64::consts::PI * j as f64 / rows as f64;
        let ring = libm::sin(polar);
        let d = [ring * libm::cos(turn), ring * libm::sin(turn), libm::cos(polar)];
        let bump = radius_m * (1.0 + 0.35 * noise.at(d[0] + 0.7 * d[2], d[1] - 0.7 * d[2]));
        add(at, std::array::from_fn(|k| bump * squash[k] * d[k]))
    };
    b.sheet(columns, rows, point, |_, _| Surface::Rock);
}
