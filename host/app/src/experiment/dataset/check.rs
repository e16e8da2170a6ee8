//! Pairs for the last choice alone: what a search has seen, it is good at.

use echoloop_sim::viewpoint::{Split, ViewpointError};

use super::{
    Dataset, DatasetError, is_traced, pair_plan, place, poses, share, share_of, sight, towns,
    trace, viewpoints,
};
use crate::experiment::config::RunConfig;

impl Dataset {
    /// A set of `data.check_pairs` training pairs that are not those of [`Self::build`], but the
    /// next that are drawn in the same towns. Its `test` is empty.
    ///
    /// None where none are asked for, and where pairs are stored or recorded, of which there are no
    /// more. A town without room for more pairs gives none.
    ///
    /// # Errors
    ///
    /// [`DatasetError`].
    pub fn of_check(
        config: &RunConfig,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Option<Self>, DatasetError> {
        let asked = config.data.check_pairs;
        if asked == 0 || !is_traced(config) {
            return Ok(None);
        }
        let beams = config.scanner.beams();
        let mut check = Self { beams, train: Vec::new(), test: Vec::new(), triangles: 0 };
        let before = config.data.train_pairs + config.data.test_pairs;
        let towns = towns(config);
        for (number, &town) in towns.iter().enumerate() {
            let at = (number, towns.len());
            let (seen, more) = (share(config, Split::Train, at), share_of(asked, at));
            let place = place(config, town)?;
            check.triangles += place.scene.mesh.triangles.len();
            let plan = pair_plan(config, Split::Train, seen + more, town);
            let planned = poses(config, &place, &sight(&place, &check.beams), &plan, &|_, _| ());
            let planned = match planned {
                Err(DatasetError::Viewpoints {
                    source: ViewpointError::NoViewpoint { .. },
                    ..
                }) => Vec::new(),
                planned => planned?,
            };
            for pair in planned.iter().skip(seen) {
                progress(check.train.len() as f64 / asked as f64, &place.scene.name);
                let numbers = viewpoints(before + check.train.len());
                check.train.push(trace(config, &place, pair, numbers, &check.beams));
            }
        }
        progress(1.0, "");
        Ok((!check.train.is_empty()).then_some(check))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::config::{Override, load};

    fn config(more: &[&str]) -> RunConfig {
        let few = ["scanner.columns=24", "scanner.rows=8", "data.train_pairs=4"];
        let few = few.into_iter().chain(["data.test_pairs=3", "data.check_pairs=5"]);
        let set: Vec<Override> =
            few.chain(more.iter().copied()).map(|t| t.parse().unwrap()).collect();
        load(None, &set).unwrap()
    }

    #[test]
    fn pairs_of_the_check_are_those_that_more_training_pairs_would_have_been() {
        let config = config(&["scene.towns=[1,2]"]);
        let check = Dataset::of_check(&config, &|_, _| ()).unwrap().unwrap();
        assert_eq!((check.train.len(), check.test.len()), (5, 0));
        let mut more = config.clone();
        more.data.train_pairs = 9;
        let more = Dataset::build(&more, &|_, _| ()).unwrap();
        let truths = |pairs: &[crate::experiment::dataset::ScanPair]| -> Vec<_> {
            pairs.iter().map(|pair| (pair.place.clone(), pair.truth)).collect()
        };
        // Of 4, 2 are of each town; of 9, 5 and 4.
        let all = truths(&more.train);
        assert_eq!(truths(&check.train), [&all[2..5], &all[7..9]].concat());
        let numbers: Vec<u32> = check.train.iter().flat_map(|pair| pair.viewpoints).collect();
        assert_eq!(numbers, (15..25).collect::<Vec<u32>>(), "after those of 4 and 3 pairs");
    }

    #[test]
    fn there_is_no_check_where_none_is_asked_for_or_a_town_has_no_room() {
        let none = config(&["data.check_pairs=0"]);
        assert!(Dataset::of_check(&none, &|_, _| ()).unwrap().is_none());
        let paper = load(None, &["tune.strategy=paper".parse().unwrap()]).unwrap();
        assert_eq!(paper.data.check_pairs, 0);
        let all_seen = config(&["data.least_overlap=0.999"]);
        assert!(Dataset::of_check(&all_seen, &|_, _| ()).unwrap().is_none());
    }
}
