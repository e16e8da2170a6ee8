//! Which boxes any of some rays from one place may enter.

use super::wide_bvh::{Child, WIDTH, Wide};

/// More than what rounding does to where a ray enters a box, as a part of the distance: four
/// operations of 2⁻²⁴ each.
const ROUNDING: f32 = 1e-6;

/// More boxes than usually wait to be looked into.
pub(super) const DEPTH: usize = 64;

/// Rays that look for what they meet first.
pub(super) trait Rays {
    /// How far the one still has to look that has to look farthest, metres.
    fn farthest_m(&self) -> f32;

    /// Looks at the triangles of a leaf.
    fn meet(&mut self, leaf: Child);
}

/// What bounds rays from one place.
///
/// ```text
/// enter = max over axes of near · 1/d_max     near, far: a box's sides as the rays come to them
/// leave = min over axes of far · 1/d_min      d: the directions' components along the axis
/// ```
///
/// No ray enters a box before `enter` or leaves it after `leave`. Where some rays run along an axis
/// and others against it they may leave at any time, and `enter` is of the side they start from.
pub(super) struct Frustum {
    origin: [f32; 3],
    axes: [Along; 3],
}

/// Along one axis.
#[derive(Clone, Copy)]
struct Along {
    /// Which side of a box comes first: 0 the low one, 1 the high one.
    near: usize,
    /// 1/d of the ray that gets to the near side first.
    to_near: f32,
    /// 1/d of the one that gets first to the far side from behind; 0: there is none.
    from_behind: f32,
    /// 1/d of the ray that gets to the far side last; 0: not all of them get there.
    to_far: f32,
    /// Leaves no earlier than that: infinite when not all get to the far side.
    leave_m: f32,
}

impl Along {
    fn new(least: f32, greatest: f32) -> Self {
        // Also of a ray that does not run along the axis at all, finite.
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
    /// Of rays along such directions.
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], directions: &[[f32; 3]]) -> Self {
        let mut axes = [Along::new(0.0, 0.0); 3];
        for (axis, along) in axes.iter_mut().enumerate() {
            let (mut least, mut greatest) = (f32::INFINITY, f32::NEG_INFINITY);
            for direction in directions {
                least = least.min(direction[axis]);
                greatest = greatest.max(direction[axis]);
            }
            *along = Along::new(least, greatest);
        }
        Self { origin, axes }
    }

    /// Where rays may enter each box of a node; infinite where none can.
    #[inline(always)]
    fn enter(&self, node: &Wide) -> [f32; WIDTH] {
        let (mut enter, mut leave) = ([0.0_f32; WIDTH], [f32::INFINITY; WIDTH]);
        for axis in 0..3 {
            let Along { near, to_near, from_behind, to_far, leave_m } = self.axes[axis];
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

    /// Shows rays all leaves that they may meet something in, near ones first.
    #[inline(always)]
    pub(super) fn traverse(&self, nodes: &[Wide], rays: &mut impl Rays, stack: &mut Vec<Pending>) {
        stack.clear();
        stack.push(Pending { enter_m: 0.0, child: Child::default() });
        while let Some(Pending { enter_m, child }) = stack.pop() {
            if enter_m > rays.farthest_m() {
                continue;
            }
            if child.count > 0 {
                rays.meet(child);
            } else if let Some(node) = nodes.get(child.first as usize) {
                self.push(node, rays.farthest_m(), stack);
            }
        }
    }

    /// The nearest goes on the stack last.
    #[inline(always)]
    fn push(&self, node: &Wide, farthest_m: f32, stack: &mut Vec<Pending>) {
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

/// A box to look into.
#[derive(Clone, Copy)]
pub(super) struct Pending {
    enter_m: f32,
    child: Child,
}

// One instruction each; `f32::min` looks for NaN, too, of which there are none.
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

    /// Where a ray is in a box, metres, by slabs in f64.
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

    fn node(boxes: &[[[f32; 3]; 2]; WIDTH]) -> Wide {
        let mut node = Wide { used: WIDTH as u32, ..Wide::EMPTY };
        for (k, sides) in boxes.iter().enumerate() {
            for (axis, bounds) in node.bounds.iter_mut().enumerate() {
                (bounds[0][k], bounds[1][k]) = (sides[0][axis], sides[1][axis]);
            }
        }
        node
    }

    #[test]
    fn no_ray_of_the_frustum_is_in_a_box_before_it_says_or_in_one_that_it_leaves_out() {
        let mut rng = Generator::new(21, 0);
        let (mut entered, mut left_out) = (0, 0);
        for round in 0..4000 {
            let origin: [f32; 3] = std::array::from_fn(|_| rng.spread(30.0) as f32);
            let boxes: [[[f32; 3]; 2]; WIDTH] = std::array::from_fn(|_| {
                let low: [f32; 3] = std::array::from_fn(|_| rng.spread(40.0) as f32);
                [low, low.map(|x| x + rng.range(0.01, 20.0) as f32)]
            });
            // From one ray to rays all round; along axes, too.
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
                left_out += usize::from(enter[k] == f32::INFINITY);
            }
        }
        assert!(entered > 1000 && left_out > 10_000, "{entered} {left_out}");
    }
}
