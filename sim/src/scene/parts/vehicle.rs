//! Cars: a body lofted over cross-sections, wheels, mirrors, plates.

use super::{Builder, Frame, Point, Surface};
use echoloop_random::Generator;

/// Cross-section of a body: x, half width at the waist, sill z, waist z, roof z, half width of the
/// roof, as fractions of length, width and height. A body lists them from tail to nose.
type Section = [f64; 6];

const SALOON: &[Section] = &[
    [-0.500, 0.78, 0.30, 0.52, 0.54, 0.70],
    [-0.485, 0.90, 0.18, 0.60, 0.64, 0.76],
    [-0.400, 0.97, 0.14, 0.63, 0.68, 0.78],
    [-0.330, 0.99, 0.13, 0.64, 0.72, 0.76],
    [-0.220, 1.00, 0.13, 0.64, 0.96, 0.68],
    [-0.080, 1.00, 0.12, 0.63, 1.00, 0.68],
    [0.080, 1.00, 0.12, 0.62, 0.98, 0.67],
    [0.230, 0.99, 0.12, 0.61, 0.68, 0.74],
    [0.300, 0.98, 0.13, 0.60, 0.64, 0.78],
    [0.420, 0.95, 0.14, 0.55, 0.59, 0.76],
    [0.480, 0.86, 0.17, 0.48, 0.52, 0.70],
    [0.500, 0.74, 0.26, 0.42, 0.44, 0.62],
];

const ESTATE: &[Section] = &[
    [-0.500, 0.82, 0.28, 0.52, 0.58, 0.72],
    [-0.490, 0.93, 0.18, 0.58, 0.70, 0.76],
    [-0.440, 0.98, 0.14, 0.60, 0.92, 0.72],
    [-0.380, 1.00, 0.13, 0.60, 0.97, 0.72],
    [-0.200, 1.00, 0.12, 0.60, 1.00, 0.72],
    [0.000, 1.00, 0.12, 0.59, 1.00, 0.72],
    [0.120, 1.00, 0.12, 0.58, 0.95, 0.70],
    [0.260, 0.99, 0.12, 0.57, 0.64, 0.76],
    [0.400, 0.96, 0.14, 0.53, 0.58, 0.78],
    [0.480, 0.88, 0.17, 0.46, 0.50, 0.72],
    [0.500, 0.76, 0.26, 0.40, 0.42, 0.64],
];

const VAN: &[Section] = &[
    [-0.500, 0.92, 0.20, 0.48, 0.96, 0.88],
    [-0.490, 0.98, 0.14, 0.48, 0.99, 0.90],
    [-0.300, 1.00, 0.12, 0.48, 1.00, 0.91],
    [0.000, 1.00, 0.12, 0.48, 1.00, 0.91],
    [0.200, 1.00, 0.12, 0.47, 0.98, 0.88],
    [0.260, 1.00, 0.12, 0.46, 0.90, 0.85],
    [0.380, 0.98, 0.13, 0.45, 0.58, 0.84],
    [0.470, 0.92, 0.15, 0.42, 0.48, 0.80],
    [0.500, 0.82, 0.24, 0.36, 0.40, 0.72],
];

/// Points around half a section, from the sill to the middle of the roof.
const HALF: usize = 6;

/// Builds a car on the ground, nose towards x.
pub(crate) fn car(b: &mut Builder, frame: &Frame, rng: &mut Generator) {
    let (sections, mut size) = match rng.index(5) {
        0 | 1 => (SALOON, [4.6, 0.91, 1.46]),
        2 | 3 => (ESTATE, [4.3, 0.90, 1.56]),
        _ => (VAN, [5.3, 1.00, 2.10]),
    };
    size = size.map(|x| x * rng.range(0.95, 1.06));
    let paint = if rng.chance(0.35) { Surface::DarkPaint } else { Surface::CarPaint };
    body(b, frame, sections, size, paint);
    let [length, half, height] = size;
    for (x, side) in [(-0.30, -1.0), (-0.30, 1.0), (0.31, -1.0), (0.31, 1.0)] {
        wheel(b, frame, [x * length, side * (half - 0.09), 0.31]);
    }
    for side in [-1.0, 1.0] {
        let mirror: Point = [0.17 * length, side * (half + 0.09), 0.66 * height];
        b.cuboid(frame, mirror.map(|x| x - 0.07), mirror.map(|x| x + 0.07), paint);
    }
    for (x, z) in [(0.5, 0.30), (-0.5, 0.42)] {
        let at: Point = [x * length, 0.0, z * height];
        b.cuboid(
            frame,
            [at[0] - 0.02, -0.26, at[2] - 0.055],
            [at[0] + 0.02, 0.26, at[2] + 0.055],
            Surface::RetroSign,
        );
    }
}

fn body(b: &mut Builder, frame: &Frame, sections: &[Section], size: [f64; 3], paint: Surface) {
    let columns = 2 * HALF - 1;
    let rows = sections.len() - 1;
    let glazed = |k: usize, row: usize| {
        let tall = |s: &Section| s[4] - s[3] > 0.2;
        let side = k.min(columns - 1 - k) == 3;
        let slope = k.min(columns - 1 - k) >= 4 && tall(&sections[row]) != tall(&sections[row + 1]);
        (side && tall(&sections[row]) && tall(&sections[row + 1])) || slope
    };
    let point = |k: usize, row: usize| {
        let mirrored = k >= HALF;
        let p = outline(&sections[row], if mirrored { columns - k } else { k }, size);
        frame.at([p[0], if mirrored { -p[1] } else { p[1] }, p[2]])
    };
    b.sheet(columns, rows, point, |k, row| if glazed(k, row) { Surface::Glass } else { paint });
    let floor = |row: usize| [point(0, row), point(columns, row)];
    for row in 0..rows {
        let ([a, c], [d, e]) = (floor(row), floor(row + 1));
        b.quad([a, c, e, d], Surface::Metal);
    }
    for row in [0, rows] {
        for k in 0..HALF - 1 {
            let corners = [
                point(k, row),
                point(k + 1, row),
                point(columns - k - 1, row),
                point(columns - k, row),
            ];
            b.quad(corners, paint);
        }
    }
}

/// Point `k` of a section: 0 and 1 on the sill, 2 the bulge, 3 the waist, 4 the edge of the roof, 5
/// near its middle.
fn outline(section: &Section, k: usize, [length, half, height]: [f64; 3]) -> Point {
    let [x, wide, sill, waist, roof, narrow] = *section;
    let (y, z) = match k {
        0 => (0.88 * wide, sill),
        1 => (0.98 * wide, sill + 0.06),
        2 => (wide, 0.5 * (sill + waist)),
        3 => (0.96 * wide, waist),
        4 => (wide.min(1.0) * narrow, roof - 0.015),
        _ => (0.5 * wide * narrow, roof),
    };
    [x * length, y * half, z * height]
}

fn wheel(b: &mut Builder, frame: &Frame, hub: Point) {
    let side = |y: f64| frame.at([hub[0], hub[1] + y, hub[2]]);
    b.tube((side(-0.11), 0.31), (side(0.11), 0.31), 16, Surface::Rubber);
    b.tube((side(-0.12), 0.20), (side(0.12), 0.20), 10, Surface::Metal);
}
