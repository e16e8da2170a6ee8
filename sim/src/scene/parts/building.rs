//! Houses: walls with recessed windows and doors, balconies, roofs with tile courses.

use std::f64::consts::FRAC_PI_2;

use super::house::House;
use super::{Builder, Frame, Surface};
use echoloop_random::Generator;

/// Rectangle on a wall: x along it, z up.
#[derive(Clone, Copy, Debug)]
struct Rect {
    x: [f64; 2],
    z: [f64; 2],
}

/// Part of a wall with one window or door.
struct Bay {
    cell: Rect,
    front: bool,
    upper: bool,
}

impl Bay {
    fn middle(&self) -> f64 {
        0.5 * (self.cell.x[0] + self.cell.x[1])
    }

    fn width(&self) -> f64 {
        self.cell.x[1] - self.cell.x[0]
    }

    /// Opening in its middle, from `low` to `high` above the floor, metres.
    fn hole(&self, half: f64, low: f64, high: f64) -> Rect {
        let (x, z) = (self.middle(), self.cell.z[0]);
        Rect { x: [x - half, x + half], z: [z + low, z + high] }
    }
}

/// Opening in a bay: its reveals, and a pane set back by `depth`.
struct Opening<'a> {
    bay: &'a Bay,
    hole: Rect,
    depth: f64,
    face: Surface,
    pane: Surface,
}

impl Opening<'_> {
    fn build(&self, b: &mut Builder, wall: &Frame) {
        let Self { bay, hole, depth, face, pane } = *self;
        let cell = bay.cell;
        let ring = [
            Rect { x: cell.x, z: [cell.z[0], hole.z[0]] },
            Rect { x: cell.x, z: [hole.z[1], cell.z[1]] },
            Rect { x: [cell.x[0], hole.x[0]], z: hole.z },
            Rect { x: [hole.x[1], cell.x[1]], z: hole.z },
        ];
        for r in ring.into_iter().filter(|r| r.x[1] > r.x[0] && r.z[1] > r.z[0]) {
            quad_xz(b, wall, r, 0.0, face);
        }
        let [x, z] = [hole.x, hole.z];
        let rim = [[x[0], z[0]], [x[1], z[0]], [x[1], z[1]], [x[0], z[1]]];
        for (i, p) in rim.into_iter().enumerate() {
            let q = rim[(i + 1) % 4];
            let corners =
                [[p[0], 0.0, p[1]], [q[0], 0.0, q[1]], [q[0], depth, q[1]], [p[0], depth, p[1]]];
            b.quad(corners.map(|c| wall.at(c)), face);
        }
        quad_xz(b, wall, hole, depth, pane);
    }
}

impl House {
    /// Builds the house around the origin of the frame, which is the middle of its floor plan on
    /// the ground.
    pub(crate) fn build(&self, b: &mut Builder, frame: &Frame, rng: &mut Generator) {
        let (w, d) = (0.5 * self.width_m, 0.5 * self.depth_m);
        let starts = [[-w, -d, 0.0], [w, -d, 0.0], [w, d, 0.0], [-w, d, 0.0]];
        for (side, start) in starts.into_iter().enumerate() {
            let wall = frame.child(start, side as f64 * FRAC_PI_2);
            let length = if side % 2 == 0 { self.width_m } else { self.depth_m };
            self.wall(b, &wall, length, side, rng);
        }
        b.cuboid(
            frame,
            [-w - 0.04, -d - 0.04, -1.5],
            [w + 0.04, d + 0.04, 0.35],
            Surface::Concrete,
        );
        self.roof(b, frame, rng);
    }

    /// Builds one wall: x along it, y into the house, z up.
    fn wall(&self, b: &mut Builder, wall: &Frame, length: f64, side: usize, rng: &mut Generator) {
        if !self.open[side] {
            quad_xz(b, wall, Rect { x: [0.0, length], z: [0.0, self.height_m()] }, 0.0, self.wall);
            return;
        }
        let bays = ((length / self.bay_m) as usize).max(1);
        let bay = length / bays as f64;
        let door = (side == 0).then(|| rng.index(bays));
        for floor in 0..self.floors {
            let bottom = floor as f64 * self.floor_m;
            for k in 0..bays {
                let x = [k as f64 * bay, (k + 1) as f64 * bay];
                let cell = Rect { x, z: [bottom, bottom + self.floor_m] };
                let bay = Bay { cell, front: side == 0, upper: floor > 0 };
                if door == Some(k) && floor == 0 {
                    self.door(b, wall, &bay);
                } else if self.shop && bay.front && floor == 0 {
                    self.shop_window(b, wall, &bay);
                } else {
                    self.window(b, wall, &bay, rng);
                }
            }
            if floor > 0 && side == 0 && self.wall != Surface::Plaster {
                b.cuboid(
                    wall,
                    [0.0, -0.08, bottom - 0.1],
                    [length, 0.02, bottom + 0.08],
                    Surface::Stone,
                );
            }
        }
        self.downpipe(b, wall, length);
    }

