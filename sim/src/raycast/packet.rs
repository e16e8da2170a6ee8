//! Many rays from one place at a time.
//!
//! The sub-rays of a beam lie within milliradians, so they visit nearly the same boxes. What one
//! ray meets does not depend on those beside it: each lane is computed as it would be alone. The
//! loops over lanes are loops, not closures, which would not be compiled for the vector unit.

use echoloop_dispatch::dispatch;
use obvhs::bvh2::node::Bvh2Node;

use super::triangle::{Sheared, Triangle};

/// Rays at a time: as many as a beam has by default, 25, and what fills vectors. Four packets of
/// eight take longer.
const LANES: usize = 32;

type Lanes = [f32; LANES];

/// A box of the hierarchy. Two to a cache line; those of one parent are neighbours.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(super) struct Node {
    low: [f32; 3],
    /// Of its first child, or of its first triangle.
    first: u32,
    high: [f32; 3],
    /// Triangles in it; 0: it has children.
    count: u32,
}

impl From<&Bvh2Node> for Node {
    fn from(node: &Bvh2Node) -> Self {
        let bounds = node.aabb();
        let (low, high) = (bounds.min.into(), bounds.max.into());
        Self { low, first: node.first_index, high, count: node.prim_count }
    }
}

dispatch! {
    /// Adds what each direction meets first.
    pub(super) fn nearest(
        nodes: &[Node],
        triangles: &[Triangle],
        origin: [f32; 3],
        directions: &[[f32; 3]],
        meetings: &mut Vec<Meeting>,
    ) = nearest_inline;
}

