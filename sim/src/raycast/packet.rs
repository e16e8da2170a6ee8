//! Many rays from one place at a time.
//!
//! The sub-rays of a beam lie within milliradians, so they visit nearly the same boxes. What one
//! ray meets does not depend on those beside it: each lane is computed as it would be alone. The
//! loops over lanes are loops, not closures, which would not be compiled for the vector unit.

use echoloop_dispatch::dispatch;

use super::frustum::{DEPTH, Frustum, Pending, Rays, larger, smaller};
use super::triangle::{Sheared, Triangle, axes, steepest};
use super::wide_bvh::{Child, Wide};

/// Rays at a time: as many as a beam has by default, 25, and what fills vectors.
pub(super) const LANES: usize = 32;

type Lanes = [f32; LANES];

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Meeting {
    /// The triangle, in the order of the hierarchy's leaves; [`Meeting::NOTHING`]'s for none.
    pub(super) slot: u32,
    /// Metres.
    pub(super) range_m: f32,
    /// The triangle in its mesh: of two in the same distance the later one counts, whatever the
    /// hierarchy. What is modelled later lies on what was there, as paint does.
    index: u32,
}

impl Meeting {
    /// No triangle up to a distance.
    const fn nothing_within(range_m: f32) -> Self {
        Self { slot: u32::MAX, range_m, index: u32::MAX }
    }

    /// None at all.
    pub(super) const NOTHING: Self = Self::nothing_within(f32::INFINITY);

    #[inline(always)]
    fn offer(&mut self, slot: u32, range_m: f32, index: u32) {
        let later = (range_m == self.range_m) & (index > self.index);
        if (range_m < self.range_m) | later {
            *self = Self { slot, range_m, index };
        }
    }
}

dispatch! {
    /// What each of up to [`LANES`] directions meets first.
    pub(super) fn nearest(
        nodes: &[Wide],
        triangles: &[Triangle],
        origin: [f32; 3],
        directions: &[[f32; 3]],
        stack: &mut Vec<Pending>,
    ) -> [Meeting; LANES] = nearest_inline;

    /// What one direction meets first within a distance, metres.
    pub(super) fn nearest_alone(
        nodes: &[Wide],
        triangles: &[Triangle],
        origin: [f32; 3],
        direction: [f32; 3],
        within_m: f32,
    ) -> Meeting = nearest_alone_inline;
}

#[inline(always)]
fn nearest_inline(
    nodes: &[Wide],
    triangles: &[Triangle],
    origin: [f32; 3],
    directions: &[[f32; 3]],
    stack: &mut Vec<Pending>,
) -> [Meeting; LANES] {
    let mut meetings = [Meeting::NOTHING; LANES];
    for axis in 0..3 {
        let (mut lanes, mut along, mut count) = ([0; LANES], [[0.0; 3]; LANES], 0);
        for (lane, &direction) in directions.iter().enumerate().take(LANES) {
            if steepest(direction) == axis {
                (lanes[count], along[count]) = (lane, direction);
                count += 1;
            }
        }
        if count > 0 {
            let along = &along[..count];
            let mut packet = Packet::new(triangles, origin, axis, along);
            Frustum::new(origin, along).traverse(nodes, &mut packet, stack);
            for (k, &lane) in lanes.iter().enumerate().take(count) {
                meetings[lane] = packet.meeting(k);
            }
        }
    }
    meetings
}

#[inline(always)]
fn nearest_alone_inline(
    nodes: &[Wide],
    triangles: &[Triangle],
    origin: [f32; 3],
    direction: [f32; 3],
    within_m: f32,
) -> Meeting {
    let (ray, meeting) = (Sheared::new(origin, direction), Meeting::nothing_within(within_m));
    let mut alone = Alone { triangles, ray, meeting };
    let mut stack = Vec::with_capacity(DEPTH);
    Frustum::new(origin, &[direction]).traverse(nodes, &mut alone, &mut stack);
    alone.meeting
}

/// One ray, and what it has met.
struct Alone<'a> {
    triangles: &'a [Triangle],
    ray: Sheared,
    meeting: Meeting,
}

impl Rays for Alone<'_> {
    #[inline(always)]
    fn farthest_m(&self) -> f32 {
        self.meeting.range_m
    }

    #[inline(always)]
    fn meet(&mut self, leaf: Child) {
        for slot in leaf.first..leaf.first + leaf.count {
            let triangle = &self.triangles[slot as usize];
            let range_m = self.ray.meets(&triangle.corners);
            self.meeting.offer(slot, range_m, triangle.index);
        }
    }
}

