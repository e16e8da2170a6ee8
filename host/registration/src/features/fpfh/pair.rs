//! The three FPFH angles of two points with normals, as bins of their histograms.

/// Bins of a histogram.
pub(super) const BINS: usize = 11;

/// Pairs worked on at a time.
pub(super) const LANES: usize = 32;

/// A point and its normal: x y z, then the normal's, m; two numbers fill the line.
pub(super) type Facing = [f32; 8];

/// Cosine and sine of π/11, 3π/11, … 9π/11: the edges of the angle's bins on one side of 0.
const EDGES: [(f32, f32); 5] = [
    (0.959_493, 0.281_732_56),
    (0.654_860_73, 0.755_749_6),
    (0.142_314_84, 0.989_821_43),
    (-0.415_415_02, 0.909_631_97),
    (-0.841_253_5, 0.540_640_83),
];

/// Neighbours of one point, one array a coordinate.
pub(super) struct PairLanes {
    offset: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
}

/// A bin in each histogram, for each pair.
pub(super) type PairBins = [[u8; LANES]; 3];

impl PairLanes {
    pub(super) const EMPTY: Self = Self { offset: [[0.0; LANES]; 3], normal: [[0.0; LANES]; 3] };

    /// Puts a neighbour of `point` in a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, point: &Facing, neighbour: &Facing) {
        for axis in 0..3 {
            self.offset[axis][lane] = neighbour[axis] - point[axis];
            self.normal[axis][lane] = neighbour[3 + axis];
        }
    }

    /// The pair feature of a point with each neighbour (Rusu, Blodow and Beetz 2009, as Open3D has
    /// it):
    ///
    /// ```text
    /// d = p2 - p1    a1 = n1 · d / |d|    a2 = n2 · d / |d|
    /// if |a1| < |a2|: swap n1 and n2, d = -d, a1 = -a2
    /// v = d × n1 / |d × n1|    w = n1 × v
    /// f1 = atan2( w · n2, n1 · n2 ), -π to π    f2 = v · n2, -1 to 1    f3 = a1, -1 to 1
    /// bin = ⌊11 (f - least) / range⌋, 0 to 10
    /// ```
    ///
    /// If d or d × n1 is 0, all three are 0, in the middle bins. The angle itself is never
    /// computed: it is beyond the edge e when sin(|f1| - e) > 0, which is |y| cos e > x sin e.
    #[inline(always)]
    pub(super) fn bins(&self, normal: [f32; 3], bins: &mut PairBins) {
        let ([dx, dy, dz], [mx, my, mz]) = (&self.offset, &self.normal);
        for i in 0..LANES {
            let (d, other) = ([dx[i], dy[i], dz[i]], [mx[i], my[i], mz[i]]);
            let squared = dot(d, d);
            let per_m = if squared > 0.0 { 1.0 / squared.sqrt() } else { 0.0 };
            let (here, there) = (dot(normal, d) * per_m, dot(other, d) * per_m);
            let swap = here.abs() < there.abs();
            let first = pick(swap, other, normal);
            let second = pick(swap, normal, other);
            let sign = if swap { -per_m } else { per_m };
            let v = cross(d, first);
            let length = dot(v, v).sqrt();
            let valid = length > 0.0;
            let scale = if valid { sign / (length * per_m) } else { 0.0 };
            let v = v.map(|v| v * scale);
            let y = dot(cross(first, v), second);
            let x = if valid { dot(first, second) } else { 0.0 };
            let along = if swap { -there } else { here };
            bins[0][i] = angle_bin(x, y);
            bins[1][i] = even_bin(dot(v, second));
            bins[2][i] = even_bin(if valid { along } else { 0.0 });
        }
    }
}

/// The bin of atan2(y, x). A y of -0 counts as negative, as atan2 has it.
#[inline(always)]
fn angle_bin(x: f32, y: f32) -> u8 {
    let mut beyond = 0i32;
    for (cos, sin) in EDGES {
        beyond += i32::from(y.abs() * cos > x * sin);
    }
    // All ones where y is negative, so that the exclusive or and the difference negate.
    let negative = (y.to_bits() as i32) >> 31;
    ((BINS / 2) as i32 + ((beyond ^ negative) - negative)) as u8
}

