//! A tree of boxes around rotated features.

use super::rotation::{AXES, Rotated, takes_part};
use super::row::{Row, WIDTH};
use crate::features::DIMENSIONS;

/// Blocks in a leaf, at most.
const LEAF_BLOCKS: usize = 2;

/// The index of a lane that holds no row.
pub(super) const NONE: u32 = u32::MAX;

/// Eight rotated rows, `[axis][lane]`. Lanes without a row are infinitely far.
pub(super) type Block = [[f32; WIDTH]; AXES];

/// The rows that take part, sorted into boxes.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// In preorder: a node's first child follows it.
    pub(super) nodes: Vec<Node>,
    /// Neighbours together.
    pub(super) blocks: Vec<Block>,
    /// `[8 · block + lane]`, where the row was among those given; [`NONE`] beyond the last.
    pub(super) index: Vec<u32>,
    /// `[8 · block + lane]`; zero beyond the last.
    pub(super) rows: Vec<Row>,
}

/// A box around some blocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Lowest coordinates.
    pub(super) low: Rotated,
    /// Highest coordinates.
    pub(super) high: Rotated,
    /// The second child; zero for a leaf.
    pub(super) second: u32,
    /// First of its blocks.
    pub(super) first_block: u32,
    /// Its blocks.
    pub(super) blocks: u32,
}

impl Tree {
    /// Sorts the rows that are features; `rotated` has one for each.
    pub(super) fn new(rows: &[Row], rotated: &[Rotated]) -> Self {
        // An index that is not a u32 could not be told either.
        let mut order: Vec<u32> =
            (0..NONE).zip(rows).filter(|(_, row)| takes_part(row)).map(|(i, _)| i).collect();
        let mut tree = Self::default();
        if !order.is_empty() {
            tree.split(rotated, &mut order, 0);
        }
        tree.fill(rows, rotated, &order);
        tree
    }

    /// Adds the node of `order`, of which the first becomes row `start` of the tree, and those
    /// below it.
    ///
    /// The halves part at the median of the widest axis, rounded to whole leaves, so that all
    /// blocks but the last are full.
    fn split(&mut self, rotated: &[Rotated], order: &mut [u32], start: usize) {
        let (low, high) = bounds(rotated, order);
        let node = self.nodes.len();
        let blocks = order.len().div_ceil(WIDTH);
        self.nodes.push(Node {
            low,
            high,
            second: 0,
            first_block: (start / WIDTH) as u32,
            blocks: blocks as u32,
        });
        if blocks <= LEAF_BLOCKS {
            return;
        }
        let axis = widest(&low, &high);
        let half = blocks.div_ceil(LEAF_BLOCKS).div_ceil(2) * LEAF_BLOCKS * WIDTH;
        let key = |row: u32| rotated[row as usize][axis];
        order.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)));
        let (first, second) = order.split_at_mut(half);
        self.split(rotated, first, start);
        self.nodes[node].second = self.nodes.len() as u32;
        self.split(rotated, second, start + half);
    }

    fn fill(&mut self, rows: &[Row], rotated: &[Rotated], order: &[u32]) {
        let padded = order.len().next_multiple_of(WIDTH);
        self.index = order.to_vec();
        self.index.resize(padded, NONE);
        self.rows = order.iter().map(|&row| rows[row as usize]).collect();
        self.rows.resize(padded, [0.0; DIMENSIONS]);
        let block = |order: &[u32]| {
            let mut block = [[f32::INFINITY; WIDTH]; AXES];
            for (lane, &row) in order.iter().enumerate() {
                for axis in 0..AXES {
                    block[axis][lane] = rotated[row as usize][axis];
                }
            }
            block
        };
        self.blocks = order.chunks(WIDTH).map(block).collect();
    }
}

fn bounds(rotated: &[Rotated], order: &[u32]) -> (Rotated, Rotated) {
    let mut low = [f32::INFINITY; AXES];
    let mut high = [f32::NEG_INFINITY; AXES];
    for &row in order {
        let row = &rotated[row as usize];
        for axis in 0..AXES {
            low[axis] = if row[axis] < low[axis] { row[axis] } else { low[axis] };
            high[axis] = if row[axis] > high[axis] { row[axis] } else { high[axis] };
        }
    }
    (low, high)
}

fn widest(low: &Rotated, high: &Rotated) -> usize {
    let extent = |axis: usize| high[axis] - low[axis];
    (1..AXES).fold(0, |best, axis| if extent(axis) > extent(best) { axis } else { best })
}