/// Rays that run along the same axis, and what they have met.
struct Packet<'a> {
    triangles: &'a [Triangle],
    origin: [f32; 3],
    axes: [usize; 3],
    shear: [Lanes; 3],
    /// Distance of the nearest triangle so far; of a lane without a ray, −∞.
    range_m: Lanes,
    /// The greatest of them.
    farthest_m: f32,
    /// The triangle, and its number in the mesh, as [`Meeting`] has them.
    slot: [u32; LANES],
    index: [u32; LANES],
}

impl<'a> Packet<'a> {
    /// Of rays that run along `z`; lanes without a ray repeat the last.
    #[inline(always)]
    fn new(triangles: &'a [Triangle], origin: [f32; 3], z: usize, directions: &[[f32; 3]]) -> Self {
        let axes = axes(z);
        let mut way = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let direction = &directions[lane.min(directions.len() - 1)];
            for axis in 0..3 {
                way[axis][lane] = direction[axes[axis]];
            }
        }
        let mut shear = way;
        for lane in 0..LANES {
            shear[0][lane] = way[0][lane] / way[2][lane];
            shear[1][lane] = way[1][lane] / way[2][lane];
            shear[2][lane] = 1.0 / way[2][lane];
        }
        let mut range_m = [f32::NEG_INFINITY; LANES];
        range_m[..directions.len()].fill(f32::INFINITY);
        let (slot, index) = ([u32::MAX; LANES], [u32::MAX; LANES]);
        Self { triangles, origin, axes, shear, range_m, farthest_m: f32::INFINITY, slot, index }
    }

    fn meeting(&self, lane: usize) -> Meeting {
        Meeting { slot: self.slot[lane], range_m: self.range_m[lane], index: self.index[lane] }
    }

    /// [`Sheared::meets`] of all rays, and [`Meeting::offer`].
    #[inline(always)]
    fn meet_one(&mut self, slot: u32, triangle: &Triangle) {
        let [a, b, c] = &triangle.corners;
        let [a, b, c] = [self.shift(a), self.shift(b), self.shift(c)];
        let edges = [edge(&c, &b), edge(&a, &c), edge(&b, &a)];
        let (mut nearest_edge, mut outside) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let [u, v, w] = [edges[0][lane], edges[1][lane], edges[2][lane]];
            nearest_edge[lane] = smaller(smaller(u.abs(), v.abs()), w.abs());
            let one_sign = (smaller(smaller(u, v), w) > 0.0) | (larger(larger(u, v), w) < 0.0);
            outside[lane] = if one_sign { 0.0 } else { 1.0 };
        }
        if least(nearest_edge) == 0.0 {
            return self.meet_on_an_edge(slot, triangle);
        }
        if least(outside) > 0.0 {
            return;
        }
        for lane in 0..LANES {
            let [u, v, w] = [edges[0][lane], edges[1][lane], edges[2][lane]];
            let whole = u + v + w;
            let depth = (u * a[2][lane] + v * b[2][lane] + w * c[2][lane]) / whole;
            let met = (outside[lane] == 0.0) & (whole != 0.0) & (depth > 0.0);
            let later = (depth == self.range_m[lane]) & (triangle.index > self.index[lane]);
            let nearer = met & ((depth < self.range_m[lane]) | later);
            self.slot[lane] = if nearer { slot } else { self.slot[lane] };
            self.index[lane] = if nearer { triangle.index } else { self.index[lane] };
            self.range_m[lane] = if nearer { depth } else { self.range_m[lane] };
        }
    }

    /// The same where a ray meets an edge, as far as `f32` can tell: one by one.
    #[cold]
    fn meet_on_an_edge(&mut self, slot: u32, triangle: &Triangle) {
        for lane in 0..LANES {
            let shear = self.shear.map(|axis| axis[lane]);
            let ray = Sheared { origin: self.origin, axes: self.axes, shear };
            let mut meeting = self.meeting(lane);
            meeting.offer(slot, ray.meets(&triangle.corners), triangle.index);
            (self.slot[lane], self.range_m[lane], self.index[lane]) =
                (meeting.slot, meeting.range_m, meeting.index);
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

impl Rays for Packet<'_> {
    #[inline(always)]
    fn farthest_m(&self) -> f32 {
        self.farthest_m
    }

    #[inline(always)]
    fn meet(&mut self, leaf: Child) {
        for slot in leaf.first..leaf.first + leaf.count {
            let triangle = self.triangles[slot as usize];
            self.meet_one(slot, &triangle);
        }
        self.farthest_m = greatest(self.range_m);
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

#[inline(always)]
fn greatest(mut lanes: Lanes) -> f32 {
    for lane in &mut lanes {
        *lane = -*lane;
    }
    -least(lanes)
}

// Written out: a function to be called for each pair would not be compiled for the vector unit.
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
