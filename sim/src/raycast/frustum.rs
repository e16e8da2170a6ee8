//! Boxes that any of some rays from one place may enter.

use super::wide_bvh::{Child, WIDTH, WideNode};

/// Relative bound on the rounding of the distance to a box: more than four operations of 2⁻²⁴ each.
const ROUNDING: f32 = 1e-6;

/// Initial capacity of the stack: more boxes than are usually pending.
pub(super) const DEPTH: usize = 64;

/// Rays that search for their nearest hit.
pub(super) trait Rays {
    /// Largest distance at which a hit still matters to one of the rays, metres.
    fn farthest_m(&self) -> f32;

    /// Intersects the rays with the triangles of a leaf.
    fn visit_leaf(&mut self, leaf: Child);
}

/// Bounds of rays from one place.
///
/// ```text
/// enter = max over axes of near · 1/d_max     near, far: sides of a box as the rays reach them
/// leave = min over axes of far · 1/d_min      d: the directions' components along the axis
/// ```
///
/// No ray enters a box before `enter` or leaves it after `leave`. Where some rays run along an axis
/// and others against it, `leave` is infinite and `enter` is taken from the side they start on.
pub(super) struct Frustum {
    origin: [f32; 3],
    axes: [AxisBounds; 3],
}

/// Bounds along one axis.
#[derive(Clone, Copy)]
struct AxisBounds {
    /// Index of the near side of a box: 0 the low one, 1 the high one.
    near: usize,
    /// 1/d of the ray that reaches the near side first.
    to_near: f32,
    /// 1/d of the ray that reaches the far side first from behind; 0 for none.
    from_behind: f32,
    /// 1/d of the ray that reaches the far side last; 0 when not all of them do.
    to_far: f32,
    /// Lower bound on `leave`, metres: infinite when not all rays reach the far side.
    leave_m: f32,
}

impl AxisBounds {
    fn new(least: f32, greatest: f32) -> Self {
        // Finite even for a ray square to the axis.
        let inverse = |d: f32| {
            1.0 / if d < 0.0 { d.min(-f32::MIN_POSITIVE) } else { d.max(f32::MIN_POSITIVE) }
        };
        let (sooner, later) = (1.0 - ROUNDING, 1.0 + ROUNDING);
        if greatest < 0.0 {
            let (to_near, to_far) = (inverse(least) * sooner, inverse(greatest) * later);
            return Self { near: 1, to_near, from_behind: 0.0, to_far, leave_m: 0.0 };
        }
        let to_near = inverse(greatest) * sooner;
        if least > 0.0 {
            let to_far = inverse(least) * later;
            return Self { near: 0, to_near, from_behind: 0.0, to_far, leave_m: 0.0 };
        }
        let from_behind = -inverse(-least) * sooner;
        Self { near: 0, to_near, from_behind, to_far: 0.0, leave_m: f32::INFINITY }
    }
}

impl Frustum {
    /// Bounds of rays along `directions`.
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], directions: &[[f32; 3]]) -> Self {
        let mut axes = [AxisBounds::new(0.0, 0.0); 3];
        for (axis, along) in axes.iter_mut().enumerate() {
            let (mut least, mut greatest) = (f32::INFINITY, f32::NEG_INFINITY);
            for direction in directions {
                least = least.min(direction[axis]);
                greatest = greatest.max(direction[axis]);
            }
            *along = AxisBounds::new(least, greatest);
        }
        Self { origin, axes }
    }

    /// Least distance to each box of a node; infinite for a box that no ray enters.
    #[inline(always)]
    fn enter(&self, node: &WideNode) -> [f32; WIDTH] {
        let (mut enter, mut leave) = ([0.0_f32; WIDTH], [f32::INFINITY; WIDTH]);
        for axis in 0..3 {
            let AxisBounds { near, to_near, from_behind, to_far, leave_m } = self.axes[axis];
            let (origin, bounds) = (self.origin[axis], &node.bounds[axis]);
            let (nears, fars) = (&bounds[near & 1], &bounds[1 - (near & 1)]);
            for k in 0..WIDTH {
                let (to, beyond) = (nears[k] - origin, fars[k] - origin);
                enter[k] = larger(enter[k], larger(to * to_near, beyond * from_behind));
                leave[k] = smaller(leave[k], larger(beyond * to_far, leave_m));
            }
        }
        for k in 0..WIDTH {
            let inside = (enter[k] <= leave[k]) & (leave[k] > 0.0);
            enter[k] = if inside { enter[k] } else { f32::INFINITY };
        }
        enter
    }

    /// Visits all leaves that the rays may hit, near ones first.
    #[inline(always)]
    pub(super) fn traverse(
        &self,
        nodes: &[WideNode],
        rays: &mut impl Rays,
        stack: &mut Vec<Pending>,
    ) {
        stack.clear();
        stack.push(Pending { enter_m: 0.0, child: Child::default() });
        while let Some(Pending { enter_m, child }) = stack.pop() {
            if enter_m > rays.farthest_m() {
                continue;
            }
            if child.count > 0 {
                rays.visit_leaf(child);
            } else if let Some(node) = nodes.get(child.first as usize) {
                self.push(node, rays.farthest_m(), stack);
            }
        }
    }

    /// Pushes the children of a node in falling order of distance, so that the nearest is popped
    /// first.
    #[inline(always)]
    fn push(&self, node: &WideNode, farthest_m: f32, stack: &mut Vec<Pending>) {
        let first = stack.len();
        let entered = self.enter(node).into_iter().zip(node.children);
        for (enter_m, child) in entered.take(node.used as usize) {
            if enter_m > farthest_m || enter_m == f32::INFINITY {
                continue;
            }
            let mut at = stack.len();
            stack.push(Pending { enter_m, child });
            while at > first && stack[at - 1].enter_m < enter_m {
                stack.swap(at - 1, at);
                at -= 1;
            }
        }
    }
}

