//! Roofs: slopes of tile courses, parapets, gutters, chimneys.

use std::f64::consts::{FRAC_PI_2, PI};

use super::house::{House, Roof};
use super::{Builder, Frame, Surface};
use echoloop_random::Generator;

impl House {
    /// Roof and chimney.
    pub(super) fn roof(&self, b: &mut Builder, frame: &Frame, rng: &mut Generator) {
        match self.roof {
            Roof::Flat => return self.flat_roof(b, frame, rng),
            Roof::Gable(pitch) => self.gable_roof(b, frame, pitch),
            Roof::Hip(pitch) => self.hip_roof(b, frame, pitch),
        }
        self.chimney(b, frame, rng);
    }

    fn chimney(&self, b: &mut Builder, frame: &Frame, rng: &mut Generator) {
        let (x, y) = (rng.spread(0.3 * self.width_m), rng.spread(0.15 * self.depth_m));
        let low = self.height_m();
        let top = low + self.rise_m() + 0.9;
        b.cuboid(frame, [x - 0.35, y - 0.35, low], [x + 0.35, y + 0.35, top], Surface::Brick);
        b.cuboid(
            frame,
            [x - 0.42, y - 0.42, top],
            [x + 0.42, y + 0.42, top + 0.1],
            Surface::Concrete,
        );
    }

    /// Height of the ridge above the eaves.
    fn rise_m(&self) -> f64 {
        match self.roof {
            Roof::Gable(pitch) | Roof::Hip(pitch) => 0.5 * self.depth_m * pitch,
            Roof::Flat => 0.0,
        }
    }

    fn flat_roof(&self, b: &mut Builder, frame: &Frame, rng: &mut Generator) {
        let (w, d, z) = (0.5 * self.width_m, 0.5 * self.depth_m, self.height_m());
        b.cuboid(frame, [-w, -d, z - 0.3], [w, d, z], Surface::Concrete);
        for (low, high) in [
            ([-w - 0.1, -d - 0.1], [w + 0.1, -d + 0.2]),
            ([-w - 0.1, d - 0.2], [w + 0.1, d + 0.1]),
            ([-w - 0.1, -d + 0.2], [-w + 0.2, d - 0.2]),
            ([w - 0.2, -d + 0.2], [w + 0.1, d - 0.2]),
        ] {
            b.cuboid(frame, [low[0], low[1], z - 0.2], [high[0], high[1], z + 0.6], self.wall);
        }
        for _ in 0..3 {
            let (x, y) = (rng.spread(0.6 * w), rng.spread(0.6 * d));
            b.cuboid(
                frame,
                [x - 0.8, y - 0.6, z],
                [x + 0.8, y + 0.6, z + rng.range(0.6, 1.8)],
                Surface::Metal,
            );
        }
    }

    fn gable_roof(&self, b: &mut Builder, frame: &Frame, pitch: f64) {
        let (w, d, z) = (0.5 * self.width_m, 0.5 * self.depth_m, self.height_m());
        let rise = self.rise_m();
        for x in [-w, w] {
            let corners = [[x, -d, z], [x, d, z], [x, 0.0, z + rise]].map(|p| frame.at(p));
            b.triangle(corners, self.wall);
        }
        for side in [0.0, PI] {
            let slope = frame.child([0.0; 3], side);
            let over = 0.35;
            let (eaves, ridge) = (z - over * pitch, z + rise);
            self.courses(b, &slope, [w + over; 2], [-d - over, 0.0], [eaves, ridge]);
            let gutter = |x: f64| slope.at([x, -d - over - 0.05, z - over * pitch]);
            b.tube((gutter(-w - over), 0.07), (gutter(w + over), 0.07), 8, Surface::Metal);
        }
    }

    fn hip_roof(&self, b: &mut Builder, frame: &Frame, pitch: f64) {
        let (w, d, z) = (0.5 * self.width_m, 0.5 * self.depth_m, self.height_m());
        let (over, rise) = (0.4, self.rise_m());
        let z = [z - over * pitch, z + rise];
        let ridge = (w - d).max(0.0);
        for side in [0.0, PI] {
            let slope = frame.child([0.0; 3], side);
            self.courses(b, &slope, [w + over, ridge], [-d - over, 0.0], z);
            // The end slope rises from the short wall to the end of the ridge.
            let end = frame.child([0.0; 3], side + FRAC_PI_2);
            self.courses(b, &end, [d + over, 0.0], [-w - over, -ridge], z);
        }
    }

    /// Tile courses of a slope; each pair gives the half width, y and z at the eaves and at the
    /// ridge.
    fn courses(&self, b: &mut Builder, slope: &Frame, half: [f64; 2], y: [f64; 2], z: [f64; 2]) {
        const STEP_M: f64 = 0.03;
        let count = (((y[1] - y[0]) / 0.4) as usize).max(1);
        let mix = |ends: [f64; 2], t: f64| ends[0] + (ends[1] - ends[0]) * t;
        for k in 0..count {
            let (s, t) = (k as f64 / count as f64, (k + 1) as f64 / count as f64);
            let edge = |t: f64, lift: f64| {
                [-1.0, 1.0].map(|sign| slope.at([sign * mix(half, t), mix(y, t), mix(z, t) + lift]))
            };
            let ([a, c], [p, q], [u, v]) = (edge(s, STEP_M), edge(t, 0.0), edge(s, 0.0));
            b.quad([a, c, q, p], self.roof_surface);
            b.quad([u, v, c, a], self.roof_surface);
        }
    }
}
