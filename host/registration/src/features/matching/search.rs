//! Eight queries go down a tree together.

use super::build::Build;
#[cfg(target_arch = "x86_64")]
use super::build::V3;
use super::kernel::{Kernel, Lanes, Portable};
use super::rotation::{AXES, Rotation};
use super::row::{Row, WIDTH, squared_distance};
use super::tree::{Block, NONE, Node, Tree};
use crate::features::{DIMENSIONS, Match};

/// Deeper than any tree of `u32` indices halved at each level, of which one child waits while the
/// other is searched.
const DEPTH: usize = 40;

/// No bound is below it: a query with this limit is over.
const OVER: f32 = -1.0;

/// What a query is after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The nearest row.
    Nearest,
    /// Any row nearer than the one that is known.
    Counterexample,
}

/// Eight queries and the nearest row of each so far.
#[derive(Clone, Debug)]
pub(super) struct Group {
    axes: Block,
    rows: [Row; WIDTH],
    index: [u32; WIDTH],
    /// Squared distance of the nearest.
    squared: Lanes,
    /// Index of the nearest among the rows that the tree was made of; [`NONE`] before the first.
    pub(super) nearest: [u32; WIDTH],
    /// Bounds above it are of no interest: [`Rotation::limit`] of `squared`.
    limit: Lanes,
}

impl Group {
    fn empty() -> Self {
        Self {
            axes: [[0.0; WIDTH]; AXES],
            rows: [[0.0; DIMENSIONS]; WIDTH],
            index: [NONE; WIDTH],
            squared: [f32::INFINITY; WIDTH],
            nearest: [NONE; WIDTH],
            limit: [OVER; WIDTH],
        }
    }

    fn put(&mut self, lane: usize, queries: &Tree, slot: usize) {
        for (ours, theirs) in self.axes.iter_mut().zip(&queries.blocks[slot / WIDTH]) {
            ours[lane] = theirs[slot % WIDTH];
        }
        self.rows[lane] = queries.rows[slot];
        self.index[lane] = queries.index[slot];
    }

    /// The rows of a block, of which nothing is known.
    pub(super) fn unbounded(queries: &Tree, block: usize) -> Self {
        let mut group = Self::empty();
        for (lane, slot) in (block * WIDTH..(block + 1) * WIDTH).enumerate() {
            if queries.index[slot] != NONE {
                group.put(lane, queries, slot);
                group.limit[lane] = f32::INFINITY;
            }
        }
        group
    }

    /// The targets in `slots`, at most eight, each with the closest of the sources that chose it.
    pub(super) fn claimed(
        targets: &Tree,
        slots: &[usize],
        claims: &[Option<Match>],
        rotation: &Rotation,
    ) -> Self {
        let mut group = Self::empty();
        for (lane, &slot) in slots.iter().enumerate().take(WIDTH) {
            if let Some(claim) = claims[targets.index[slot] as usize] {
                group.put(lane, targets, slot);
                group.squared[lane] = claim.squared;
                group.nearest[lane] = claim.source;
                group.limit[lane] = rotation.limit(claim.squared);
            }
        }
        group
    }

    /// The queries, as sources, with what they found.
    pub(super) fn matches(&self) -> impl Iterator<Item = Match> {
        let lane = |lane: usize| Match {
            source: self.index[lane],
            target: self.nearest[lane],
            squared: self.squared[lane],
        };
        (0..WIDTH).map(lane).filter(|m| m.target != NONE)
    }

    /// Goes down `tree`, the nearer box first.
    pub(super) fn search(
        &mut self,
        build: Build,
        rotation: &Rotation,
        tree: &Tree,
        wanted: Wanted,
    ) {
        match build {
            Build::Baseline => self.search_inline(Portable, rotation, tree, wanted),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a V3 exists only where the features that search_v3 is compiled for have been
            // found.
            Build::V3(kernel) => unsafe { self.search_v3(kernel, rotation, tree, wanted) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn search_v3(&mut self, kernel: V3, rotation: &Rotation, tree: &Tree, wanted: Wanted) {
        self.search_inline(kernel, rotation, tree, wanted);
    }

    #[inline(always)]
    fn search_inline<K: Kernel>(
        &mut self,
        kernel: K,
        rotation: &Rotation,
        tree: &Tree,
        wanted: Wanted,
    ) {
        if tree.nodes.is_empty() {
            return;
        }
        let mut waiting = [(0_u32, [0.0; WIDTH]); DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (mut at, mut bounds) = waiting[count];
            let mut open = kernel.not_above(&bounds, &self.limit);
            while open != 0 {
                let node = &tree.nodes[at as usize];
                if node.second == 0 {
                    self.search_leaf(kernel, rotation, tree, node, open, wanted);
                    break;
                }
                let (first, second) = (at + 1, node.second);
                let to_first = kernel.box_bounds(&self.axes, &tree.nodes[first as usize]);
                let to_second = kernel.box_bounds(&self.axes, &tree.nodes[second as usize]);
                let near_first = sum(&to_first, &self.limit) <= sum(&to_second, &self.limit);
                let (near, far) = if near_first {
                    ((first, to_first), (second, to_second))
                } else {
                    ((second, to_second), (first, to_first))
                };
                if kernel.not_above(&far.1, &self.limit) != 0 {
                    waiting[count] = far;
                    count += 1;
                }
                (at, bounds) = near;
                open = kernel.not_above(&bounds, &self.limit);
            }
        }
    }

    #[inline(always)]
    fn search_leaf<K: Kernel>(
        &mut self,
        kernel: K,
        rotation: &Rotation,
        tree: &Tree,
        leaf: &Node,
        mut open: u32,
        wanted: Wanted,
    ) {
        while open != 0 {
            let lane = open.trailing_zeros() as usize;
            open &= open - 1;
            for block in leaf.first_block as usize..(leaf.first_block + leaf.blocks) as usize {
                self.search_block(kernel, rotation, tree, block, lane, wanted);
            }
        }
    }

    /// Decides between the nearest of query `lane` so far and a block.
    #[inline(always)]
    fn search_block<K: Kernel>(
        &mut self,
        kernel: K,
        rotation: &Rotation,
        tree: &Tree,
        block: usize,
        lane: usize,
        wanted: Wanted,
    ) {
        let bounds = kernel.row_bounds(&self.axes, lane, &tree.blocks[block]);
        let mut open = kernel.not_above(&bounds, &[self.limit[lane]; WIDTH]);
        while open != 0 {
            let row = open.trailing_zeros() as usize;
            open &= open - 1;
            let slot = block * WIDTH + row;
            if bounds[row] > self.limit[lane] || tree.index[slot] == NONE {
                continue;
            }
            let squared = squared_distance(&self.rows[lane], &tree.rows[slot]);
            if (squared, tree.index[slot]) < (self.squared[lane], self.nearest[lane])
                && squared.is_finite()
            {
                (self.squared[lane], self.nearest[lane]) = (squared, tree.index[slot]);
                self.limit[lane] = match wanted {
                    Wanted::Nearest => rotation.limit(squared),
                    Wanted::Counterexample => OVER,
                };
            }
        }
    }
}

/// The bounds of the queries that are not over.
#[inline(always)]
fn sum(bounds: &Lanes, limits: &Lanes) -> f32 {
    (0..WIDTH).fold(0.0, |sum, lane| sum + if limits[lane] < 0.0 { 0.0 } else { bounds[lane] })
}
