//! Packets of rays from one place.
//!
//! The sub-rays of a beam lie within milliradians of each other and visit nearly the same boxes.
//! Each lane is computed as it would be alone, so a hit does not depend on the other rays. The
//! loops over lanes are written out, because closures are not vectorised here.

use echoloop_dispatch::dispatch;

use super::frustum::{DEPTH, Frustum, Pending, Rays, larger, smaller};
use super::triangle::{ShearedRay, Triangle, axes, dominant_axis};
use super::wide_bvh::{Child, WideNode};

/// Lanes of a packet: the 25 sub-rays of a default beam, rounded up to whole vectors.
pub(super) const LANES: usize = 32;

type Lanes = [f32; LANES];

/// Nearest hit of a ray so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LeafHit {
    /// Index of the triangle in the order of the leaves; that of [`LeafHit::MISS`] for none.
    pub(super) slot: u32,
    /// Metres.
    pub(super) range_m: f32,
    /// Index of the triangle in its mesh. The later one wins a tie in distance, in any hierarchy: a
    /// surface modelled later, such as paint, lies on the earlier one.
    index: u32,
}

impl LeafHit {
    /// No hit within a distance.
    const fn miss_within(range_m: f32) -> Self {
        Self { slot: u32::MAX, range_m, index: u32::MAX }
    }

    /// No hit at any distance.
    pub(super) const MISS: Self = Self::miss_within(f32::INFINITY);

    #[inline(always)]
    fn offer(&mut self, slot: u32, range_m: f32, index: u32) {
        let later = (range_m == self.range_m) & (index > self.index);
        if (range_m < self.range_m) | later {
            *self = Self { slot, range_m, index };
        }
    }
}

dispatch! {
    /// Nearest hit along each of up to [`LANES`] directions.
    pub(super) fn nearest(
        nodes: &[WideNode],
        triangles: &[Triangle],
        origin: [f32; 3],
        directions: &[[f32; 3]],
        stack: &mut Vec<Pending>,
    ) -> [LeafHit; LANES] = nearest_inline;

    /// Nearest hit along one direction within a distance, metres.
    pub(super) fn nearest_single(
        nodes: &[WideNode],
        triangles: &[Triangle],
        origin: [f32; 3],
        direction: [f32; 3],
        within_m: f32,
    ) -> LeafHit = nearest_single_inline;
}

#[inline(always)]
fn nearest_inline(
    nodes: &[WideNode],
    triangles: &[Triangle],
    origin: [f32; 3],
    directions: &[[f32; 3]],
    stack: &mut Vec<Pending>,
) -> [LeafHit; LANES] {
    let mut hits_of_lanes = [LeafHit::MISS; LANES];
    for axis in 0..3 {
        let (mut lanes, mut along, mut count) = ([0; LANES], [[0.0; 3]; LANES], 0);
        for (lane, &direction) in directions.iter().enumerate().take(LANES) {
            if dominant_axis(direction) == axis {
                (lanes[count], along[count]) = (lane, direction);
                count += 1;
            }
        }
        if count > 0 {
            let along = &along[..count];
            let mut packet = Packet::new(triangles, origin, axis, along);
            Frustum::new(origin, along).traverse(nodes, &mut packet, stack);
            for (k, &lane) in lanes.iter().enumerate().take(count) {
                hits_of_lanes[lane] = packet.hit(k);
            }
        }
    }
    hits_of_lanes
}

#[inline(always)]
fn nearest_single_inline(
    nodes: &[WideNode],
    triangles: &[Triangle],
    origin: [f32; 3],
    direction: [f32; 3],
    within_m: f32,
) -> LeafHit {
    let (ray, hit) = (ShearedRay::new(origin, direction), LeafHit::miss_within(within_m));
    let mut single = SingleRay { triangles, ray, hit };
    let mut stack = Vec::with_capacity(DEPTH);
    Frustum::new(origin, &[direction]).traverse(nodes, &mut single, &mut stack);
    single.hit
}

/// One ray with its nearest hit so far.
struct SingleRay<'a> {
    triangles: &'a [Triangle],
    ray: ShearedRay,
    hit: LeafHit,
}

impl Rays for SingleRay<'_> {
    #[inline(always)]
    fn farthest_m(&self) -> f32 {
        self.hit.range_m
    }

    #[inline(always)]
    fn visit_leaf(&mut self, leaf: Child) {
        for slot in leaf.first..leaf.first + leaf.count {
            let triangle = &self.triangles[slot as usize];
            let range_m = self.ray.distance_m(&triangle.corners);
            self.hit.offer(slot, range_m, triangle.index);
        }
    }
}

/// Rays with the same dominant axis, and their nearest hits so far.
struct Packet<'a> {
    triangles: &'a [Triangle],
    origin: [f32; 3],
    axes: [usize; 3],
    shear: [Lanes; 3],
    /// Distance of the nearest hit so far, metres; −∞ for an unused lane.
    range_m: Lanes,
    /// Largest of `range_m`.
    farthest_m: f32,
    /// Triangle of the nearest hit, as in [`LeafHit`].
    slot: [u32; LANES],
    index: [u32; LANES],
}

impl<'a> Packet<'a> {
    /// Packet of rays with the dominant axis `z`; unused lanes repeat the last ray.
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

    fn hit(&self, lane: usize) -> LeafHit {
        LeafHit { slot: self.slot[lane], range_m: self.range_m[lane], index: self.index[lane] }
    }

    /// [`ShearedRay::distance_m`] and [`LeafHit::offer`] for all lanes.
    #[inline(always)]
    fn intersect(&mut self, slot: u32, triangle: &Triangle) {
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
            return self.intersect_edge(slot, triangle);
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

    /// As [`Packet::intersect`], lane by lane, where a ray is on an edge as far as `f32` can tell.
    #[cold]
    fn intersect_edge(&mut self, slot: u32, triangle: &Triangle) {
        for lane in 0..LANES {
            let shear = self.shear.map(|axis| axis[lane]);
            let ray = ShearedRay { origin: self.origin, axes: self.axes, shear };
            let mut hit = self.hit(lane);
            hit.offer(slot, ray.distance_m(&triangle.corners), triangle.index);
            (self.slot[lane], self.range_m[lane], self.index[lane]) =
                (hit.slot, hit.range_m, hit.index);
        }
    }

    /// Corner in the sheared coordinates of each ray.
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
    fn visit_leaf(&mut self, leaf: Child) {
        for slot in leaf.first..leaf.first + leaf.count {
            let triangle = self.triangles[slot as usize];
            self.intersect(slot, &triangle);
        }
        self.farthest_m = greatest(self.range_m);
    }
}

/// Sign of the side of an edge on which each ray passes.
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

// Written out: calls for each pair of lanes would not be vectorised.
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
