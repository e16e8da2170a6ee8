//! Shortlist of a stage: the candidates that may become finalists.

use echoloop_cmaes::CmaEs;
use echoloop_statistics::median;

use super::origin::Origin;
use super::stage::Stage;
use crate::parameters::{Parameters, Space};
use crate::run_folder::journal::Generation;

/// The optimiser's mean, and the best candidate of each of the `count` best generations of a
/// stage's second half. `base` holds the coordinates that the stage does not move.
pub(super) fn shortlist(
    stage: &Stage,
    optimizer: &CmaEs,
    generations: &[Generation],
    (space, base): (&Space, &[f64]),
    count: usize,
) -> Vec<(Origin, Parameters)> {
    // In its first half the search is still on its way; a stage may have ended early.
    let own = generations.iter().filter(|generation| generation.stage == stage.name);
    let late = &generations[generations.len() - own.count() / 2..];
    let mut best: Vec<(f64, &Generation, usize)> = late.iter().filter_map(best_of).collect();
    best.reverse(); // the later generations first among equals
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    best.truncate(count);
    let mean = stage.expanded(optimizer.mean(), base);
    let origin_of_mean = Origin::Mean { stage: stage.name.to_string() };
    let mut list = vec![(origin_of_mean, space.parameters(&mean).0)];
    list.extend(best.into_iter().map(|(_, generation, i)| {
        (Origin::of(generation, i), space.parameters(&generation.candidates[i].point).0)
    }));
    list
}

/// The best candidate of a generation, by its fitness over the generation's median: pairs differ in
/// difficulty from generation to generation.
fn best_of(generation: &Generation) -> Option<(f64, &Generation, usize)> {
    let fitness = |i: usize| generation.candidates[i].fitness;
    let best =
        (0..generation.candidates.len()).min_by(|&a, &b| fitness(a).total_cmp(&fitness(b)))?;
    let median = median(generation.candidates.iter().map(|c| c.fitness));
    Some((fitness(best) / median.max(f64::MIN_POSITIVE), generation, best))
}