/// Box to visit, with the distance to it.
#[derive(Clone, Copy)]
pub(super) struct Pending {
    enter_m: f32,
    child: Child,
}

// One instruction each: `f32::min` also handles NaN, and there is none here.
#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_random::Generator;

    /// Interval in which a ray is in a box, metres, by slabs in f64.
    fn span(origin: [f32; 3], direction: [f32; 3], low: [f32; 3], high: [f32; 3]) -> [f64; 2] {
        let mut span = [0.0, f64::INFINITY];
        for axis in 0..3 {
            let (o, d) = (f64::from(origin[axis]), f64::from(direction[axis]));
            let [a, b] = [low, high].map(|side| f64::from(side[axis]) - o);
            if d == 0.0 {
                span[1] = if a * b > 0.0 { f64::NEG_INFINITY } else { span[1] };
                continue;
            }
            span = [span[0].max((a / d).min(b / d)), span[1].min((a / d).max(b / d))];
        }
        span
    }

    fn node(boxes: &[[[f32; 3]; 2]; WIDTH]) -> WideNode {
        let mut node = WideNode { used: WIDTH as u32, ..WideNode::EMPTY };
        for (k, sides) in boxes.iter().enumerate() {
            for (axis, bounds) in node.bounds.iter_mut().enumerate() {
                (bounds[0][k], bounds[1][k]) = (sides[0][axis], sides[1][axis]);
            }
        }
        node
    }

    #[test]
    fn no_ray_enters_a_box_before_the_bound_or_one_that_the_frustum_skips() {
        let mut rng = Generator::new(21, 0);
        let (mut entered, mut skipped) = (0, 0);
        for round in 0..4000 {
            let origin: [f32; 3] = std::array::from_fn(|_| rng.spread(30.0) as f32);
            let boxes: [[[f32; 3]; 2]; WIDTH] = std::array::from_fn(|_| {
                let low: [f32; 3] = std::array::from_fn(|_| rng.spread(40.0) as f32);
                [low, low.map(|x| x + rng.range(0.01, 20.0) as f32)]
            });
            // From a single ray to rays all round, some of them along axes.
            let mut axis = rng.direction();
            axis[round % 3] *= [1.0, 0.0, 1e-9][round / 3 % 3];
            let width = [0.0, 1e-3, 0.05, 2.0][round % 4];
            let rays: Vec<[f32; 3]> = (0..1 + round % 25)
                .map(|_| std::array::from_fn(|i| (axis[i] + rng.spread(width)) as f32))
                .collect();
            let frustum = Frustum::new(origin, &rays);
            let enter = frustum.enter(&node(&boxes));
            for (k, [low, high]) in boxes.iter().enumerate() {
                let spans = rays.iter().map(|&ray| span(origin, ray, *low, *high));
                let first =
                    spans.filter(|[from, to]| from <= to && *to > 0.0).map(|[from, _]| from);
                let first = first.fold(f64::INFINITY, f64::min);
                assert!(f64::from(enter[k]) <= first, "{} after {first}", enter[k]);
                entered += usize::from(first < f64::INFINITY);
                skipped += usize::from(enter[k] == f32::INFINITY);
            }
        }
        assert!(entered > 1000 && skipped > 10_000, "{entered} {skipped}");
    }
}
