//! Street furniture: lamps, signs, bins, bollards, benches, fences.

use super::{Builder, Frame, Surface};

/// Street lamp 6–8 m high whose arm points along x.
pub(crate) fn lamp(b: &mut Builder, frame: &Frame, height_m: f64) {
    let at = |x: f64, z: f64| frame.at([x, 0.0, z]);
    b.tube((at(0.0, -0.3), 0.12), (at(0.0, 1.0), 0.11), 12, Surface::Metal);
    b.tube((at(0.0, 1.0), 0.07), (at(0.0, height_m), 0.05), 12, Surface::Metal);
    b.tube((at(0.0, height_m), 0.04), (at(1.4, height_m + 0.25), 0.035), 8, Surface::Metal);
    b.cuboid(frame, [1.2, -0.13, height_m + 0.18], [1.9, 0.13, height_m + 0.30], Surface::Metal);
}

/// Round traffic sign facing x.
pub(crate) fn sign(b: &mut Builder, frame: &Frame) {
    let at = |x: f64, z: f64| frame.at([x, 0.0, z]);
    b.tube((at(0.0, -0.3), 0.03), (at(0.0, 2.9), 0.03), 8, Surface::Metal);
    b.tube((at(0.035, 2.5), 0.3), (at(0.055, 2.5), 0.3), 20, Surface::RetroSign);
}

/// Traffic light 3.4 m high facing x: a pole, a box, three lenses below visors.
pub(crate) fn traffic_light(b: &mut Builder, frame: &Frame) {
    let at = |x: f64, z: f64| frame.at([x, 0.0, z]);
    b.tube((at(0.0, -0.3), 0.09), (at(0.0, 0.6), 0.09), 12, Surface::Metal);
    b.tube((at(0.0, 0.6), 0.06), (at(0.0, 3.4), 0.05), 12, Surface::Metal);
    b.cuboid(frame, [0.06, -0.17, 2.3], [0.28, 0.17, 3.3], Surface::DarkPaint);
    for k in 0..3 {
        let z = 2.47 + 0.32 * f64::from(k);
        b.tube((at(0.28, z), 0.11), (at(0.29, z), 0.11), 14, Surface::Glass);
        b.cuboid(frame, [0.28, -0.13, z + 0.12], [0.48, 0.13, z + 0.14], Surface::DarkPaint);
    }
}

/// Waste bin.
pub(crate) fn bin(b: &mut Builder, frame: &Frame) {
    let at = |z: f64| frame.at([0.0, 0.0, z]);
    b.tube((at(-0.1), 0.24), (at(0.9), 0.28), 14, Surface::Metal);
    b.tube((at(0.9), 0.31), (at(1.0), 0.2), 14, Surface::Metal);
}

/// Bollard.
pub(crate) fn bollard(b: &mut Builder, frame: &Frame) {
    b.tube(
        (frame.at([0.0, 0.0, -0.2]), 0.07),
        (frame.at([0.0, 0.0, 0.9]), 0.07),
        10,
        Surface::Metal,
    );
}

/// Bench along x, facing −y.
pub(crate) fn bench(b: &mut Builder, frame: &Frame) {
    for x in [-0.7, 0.6] {
        b.cuboid(frame, [x, -0.25, -0.2], [x + 0.1, 0.25, 0.42], Surface::Concrete);
    }
    for k in 0..4 {
        let y = -0.25 + 0.13 * f64::from(k);
        b.cuboid(frame, [-0.9, y, 0.42], [0.9, y + 0.09, 0.46], Surface::Wood);
        let z = 0.52 + 0.12 * f64::from(k);
        b.cuboid(frame, [-0.9, 0.27, z], [0.9, 0.30, z + 0.08], Surface::Wood);
    }
}

/// Picket fence along x; `ground` gives the height of the ground at an x, in the frame.
pub(crate) fn pickets(
    b: &mut Builder,
    frame: &Frame,
    length_m: f64,
    height_m: f64,
    ground: impl Fn(f64) -> f64,
) {
    let bays = (length_m / 2.0).ceil() as usize;
    let step = length_m / bays as f64;
    for bay in 0..bays {
        let (x, z) = (bay as f64 * step, ground((bay as f64 + 0.5) * step));
        let panel = frame.child([x, 0.0, z], 0.0);
        b.cuboid(&panel, [-0.05, -0.05, -0.5], [0.05, 0.05, height_m + 0.05], Surface::Wood);
        for rail in [0.25, height_m - 0.3] {
            b.cuboid(&panel, [0.0, 0.02, rail], [step, 0.05, rail + 0.08], Surface::Wood);
        }
        let pickets = (step / 0.18) as usize;
        for k in 0..pickets {
            let x = 0.18 * (k as f64 + 0.5);
            b.cuboid(&panel, [x - 0.05, -0.01, 0.06], [x + 0.05, 0.02, height_m], Surface::Wood);
        }
    }
}
