//! Registration with maximal cliques.

mod cliques;
mod degeneracy_order;
mod graph;
mod hypotheses;
mod local;
mod ranked;
mod score;
mod select;
mod thin;
mod weights;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use echoloop_clouds::{Cloud, Pose};

use graph::{Compatible, Graph};
use hypotheses::{Hypothesis, is_another};
use score::{Scorer, exact_score};

use super::features::PointPair;
use super::global::matched;
use super::{Consensus, MacConfig, Outcome, Registration, StopReason};
use crate::correspondences::{Inliers, LengthBounds, Refit, Refitted, Until, within};

/// A motion has six unknowns, a match determines three, and two leave a turn open.
const LEAST_MATCHES: usize = 3;

/// Most motions that are refitted in search of the second best.
const MAX_RUNNERS_UP: usize = 32;

/// Most motions that are examined in search of candidates.
const MAX_CANDIDATES: usize = 200;

/// Registration with maximal cliques.
///
/// Zhang et al., "3D registration with maximal cliques", 2023: matches that a rigid motion could
/// lay together keep their distances, so they form cliques in the graph of matches that do. Each
/// clique proposes a motion; the one with which most matches agree wins.
///
/// 1. Graph: two matches are linked when their distances in the source and in the target differ by
///    less than `length_tolerance_m`.
/// 2. Second order: an edge weighs what the matches linked to both its ends add.
/// 3. Cliques: all maximal ones; each match keeps the heaviest that holds it.
/// 4. Motions: the least squares of each clique, scored over all matches.
/// 5. The final refit of the best, and of the best that is clearly another.
///
/// The published code takes 8 bytes for each pair of matches and any number of cliques, and reads
/// the truth; this takes 5 bits, bounds the cliques, and does not. Where that cuts a graph that is
/// too dense by clustering coefficients and Otsu's threshold, this gives up matches of few links
/// and searches that take too long, and counts them in [`MacReport`]. The same input gives the same
/// bytes on any number of threads.
#[derive(Clone, Debug)]
pub struct Mac {
    pub(super) config: MacConfig,
}

/// The motion found, and the evidence for it.
#[derive(Clone, Debug, PartialEq)]
pub struct MacReport {
    /// The motion.
    pub outcome: Outcome,
    /// Matches in the graph: fewer than were given when some are not finite, when there are more
    /// than [`MacConfig::max_matches`], or when the graph would be too dense to search.
    pub nodes: usize,
    /// Pairs of them that keep their distance.
    pub edges: usize,
    /// Maximal cliques found.
    pub cliques: usize,
    /// Matches whose cliques were not all searched: the graph is too dense there. 0 when the search
    /// was complete.
    pub cut_searches: usize,
    /// Motions that were scored.
    pub hypotheses: usize,
}

impl Mac {
    /// Finds the motion with which most of given matches agree.
    pub fn solve(&self, pairs: &[PointPair]) -> Outcome {
        self.report(pairs, &Pose::identity()).outcome
    }

    /// [`Self::solve`] with the evidence. The pose is `initial` if nothing was found.
    pub fn report(&self, pairs: &[PointPair], initial: &Pose) -> MacReport {
        let finite: Vec<PointPair> = pairs.iter().copied().filter(is_finite).collect();
        let mut report = MacReport::nothing(initial, pairs.len());
        if let Some(consensus) = &mut report.outcome.consensus {
            consensus.searched = finite.len();
        }
        if finite.len() < LEAST_MATCHES {
            report.outcome.stop = StopReason::TooFewMatches;
            return report;
        }
        let proposed = self.propose(&finite, &mut report);
        self.conclude(&finite, &proposed, &mut report.outcome);
        report
    }

    /// The motions that most matches agree with, best first, each clearly another than those before
    /// it; `most` at most. None of them need be right.
    pub fn candidates(&self, pairs: &[PointPair], most: usize) -> Vec<Pose> {
        let finite: Vec<PointPair> = pairs.iter().copied().filter(is_finite).collect();
        if finite.len() < LEAST_MATCHES {
            return Vec::new();
        }
        let mut report = MacReport::nothing(&Pose::identity(), pairs.len());
        let proposed = self.propose(&finite, &mut report);
        let mut found = Distinct { tau_m: self.config.max_pair_distance_m, motions: Vec::new() };
        for next in proposed.iter().take(MAX_CANDIDATES) {
            if found.motions.len() < most && found.is_new(&next.target_from_source) {
                found.add(self.refit(&finite, next), &finite);
            }
        }
        found.motions.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
        found.motions.iter().map(|(motion, _)| motion.target_from_source).collect()
    }

    /// The motions that cliques propose, best first; their count goes into the report.
    fn propose(&self, finite: &[PointPair], report: &mut MacReport) -> Vec<Hypothesis> {
        let (nodes, graph) = self.graph(finite);
        let selection = select::heaviest(&graph, self.config.least_clique, self.config.max_cliques);
        let scorer = Scorer::new(finite, self.config.max_pair_distance_m);
        let proposed = hypotheses::propose(&selection.cliques, &nodes, &scorer);
        (report.nodes, report.edges) = (nodes.len(), graph.edges());
        if let Some(consensus) = &mut report.outcome.consensus {
            consensus.searched = nodes.len();
        }
        (report.cliques, report.cut_searches) = (selection.found, selection.cut_roots);
        report.hypotheses = proposed.len();
        proposed
    }

