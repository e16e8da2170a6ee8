//! Shortlist of a stage: the candidates that may become finalists.

use echoloop_cmaes::CmaEs;
use echoloop_statistics::median;

use super::origin::Origin;
use super::stage::Stage;
use crate::config::preset::Sampler;
use crate::parameters::{Parameters, Space};
use crate::run_folder::journal::Generation;

/// The optimiser's mean, and the best candidate of each of the `count` best generations of a
/// stage's second half; of points drawn at random, of all its generations, and no mean. `base`
/// holds the coordinates that the stage does not move.
pub(super) fn shortlist(
    stage: &Stage,
    optimizer: &CmaEs,
    generations: &[Generation],
    (space, base): (&Space, &[f64]),
    (count, sampler): (usize, Sampler),
) -> Vec<(Origin, Parameters)> {
    let own = || generations.iter().filter(|generation| generation.stage == stage.name);
    let count_of_own = own().count(); // a stage may have ended early
    // In its first half the search is still on its way.
    let early = match sampler {
        Sampler::CmaEs => count_of_own - count_of_own / 2,
        Sampler::Random => 0,
    };
    let mut best: Vec<(f64, &Generation, usize)> = own().skip(early).filter_map(best_of).collect();
    best.reverse(); // the later generations first among equals
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    best.truncate(count);
    let mut list = Vec::new();
    if sampler == Sampler::CmaEs {
        let mean = stage.expanded(optimizer.mean(), base);
        let origin = Origin::Mean { stage: stage.name.to_string() };
        list.push((origin, space.parameters(&mean).0));
    }
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