/// The bin of a number from -1 to 1.
#[inline(always)]
fn even_bin(f: f32) -> u8 {
    let scaled = (f + 1.0) * (0.5 * BINS as f32);
    scaled.max(0.0).min((BINS - 1) as f32) as u8
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn pick(condition: bool, yes: [f32; 3], no: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| if condition { yes[i] } else { no[i] })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    /// The bins in `f64`, as defined; and how near the nearest edge or choice any of the numbers
    /// is.
    fn plain(d: Vector3<f64>, n1: Vector3<f64>, n2: Vector3<f64>) -> ([u8; 3], f64) {
        let (a1, a2) = (n1.dot(&d) / d.norm(), n2.dot(&d) / d.norm());
        let (n1, n2, e, f3) = if a1.abs() < a2.abs() { (n2, n1, -d, -a2) } else { (n1, n2, d, a1) };
        let v = e.cross(&n1).normalize();
        let w = n1.cross(&v);
        let f1 = w.dot(&n2).atan2(n1.dot(&n2));
        let places =
            [(f1 + PI) / (2.0 * PI), (v.dot(&n2) + 1.0) / 2.0, (f3 + 1.0) / 2.0].map(|p| p * 11.0);
        let edge = places.iter().map(|p| (p - p.round()).abs()).fold(f64::INFINITY, f64::min);
        let clear = edge.min((a1.abs() - a2.abs()).abs()).min(e.normalize().cross(&n1).norm());
        (places.map(|p| p.floor().clamp(0.0, 10.0) as u8), clear)
    }

    fn bins(point: Facing, neighbour: Facing) -> [u8; 3] {
        let (mut lanes, mut bins) = (PairLanes::EMPTY, [[0; LANES]; 3]);
        lanes.set(0, &point, &neighbour);
        lanes.bins([point[3], point[4], point[5]], &mut bins);
        bins.map(|bins| bins[0])
    }

    fn facing(p: [f32; 3], n: [f32; 3]) -> Facing {
        [p[0], p[1], p[2], n[0], n[1], n[2], 0.0, 0.0]
    }

    #[test]
    fn the_edges_are_where_the_angle_s_bins_meet() {
        for (i, (cos, sin)) in (0..).zip(EDGES) {
            let angle = PI * f64::from(2 * i + 1) / 11.0;
            assert_eq!((cos, sin), (angle.cos() as f32, angle.sin() as f32));
        }
    }

    #[test]
    fn points_at_one_place_and_points_along_the_normal_fall_in_the_middle() {
        let z = [0.0, 0.0, 1.0];
        assert_eq!(
            bins(facing([1.0, 2.0, 3.0], z), facing([1.0, 2.0, 3.0], [1.0, 0.0, 0.0])),
            [5; 3]
        );
        assert_eq!(bins(facing([0.0; 3], z), facing([0.0, 0.0, 2.0], z)), [5; 3]);
    }

    #[test]
    fn opposed_normals_are_at_the_end_of_the_angle() {
        let end =
            bins(facing([0.0; 3], [0.0, 0.0, 1.0]), facing([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]))[0];
        assert!(end == 0 || end == 10, "{end}");
    }

    proptest! {
        #[test]
        fn bins_are_those_of_the_angle_and_the_same_from_both_ends(
            p in prop::array::uniform3(-2.0f32..2.0),
            q in prop::array::uniform3(-2.0f32..2.0),
            n in prop::array::uniform3(-1.0f32..1.0),
            m in prop::array::uniform3(-1.0f32..1.0),
        ) {
            let unit = |v: [f32; 3]| -> [f32; 3] { Vector3::from(v).normalize().into() };
            let (n, m) = (unit(n), unit(m));
            let f64s = |v: [f32; 3]| Vector3::from(v).cast::<f64>();
            let (expected, clear) = plain(f64s(q) - f64s(p), f64s(n), f64s(m));
            if clear > 1e-4 {
                prop_assert_eq!(bins(facing(p, n), facing(q, m)), expected);
                prop_assert_eq!(bins(facing(q, m), facing(p, n)), expected);
            }
        }
    }
}