    /// The matches that are searched, and their second-order graph.
    fn graph(&self, finite: &[PointPair]) -> (Vec<PointPair>, Graph) {
        let config = &self.config;
        let bounds = LengthBounds { tolerance_m: config.length_tolerance_m, least_length_m: 0.0 };
        let take = |from: &[PointPair], kept: &[u32]| {
            kept.iter().map(|&i| from[i as usize]).collect::<Vec<_>>()
        };
        let mut nodes = finite.to_vec();
        if nodes.len() > config.max_matches {
            nodes = take(&nodes, &thin::by_sampled_degree(&nodes, &bounds, config.max_matches));
        }
        let mut compatible = Compatible::new(&nodes, &bounds);
        if let Some(kept) = thin::by_density(&compatible) {
            nodes = take(&nodes, &kept);
            compatible = Compatible::new(&nodes, &bounds);
        }
        let scale_m = config.max_pair_distance_m.max(config.length_tolerance_m);
        let graph = Graph::new(&nodes, &compatible, scale_m);
        (nodes, graph.second_order())
    }

    /// Refits the best motion and the second best; returns the better one with its evidence.
    fn conclude(&self, pairs: &[PointPair], proposed: &[Hypothesis], outcome: &mut Outcome) {
        let Some(first) = proposed.first() else {
            return;
        };
        let mut best = self.refit(pairs, first);
        let mut other = self.runner_up(pairs, proposed, &best.target_from_source);
        if let Some(other) = &mut other
            && other.score > best.score
        {
            std::mem::swap(&mut best, other);
        }
        let margin = other.map(|other| best.score / other.score.max(f64::MIN_POSITIVE));
        let motion = best.target_from_source;
        let inliers = Inliers::count(pairs, &motion, self.config.max_pair_distance_m);
        let enough = best.score > least_score(pairs.len());
        let stop = if enough { StopReason::Converged } else { outcome.stop };
        let of = outcome.consensus.map_or((pairs.len(), 0), |c| (c.matches, c.searched));
        *outcome = Outcome { iterations: best.fits, ..Outcome::nothing(&motion, stop) }
            .agreeing(inliers, of, margin);
    }
}

impl Mac {
    /// Fits anew to the matches within τ until the score no longer rises.
    fn refit(&self, pairs: &[PointPair], start: &Hypothesis) -> Refitted<f64> {
        let (width_m, max_fits) = (self.config.max_pair_distance_m, self.config.max_iterations);
        let refit = Refit { width_m, max_fits, until: Until::NoBetter };
        refit.run(pairs, &start.target_from_source, |pose| exact_score(pairs, pose, width_m))
    }

    /// The best motion that is clearly another than `best`, and stays so when it is refitted: most
    /// that are not near it come back to it.
    fn runner_up(
        &self,
        pairs: &[PointPair],
        proposed: &[Hypothesis],
        best: &Pose,
    ) -> Option<Refitted<f64>> {
        let tau_m = self.config.max_pair_distance_m;
        let inliers = within(pairs, best, tau_m);
        let is_another = |other: &Pose| is_another(other, best, &inliers, tau_m);
        let others = proposed.iter().filter(|other| is_another(&other.target_from_source));
        let refitted = others.take(MAX_RUNNERS_UP).map(|other| self.refit(pairs, other));
        let better = |best: Refitted<f64>, next: Refitted<f64>| {
            if next.score > best.score { next } else { best }
        };
        refitted.filter(|other| is_another(&other.target_from_source)).reduce(better)
    }
}

/// Motions of which each is clearly another than the rest, with the matches that agree.
struct Distinct {
    tau_m: f64,
    motions: Vec<(Refitted<f64>, Vec<PointPair>)>,
}

impl Distinct {
    fn is_new(&self, motion: &Pose) -> bool {
        let is_another = |(other, inliers): &(Refitted<f64>, Vec<PointPair>)| {
            is_another(motion, &other.target_from_source, inliers, self.tau_m)
        };
        self.motions.iter().all(is_another)
    }

    /// Adds a refitted motion, unless it is near one that is there.
    fn add(&mut self, refitted: Refitted<f64>, pairs: &[PointPair]) {
        if self.is_new(&refitted.target_from_source) {
            let inliers = within(pairs, &refitted.target_from_source, self.tau_m);
            self.motions.push((refitted, inliers));
        }
    }
}

impl Registration for Mac {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        match matched(target, source, &self.config.features) {
            Ok(pairs) => self.report(&pairs, initial).outcome,
            Err(stop) => Outcome::nothing(initial, stop),
        }
    }
}

impl MacReport {
    fn nothing(initial: &Pose, matches: usize) -> Self {
        let consensus = Some(Consensus { matches, searched: 0, inliers: 0, margin: None });
        let outcome = Outcome { consensus, ..Outcome::nothing(initial, StopReason::NoConsensus) };
        Self { outcome, nodes: 0, edges: 0, cliques: 0, cut_searches: 0, hypotheses: 0 }
    }
}

/// Highest score of the best motion among unrelated matches, in matches. More matches score higher
/// by chance.
///
/// Fitted, with τ of two voxels, to simulated scans: 42 pairs of unrelated ones with 440 to 6100
/// matches, 44 with 80 to 300, and 60 right motions. Different streets whose walls and ground agree
/// can still pass: the margin is then near 1, but so it is for some right motions.
fn least_score(matches: usize) -> f64 {
    let matches = matches as f64;
    (9.0 + 0.45 * matches.sqrt()).min(0.5 * matches).max(3.0)
}

fn is_finite(pair: &PointPair) -> bool {
    pair.source.iter().chain(pair.target.iter()).all(|v| v.is_finite())
}
