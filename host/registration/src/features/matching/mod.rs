//! Mutual nearest neighbours among features, exact.
//!
//! ```text
//! M = { (s, t) : t = argmin d(s, ·) over targets,  s = argmin d(·, t) over sources }
//! d(a, b) = Σ (a_i − b_i)²
//! ```
//!
//! The result is that of the double loop over all pairs, to the last bit. The work is not: a
//! rotation onto the axes that features differ along most, a tree of boxes over the rotated rows of
//! either side, and a search that gives up what is too far along these axes already. Memory is
//! linear. Why no pair is lost, and when the work nears that of the double loop:
//! benches/record/matching.md.

mod build;
mod distinct;
mod kernel;
mod rotation;
mod row;
mod search;
#[cfg(test)]
mod tests;
mod tree;

use rayon::prelude::*;

use super::{Features, Match};
use build::Build;
use distinct::distinct;
use rotation::Rotation;
use row::{Row, WIDTH};
use search::{Group, TreeSearch, Wanted};
use tree::{NONE, Tree};

/// The pairs that are each other's nearest, ordered by source index; the lower index where
/// distances are equal.
///
/// Rows that are all zero or not finite take no part, nor do distances beyond `f32`. The same bytes
/// on any number of threads and on any processor.
pub fn mutual(source: &Features, target: &Features) -> Vec<Match> {
    mutual_by(Build::FASTEST, source, target)
}

/// [`mutual`] as compiled for the target's baseline: for benchmarks and tests.
pub fn mutual_baseline(source: &Features, target: &Features) -> Vec<Match> {
    mutual_by(Build::PLAIN, source, target)
}

fn mutual_by(build: Build, source: &Features, target: &Features) -> Vec<Match> {
    let (source, target) = rayon::join(|| distinct(&source.rows), || distinct(&target.rows));
    let trees = Trees::new(build, &source, &target);
    let claims = claimed(trees.choices(), target.len());
    let mut matches = trees.unrefuted(&claims);
    matches.par_sort_unstable_by_key(|m| m.source);
    matches
}

/// Both sides along the same axes.
struct Trees {
    build: Build,
    rotation: Rotation,
    sources: Tree,
    targets: Tree,
}

impl Trees {
    fn new(build: Build, source: &[Row], target: &[Row]) -> Self {
        let rotation = Rotation::principal(target, source);
        let tree = |rows: &[Row]| Tree::new(rows, &(build.rotate)(&rotation, rows));
        let (sources, targets) = rayon::join(|| tree(source), || tree(target));
        Self { build, rotation, sources, targets }
    }

    fn search(&self, group: &mut Group, tree: &Tree, wanted: Wanted) {
        (self.build.search)(group, &TreeSearch { rotation: &self.rotation, tree, wanted });
    }

    /// Each source with its nearest target.
    fn choices(&self) -> Vec<Match> {
        let block = |block: usize| {
            let mut group = Group::unbounded(&self.sources, block);
            self.search(&mut group, &self.targets, Wanted::Nearest);
            group.matches().collect::<Vec<_>>()
        };
        let blocks = 0..self.sources.blocks.len();
        blocks.into_par_iter().with_min_len(16).flat_map_iter(block).collect()
    }

    /// The claims of which no other source is closer to the target.
    fn unrefuted(&self, claims: &[Option<Match>]) -> Vec<Match> {
        let index = &self.targets.index;
        // In the order of the tree, so that eight in a row are neighbours.
        let is_claimed =
            |slot: &usize| index[*slot] != NONE && claims[index[*slot] as usize].is_some();
        let asked: Vec<usize> = (0..index.len()).filter(is_claimed).collect();
        let eight = |slots: &[usize]| {
            let mut group = Group::claimed(&self.targets, slots, claims, &self.rotation);
            self.search(&mut group, &self.sources, Wanted::Counterexample);
            let held = slots.iter().zip(group.nearest).filter_map(|(&slot, source)| {
                let claim = claims[index[slot] as usize]?;
                (claim.source == source).then_some(claim)
            });
            held.collect::<Vec<_>>()
        };
        asked.par_chunks(WIDTH).with_min_len(16).flat_map_iter(eight).collect()
    }
}

/// By target index, of the sources that chose it the closest.
fn claimed(choices: Vec<Match>, targets: usize) -> Vec<Option<Match>> {
    let mut claims: Vec<Option<Match>> = vec![None; targets];
    for choice in choices {
        let Some(claim) = claims.get_mut(choice.target as usize) else {
            continue;
        };
        if claim.is_none_or(|held| (choice.squared, choice.source) < (held.squared, held.source)) {
            *claim = Some(choice);
        }
    }
    claims
}