    fn door(&self, b: &mut Builder, wall: &Frame, bay: &Bay) {
        let hole = bay.hole(0.55, 0.0, (self.floor_m - 0.35).min(2.15));
        Opening { bay, hole, depth: 0.25, face: self.wall, pane: Surface::Wood }.build(b, wall);
        let x = bay.middle();
        b.cuboid(wall, [x - 0.8, -0.9, -0.3], [x + 0.8, 0.0, 0.14], Surface::Stone);
        b.cuboid(wall, [x - 0.9, -0.9, 2.35], [x + 0.9, 0.0, 2.45], Surface::Metal);
    }

    fn shop_window(&self, b: &mut Builder, wall: &Frame, bay: &Bay) {
        let hole = bay.hole(0.42 * bay.width(), 0.4, self.floor_m - 0.35);
        Opening { bay, hole, depth: 0.3, face: Surface::Stone, pane: Surface::Glass }
            .build(b, wall);
        window_bars(b, wall, hole, 0.3);
    }

    fn window(&self, b: &mut Builder, wall: &Frame, bay: &Bay, rng: &mut Generator) {
        let french = self.balconies && bay.front && bay.upper;
        let sill = if french { 0.1 } else { 0.9 };
        let hole = bay.hole(0.5 * (0.45 * bay.width()).min(1.5), sill, self.floor_m - 0.35);
        let depth = 0.15 + 0.1 * rng.unit();
        Opening { bay, hole, depth, face: self.wall, pane: Surface::Glass }.build(b, wall);
        window_bars(b, wall, hole, depth);
        let ([left, right], z) = (hole.x, hole.z[0]);
        b.cuboid(wall, [left - 0.1, -0.08, z - 0.06], [right + 0.1, 0.1, z], Surface::Stone);
        if french && rng.chance(0.3) {
            balcony(b, wall, bay);
        } else if !self.balconies && rng.chance(0.4) {
            shutters(b, wall, hole);
        }
    }

    fn downpipe(&self, b: &mut Builder, wall: &Frame, length: f64) {
        let (low, high) =
            (wall.at([length - 0.2, -0.07, 0.1]), wall.at([length - 0.2, -0.07, self.height_m()]));
        b.tube((low, 0.05), (high, 0.05), 8, Surface::Metal);
    }
}

fn quad_xz(b: &mut Builder, wall: &Frame, r: Rect, depth: f64, surface: Surface) {
    let [x, z] = [r.x, r.z];
    let corners =
        [[x[0], depth, z[0]], [x[1], depth, z[0]], [x[1], depth, z[1]], [x[0], depth, z[1]]];
    b.quad(corners.map(|p| wall.at(p)), surface);
}

/// Bars in front of the pane.
fn window_bars(b: &mut Builder, wall: &Frame, hole: Rect, depth: f64) {
    let (near, far) = (depth - 0.05, depth - 0.002);
    let middle = 0.5 * (hole.x[0] + hole.x[1]);
    b.cuboid(
        wall,
        [middle - 0.04, near, hole.z[0]],
        [middle + 0.04, far, hole.z[1]],
        Surface::Wood,
    );
    let z = hole.z[0] + 0.66 * (hole.z[1] - hole.z[0]);
    b.cuboid(wall, [hole.x[0], near, z], [hole.x[1], far, z + 0.08], Surface::Wood);
}

fn shutters(b: &mut Builder, wall: &Frame, hole: Rect) {
    let half = 0.5 * (hole.x[1] - hole.x[0]);
    for x in [hole.x[0] - half - 0.02, hole.x[1] + 0.02] {
        b.cuboid(wall, [x, -0.05, hole.z[0]], [x + half, -0.01, hole.z[1]], Surface::Wood);
    }
}

fn balcony(b: &mut Builder, wall: &Frame, bay: &Bay) {
    let (middle, z, half) = (bay.middle(), bay.cell.z[0], 0.45 * bay.width());
    b.cuboid(wall, [middle - half, -1.2, z - 0.15], [middle + half, 0.0, z], Surface::Concrete);
    for height in [0.1, 1.0] {
        let rail = z + height;
        b.cuboid(
            wall,
            [middle - half, -1.2, rail],
            [middle + half, -1.16, rail + 0.04],
            Surface::Metal,
        );
    }
    let bars = (2.0 * half / 0.2) as usize;
    for k in 0..=bars {
        let x = middle - half + 2.0 * half * k as f64 / bars as f64;
        b.cuboid(wall, [x - 0.01, -1.19, z], [x + 0.01, -1.17, z + 1.0], Surface::Metal);
    }
    for side in [middle - half, middle + half - 0.03] {
        b.cuboid(wall, [side, -1.2, z], [side + 0.03, 0.0, z + 1.0], Surface::Metal);
    }
}