#[inline(always)]
fn nearest_inline(
    nodes: &[Node],
    triangles: &[Triangle],
    origin: [f32; 3],
    directions: &[[f32; 3]],
    meetings: &mut Vec<Meeting>,
) {
    let mut stack = Vec::with_capacity(64);
    for directions in directions.chunks(LANES) {
        let packet = Packet::new(origin, directions);
        let Some(mut packet) = packet else {
            meetings.extend(directions.iter().map(|_| Meeting::Unknown));
            continue;
        };
        packet.traverse(nodes, triangles, &mut stack);
        meetings.extend((0..directions.len()).map(|lane| packet.meeting(lane)));
    }
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meeting {
    Nothing,
    /// A triangle's slot, and the distance.
    One(u32, f32),
    /// To be cast alone: it meets triangles in one place, of which the order decides in which they
    /// are found, or runs along another axis than those beside it.
    Unknown,
}

/// Rays that run along the same axis, and what they have met.
struct Packet {
    origin: [f32; 3],
    inverse: [Lanes; 3],
    axes: [usize; 3],
    shear: [Lanes; 3],
    /// Distance of the nearest triangle so far; of a lane without a ray, −∞.
    range_m: Lanes,
    /// The triangle.
    slot: [u32; LANES],
    /// Whether another is in the same distance: 0 or 1.
    tied: [u32; LANES],
}

impl Packet {
    /// Lanes without a ray repeat the last; `None` when they run along more axes than one.
    fn new(origin: [f32; 3], directions: &[[f32; 3]]) -> Option<Self> {
        let of = |lane: usize| directions[lane.min(directions.len() - 1)];
        let sheared: [Sheared; LANES] = std::array::from_fn(|lane| Sheared::new(origin, of(lane)));
        if sheared.iter().any(|ray| ray.axes != sheared[0].axes) {
            return None;
        }
        let farthest =
            |lane| if lane < directions.len() { f32::INFINITY } else { f32::NEG_INFINITY };
        Some(Self {
            origin,
            inverse: [0, 1, 2].map(|i| std::array::from_fn(|lane| inverse(of(lane)[i]))),
            axes: sheared[0].axes,
            shear: [0, 1, 2].map(|i| std::array::from_fn(|lane| sheared[lane].shear[i])),
            range_m: std::array::from_fn(farthest),
            slot: [u32::MAX; LANES],
            tied: [0; LANES],
        })
    }

    fn meeting(&self, lane: usize) -> Meeting {
        match (self.slot[lane], self.tied[lane]) {
            (u32::MAX, _) => Meeting::Nothing,
            (slot, 0) => Meeting::One(slot, self.range_m[lane]),
            _ => Meeting::Unknown,
        }
    }

    /// Visits what any of the rays may meet, near boxes first.
    #[inline(always)]
    fn traverse(&mut self, nodes: &[Node], triangles: &[Triangle], stack: &mut Vec<u32>) {
        if let Some(root) = nodes.first() {
            self.visit([root], triangles, stack);
        }
        while let Some(first) = stack.pop() {
            if let Some([left, right]) = nodes.get(first as usize..).and_then(|n| n.first_chunk()) {
                self.visit([left, right], triangles, stack);
            }
        }
    }

    /// Meets the triangles of those that are leaves; the children of the others go on the stack,
    /// those of the nearest last.
    #[inline(always)]
    fn visit<const N: usize>(
        &mut self,
        siblings: [&Node; N],
        triangles: &[Triangle],
        stack: &mut Vec<u32>,
    ) {
        let mut entered = siblings.map(|node| (node, Entry::NOWHERE));
        for (node, entry) in &mut entered {
            *entry = self.enter(node);
        }
        if N == 2 && entered[1].1.nearest_m < entered[0].1.nearest_m {
            entered.reverse();
        }
        for (node, entry) in entered.iter().rev() {
            if entry.nearest_m < f32::INFINITY && node.count == 0 {
                stack.push(node.first);
            }
        }
        for (node, entry) in &entered {
            if entry.nearest_m < f32::INFINITY && node.count > 0 {
                for slot in node.first..node.first + node.count {
                    self.meet(slot, &triangles[slot as usize], &entry.range_m);
                }
            }
        }
    }

    /// Where the rays enter a box that is nearer than what they have met.
    #[inline(always)]
    fn enter(&self, node: &Node) -> Entry {
        let (mut enter, mut leave) = ([f32::NEG_INFINITY; LANES], [f32::INFINITY; LANES]);
        for axis in 0..3 {
            let low = node.low[axis] - self.origin[axis];
            let high = node.high[axis] - self.origin[axis];
            for lane in 0..LANES {
                let (a, b) = (low * self.inverse[axis][lane], high * self.inverse[axis][lane]);
                enter[lane] = larger(enter[lane], smaller(a, b));
                leave[lane] = smaller(leave[lane], larger(a, b));
            }
        }
        let mut range_m = [f32::INFINITY; LANES];
        for lane in 0..LANES {
            let inside = leave[lane] >= larger(enter[lane], 0.0);
            let within = inside & (enter[lane] < self.range_m[lane]);
            range_m[lane] = if within { enter[lane] } else { f32::INFINITY };
        }
        Entry { nearest_m: least(range_m), range_m }
    }

    /// [`Sheared::meets`] of all rays that have entered the triangle's box.
    #[inline(always)]
    fn meet(&mut self, slot: u32, triangle: &Triangle, entry_m: &Lanes) {
        let [a, b, c] = &triangle.corners;
        let [a, b, c] = [self.shift(a), self.shift(b), self.shift(c)];
        let edges = [edge(&c, &b), edge(&a, &c), edge(&b, &a)];
        let mut nearest_edge = [0.0; LANES];
        for lane in 0..LANES {
            let [u, v, w] = [edges[0][lane].abs(), edges[1][lane].abs(), edges[2][lane].abs()];
            nearest_edge[lane] = smaller(smaller(u, v), w);
        }
        if least(nearest_edge) == 0.0 {
            return self.meet_on_an_edge(slot, triangle, entry_m);
        }
        for lane in 0..LANES {
            let [u, v, w] = [edges[0][lane], edges[1][lane], edges[2][lane]];
            let one_sign = (smaller(smaller(u, v), w) > 0.0) | (larger(larger(u, v), w) < 0.0);
            let whole = u + v + w;
            let depth = (u * a[2][lane] + v * b[2][lane] + w * c[2][lane]) / whole;
            let met = one_sign & (whole != 0.0) & (depth > 0.0) & (entry_m[lane] < f32::INFINITY);
            let (nearer, tied) = (depth < self.range_m[lane], depth == self.range_m[lane]);
            self.tied[lane] = if met & tied { 1 } else { self.tied[lane] };
            self.tied[lane] = if met & nearer { 0 } else { self.tied[lane] };
            self.slot[lane] = if met & nearer { slot } else { self.slot[lane] };
            self.range_m[lane] = if met & nearer { depth } else { self.range_m[lane] };
        }
    }

    /// The same where a ray meets an edge, as far as `f32` can tell: one by one.
    #[cold]
    fn meet_on_an_edge(&mut self, slot: u32, triangle: &Triangle, entry_m: &Lanes) {
        for (lane, entry_m) in entry_m.iter().enumerate() {
            let shear = self.shear.map(|axis| axis[lane]);
            let ray = Sheared { origin: self.origin, axes: self.axes, shear };
            let depth = ray.meets(&triangle.corners);
            if *entry_m == f32::INFINITY || depth == f32::INFINITY {
                continue;
            }
            if depth < self.range_m[lane] {
                (self.range_m[lane], self.slot[lane], self.tied[lane]) = (depth, slot, 0);
            } else if depth == self.range_m[lane] {
                self.tied[lane] = 1;
            }
        }
    }

    /// A corner as each ray sees it.
    #[inline(always)]
    fn shift(&self, corner: &[f32; 3]) -> [Lanes; 3] {
        let [i, j, k] = self.axes;
        let x = corner[i] - self.origin[i];
        let y = corner[j] - self.origin[j];
        let z = corner[k] - self.origin[k];
        let mut shifted = self.shear;
        let [to_x, to_y, to_z] = &mut shifted;
        for ((to_x, to_y), to_z) in to_x.iter_mut().zip(to_y).zip(to_z) {
            (*to_x, *to_y, *to_z) = (x - *to_x * z, y - *to_y * z, *to_z * z);
        }
        shifted
    }
}

/// On which side of the edge between two corners the rays pass.
#[inline(always)]
fn edge(p: &[Lanes; 3], q: &[Lanes; 3]) -> Lanes {
    let mut side = [0.0; LANES];
    for lane in 0..LANES {
        side[lane] = p[0][lane] * q[1][lane] - p[1][lane] * q[0][lane];
    }
    side
}

/// Where rays enter a box.
struct Entry {
    /// The first of them; infinite where none does.
    nearest_m: f32,
    /// Each; infinite where it does not.
    range_m: Lanes,
}

impl Entry {
    const NOWHERE: Self = Self { nearest_m: f32::INFINITY, range_m: [f32::INFINITY; LANES] };
}

/// 1/x, as the hierarchy wants it: finite.
fn inverse(x: f32) -> f32 {
    if x.abs() <= f32::EPSILON { x.signum() / f32::EPSILON } else { 1.0 / x }
}

// One instruction each; `f32::min` looks for NaN, too, of which there are none.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn least(mut lanes: Lanes) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            lanes[lane] = smaller(lanes[lane], lanes[lane + half]);
        }
        half /= 2;
    }
    lanes[0]
}
