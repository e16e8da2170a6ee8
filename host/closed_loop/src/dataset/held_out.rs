//! One held-out pair, traced without the others: to show it.

use std::sync::Arc;

use echoloop_sim::viewpoint::Split;

use super::{
    Dataset, DatasetError, is_traced, pair_plan, place, poses, share, sight, towns, trace,
    viewpoints,
};
use crate::config::RunConfig;

impl Dataset {
    /// Dataset with one held-out pair, that of [`Self::build`] at `index` of `test`; `None` beyond
    /// the last. Only this pair is traced.
    pub fn held_out(config: &RunConfig, index: usize) -> Result<Option<Self>, DatasetError> {
        if !is_traced(config) {
            let mut all = Self::build(config, &|_, _| ())?;
            let test = all.test.get(index).cloned().into_iter().collect();
            (all.train, all.test) = (Vec::new(), test);
            return Ok((!all.test.is_empty()).then_some(all));
        }
        let towns = towns(config);
        let mut before = 0;
        for (number, &town) in towns.iter().enumerate() {
            let count = share(config, Split::Test, (number, towns.len()));
            if index < before + count {
                return Self::single(config, town, count, [index, index - before]);
            }
            before += count;
        }
        Ok(None)
    }

    fn single(
        config: &RunConfig,
        town: u64,
        count: usize,
        [index, of_town]: [usize; 2],
    ) -> Result<Option<Self>, DatasetError> {
        let (place, beams) = (Arc::new(place(config, town)?), config.scanner.beams());
        let plan = pair_plan(config, Split::Test, count, town);
        let planned = poses(config, &place, &sight(&place, &beams), &plan, &|_, _| ())?;
        let numbers = viewpoints(config.data.train_pairs + index);
        let pair = planned.get(of_town).map(|pair| trace(config, &place, pair, numbers, &beams));
        let triangles = place.scene.mesh.triangles.len();
        Ok(pair.map(|pair| Self { test: vec![pair], triangles, ..Self::empty(beams) }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ScanPair, configured};
    use super::*;

    #[test]
    fn a_single_pair_equals_that_of_the_whole_set_at_its_index() {
        let set =
            ["scanner.columns=24", "scanner.rows=8", "data.train_pairs=3", "data.test_pairs=4"];
        let config = configured(&set);
        let all = Dataset::build(&config, &|_, _| ()).unwrap();
        for (index, expected) in all.test.iter().enumerate() {
            let alone = Dataset::held_out(&config, index).unwrap().unwrap();
            let [found] = &alone.test[..] else { panic!("{} pairs", alone.test.len()) };
            assert_eq!((found.truth, found.viewpoints), (expected.truth, expected.viewpoints));
            let seen = |pair: &ScanPair| [&pair.first, &pair.second].map(|r| r.to(&all.beams));
            assert_eq!(seen(found), seen(expected));
            assert_eq!(found.place, expected.place);
        }
        assert!(Dataset::held_out(&config, 4).unwrap().is_none());
    }
}
