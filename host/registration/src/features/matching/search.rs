//! The search of a tree by eight queries together.

#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;
use echoloop_dispatch::dispatch;

use super::kernel::{BoundKernel, Lanes, Portable};
use super::rotation::{AXES, Rotation};
use super::row::{Row, WIDTH, squared_distance};
use super::tree::{Block, NONE, Node, Tree};
use crate::features::{DIMENSIONS, Match};

/// Most nodes that wait: more than the levels of any tree of `u32` indices halved at each. One
/// child waits while the other is searched.
const DEPTH: usize = 40;

/// The limit of a query that has ended: no bound is below it.
const OVER: f32 = -1.0;

/// The result that a query wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The nearest row.
    Nearest,
    /// Any row nearer than the one that is known.
    Counterexample,
}

/// The tree that a group of queries searches, and the result it wants.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeSearch<'a> {
    pub(super) rotation: &'a Rotation,
    pub(super) tree: &'a Tree,
    pub(super) wanted: Wanted,
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

    /// Queries for the rows of a block, without a result yet.
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

    /// The results, with the queries as sources.
    pub(super) fn matches(&self) -> impl Iterator<Item = Match> {
        let lane = |lane: usize| Match {
            source: self.index[lane],
            target: self.nearest[lane],
            squared: self.squared[lane],
        };
        (0..WIDTH).map(lane).filter(|m| m.target != NONE)
    }

    /// Goes down the tree, the nearer box first.
    #[inline(always)]
    pub(super) fn search_with(&mut self, down: &TreeSearch, kernel: impl BoundKernel) {
        if down.tree.nodes.is_empty() {
            return;
        }
        let mut waiting = [(0_u32, [0.0; WIDTH]); DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (mut at, mut bounds) = waiting[count];
            let mut open = kernel.not_above(&bounds, &self.limit);
            while open != 0 {
                let node = &down.tree.nodes[at as usize];
                if node.second == 0 {
                    self.search_leaf(kernel, down, node, open);
                    break;
                }
                let (near, far) = self.children(kernel, down.tree, at);
                if kernel.not_above(&far.1, &self.limit) != 0 {
                    waiting[count] = far;
                    count += 1;
                }
                (at, bounds) = near;
                open = kernel.not_above(&bounds, &self.limit);
            }
        }
    }

    /// The children of an inner node with their bounds: the nearer one, then the other.
    #[inline(always)]
    fn children(
        &self,
        kernel: impl BoundKernel,
        tree: &Tree,
        parent: u32,
    ) -> ((u32, Lanes), (u32, Lanes)) {
        let (first, second) = (parent + 1, tree.nodes[parent as usize].second);
        let to_first = kernel.box_bounds(&self.axes, &tree.nodes[first as usize]);
        let to_second = kernel.box_bounds(&self.axes, &tree.nodes[second as usize]);
        if sum(&to_first, &self.limit) <= sum(&to_second, &self.limit) {
            ((first, to_first), (second, to_second))
        } else {
            ((second, to_second), (first, to_first))
        }
    }

    /// Takes the `open` queries through the blocks of a leaf.
    #[inline(always)]
    fn search_leaf(
        &mut self,
        kernel: impl BoundKernel,
        down: &TreeSearch,
        leaf: &Node,
        mut open: u32,
    ) {
        while open != 0 {
            let lane = open.trailing_zeros() as usize;
            open &= open - 1;
            for block in leaf.first_block as usize..(leaf.first_block + leaf.blocks) as usize {
                self.search_block(kernel, down, block, lane);
            }
        }
    }

    /// Compares query `lane` with the rows of a block, and keeps the nearest.
    #[inline(always)]
    fn search_block(
        &mut self,
        kernel: impl BoundKernel,
        down: &TreeSearch,
        block: usize,
        lane: usize,
    ) {
        let tree = down.tree;
        let bounds = kernel.row_bounds(&self.axes, lane, &tree.blocks[block]);
        let mut open = kernel.not_above(&bounds, &[self.limit[lane]; WIDTH]);
        while open != 0 {
            let row = open.trailing_zeros() as usize;
            open &= open - 1;
            let slot = block * WIDTH + row;
            // A row before it may have lowered the limit.
            if bounds[row] > self.limit[lane] || tree.index[slot] == NONE {
                continue;
            }
            let squared = squared_distance(&self.rows[lane], &tree.rows[slot]);
            if (squared, tree.index[slot]) < (self.squared[lane], self.nearest[lane])
                && squared.is_finite()
            {
                (self.squared[lane], self.nearest[lane]) = (squared, tree.index[slot]);
                self.limit[lane] = match down.wanted {
                    Wanted::Nearest => down.rotation.limit(squared),
                    Wanted::Counterexample => OVER,
                };
            }
        }
    }
}

dispatch! {
    /// Searches for all queries of a group.
    pub(super) fn search(group: &mut Group, down: &TreeSearch)
        = Group::search_with, with: Portable, v3_with: V3::here();
}

/// The bounds of the queries that are not over.
#[inline(always)]
fn sum(bounds: &Lanes, limits: &Lanes) -> f32 {
    (0..WIDTH).fold(0.0, |sum, lane| sum + if limits[lane] < 0.0 { 0.0 } else { bounds[lane] })
}
