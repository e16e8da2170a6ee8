//! Pairs whose true motion is known: of a folder, of a table, or of a sequence with poses.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use echoloop_clouds::pose::{read_pose, relative};
use echoloop_clouds::{Cloud, Pose};
use echoloop_files::FileError;
use echoloop_registration::survey::Frames;
use rayon::prelude::*;

use crate::kitti;
use crate::list::{ListError, PairFiles, has_pairs, is_csv, kinds, stem};
use crate::sequence::pairs_apart;

/// Pairs that are to be judged by their true motion.
#[derive(Clone, Debug)]
pub struct KnownPairs {
    pairs: Vec<PairFiles>,
    /// Truth of each pair, of a sequence; empty: in the pairs' files.
    truths: Vec<Pose>,
}

/// A pair that is read: two clouds, a motion to begin with, and the one to be found.
#[derive(Clone, Debug)]
pub struct KnownPair {
    /// Target and source, m, each in its own frame. Survey coordinates have a shift taken out.
    pub clouds: [Cloud; 2],
    /// The pair's guess, else the identity between the frames of the files: `target_from_source` of
    /// the clouds.
    pub initial: Pose,
    /// The truth, `target_from_source` of the clouds.
    pub truth: Pose,
}

/// Outcome of each pair, in the order of the list.
#[derive(Clone, Debug)]
pub struct Tried<T> {
    /// Name of each pair that was read, and what was made of it.
    pub done: Vec<(String, T)>,
    /// Name of each other pair, with the reason.
    pub untried: Vec<String>,
}

/// Pairs that cannot be listed.
#[derive(Debug, thiserror::Error)]
pub enum KnownError {
    /// No list of pairs.
    #[error(transparent)]
    List(#[from] ListError),
    /// A file of poses or of a calibration.
    #[error(transparent)]
    File(#[from] FileError),
}

impl KnownPairs {
    /// Pairs of a folder of pairs or of a table ([`PairFiles::list`]), each with a file of its
    /// truth; or of a sequence of scans with poses, as KITTI has them. Those of a sequence are as
    /// far apart as [`pairs_apart`] says, and have the names of both scans: `000000-000012`.
    ///
    /// # Errors
    ///
    /// [`KnownError`] names the path and what was expected there.
    pub fn list(path: &Path, apart_m: f64) -> Result<Self, KnownError> {
        let expected = |what: String| Err(FileError::content(path)(what).into());
        if !path.is_dir() && !is_csv(path) {
            let what = "expected a folder of pairs, a table of them (.csv), or a sequence of scans";
            return expected(what.into());
        }
        if !path.is_dir() || has_pairs(path).map_err(FileError::io(path))? {
            return Ok(Self { pairs: PairFiles::list(path)?, truths: Vec::new() });
        }
        let scans = kitti::scans(path).map_err(FileError::io(path))?;
        if scans.is_empty() {
            return expected(format!(
                "expected NAME_target.* and NAME_source.*, or scans, here or in velodyne/: {}",
                kinds()
            ));
        }
        let poses = kitti::poses(path, &kitti::poses_file(path)?, scans.len())?;
        let drawn = pairs_apart(&poses, apart_m);
        if drawn.is_empty() {
            let count = scans.len();
            return expected(format!("none of its {count} scans has one {apart_m} m on"));
        }
        let pair = |&[target, source]: &[usize; 2]| PairFiles {
            name: format!("{}-{}", stem(&scans[target]), stem(&scans[source])),
            target: scans[target].clone(),
            source: scans[source].clone(),
            initial: None,
            truth: None,
            problem: None,
        };
        let truth = |&[target, source]: &[usize; 2]| relative(&poses[target], &poses[source]);
        let pairs = drawn.iter().map(pair).collect();
        Ok(Self { pairs, truths: drawn.iter().map(truth).collect() })
    }

    /// Number of pairs; at least one.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// True when a pair has a file of an initial guess.
    pub fn have_initial(&self) -> bool {
        self.pairs.iter().any(|pair| pair.initial.is_some())
    }

    /// Reads each pair on all cores and hands it over with its index in the list. A pair that
    /// cannot be read, or has no truth, is left out with the reason; `told` is called after each.
    /// Ends early once `stop` is set.
    pub fn each<T: Send>(
        &self,
        work: &(dyn Fn(usize, &KnownPair) -> T + Sync),
        stop: &AtomicBool,
        told: &(dyn Fn() + Sync),
    ) -> Tried<T> {
        let one = |index: usize| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let tried = self.read(index).map(|pair| work(index, &pair));
            told();
            Some(tried)
        };
        let all: Vec<_> = (0..self.pairs.len()).into_par_iter().map(one).collect();
        let mut tried = Tried { done: Vec::new(), untried: Vec::new() };
        for (pair, outcome) in self.pairs.iter().zip(all) {
            match outcome {
                Some(Ok(made)) => tried.done.push((pair.name.clone(), made)),
                Some(Err(why)) => tried.untried.push(format!("{}: {why}", pair.name)),
                None => {}
            }
        }
        tried
    }

    fn read(&self, index: usize) -> Result<KnownPair, String> {
        let pair = &self.pairs[index];
        pair.check()?; // before its truth, which may be in no place either
        let pose = |path: &PathBuf| read_pose(path).map_err(|error| error.to_string());
        let truth = match (self.truths.get(index), &pair.truth) {
            (Some(truth), _) => *truth,
            (None, Some(path)) => pose(path)?,
            (None, None) => return Err(pair.without_truth()),
        };
        let initial = pair.initial.as_ref().map(pose).transpose()?.unwrap_or_default();
        let (target, source) = pair.read([1.0; 2], false)?;
        let frames = Frames::new(&target, &source);
        Ok(KnownPair {
            initial: frames.inside(&initial),
            truth: frames.inside(&truth),
            clouds: [target.cloud, source.cloud],
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs;
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::of_tests::folder;

    /// Two sensors 10 m apart, seen from the other's frame.
    const TRUTH: &str = "1 0 0 10 0 1 0 0 0 0 1 0\n";

    fn row(x: f64) -> String {
        format!("1 0 0 {x} 0 1 0 0 0 0 1 0\n")
    }

    /// Index, x of the first points, and x of the truth.
    fn seen(index: usize, pair: &KnownPair) -> (usize, [f32; 2], f64) {
        let first = pair.clouds.each_ref().map(|cloud| cloud.points[0].x);
        (index, first, pair.truth.translation.vector.x)
    }

    #[test]
    fn a_pair_that_cannot_be_judged_is_named_and_the_others_are_done() {
        let own = [("a_target.xyz", "1 0 0\n"), ("a_source.xyz", "2 0 0\n")];
        let broken = [("b_target.xyz", "1 0 0\n"), ("b_source.xyz", "no cloud")];
        let lone = [("c_target.xyz", "1 0 0\n"), ("c_source.xyz", "2 0 0\n")];
        let bent = [("d_target.xyz", "1 0 0\n"), ("d_source.xyz", "2 0 0\n")];
        let last = [("e_target.xyz", "5 0 0\n"), ("e_source.xyz", "6 0 0\n")];
        let truths = [
            ("a_target_from_source.txt", TRUTH),
            ("b_target_from_source.txt", TRUTH),
            ("d_target_from_source.txt", "1 0 0 10\n"),
            ("e_target_from_source.txt", TRUTH),
        ];
        let folder = folder(
            &[own, broken, lone, bent, last].concat().into_iter().chain(truths).collect::<Vec<_>>(),
        );
        fs::write(folder.path().join("f_target.xyz"), "1 0 0\n").unwrap();
        let pairs = KnownPairs::list(folder.path(), 2.0).unwrap();
        let told = AtomicUsize::new(0);
        let count = || {
            told.fetch_add(1, Ordering::Relaxed);
        };
        let tried = pairs.each(&seen, &AtomicBool::new(false), &count);
        let name = |name: &str| name.to_owned();
        let expected = [(name("a"), (0, [1.0, 2.0], 10.0)), (name("e"), (4, [5.0, 6.0], 10.0))];
        assert_eq!(tried.done, expected);
        for (why, [name, file, said]) in tried.untried.iter().zip([
            ["b: ", "b_source.xyz: ", "line 1"],
            ["c: ", "c_target.xyz: ", "expected its truth, in c_target_from_source.txt or"],
            ["d: ", "d_target_from_source.txt: ", "found 4 numbers"],
            ["f: ", "expected both f_target.*", "f_source.*"],
        ]) {
            assert!(why.starts_with(name) && why.contains(file) && why.contains(said), "{why}");
        }
        assert_eq!((tried.untried.len(), told.into_inner(), pairs.len()), (4, 6, 6));
        let stopped = pairs.each(&seen, &AtomicBool::new(true), &|| ());
        assert_eq!((stopped.done.len(), stopped.untried.len()), (0, 0));
    }

    #[test]
    fn the_pairs_of_a_sequence_are_drawn_by_distance_and_have_the_truth_of_its_poses() {
        let poses: String = [0.0, 1.0, 2.5, 3.0, 6.0].map(row).concat();
        let scans: Vec<(String, String)> =
            (0..5).map(|n| (format!("velodyne/{n:06}.xyz"), format!("{} 0 0\n", n + 1))).collect();
        let scans = scans.iter().map(|(name, text)| (&**name, &**text));
        let folder = folder(&scans.chain([("poses.txt", &*poses)]).collect::<Vec<_>>());
        let pairs = KnownPairs::list(folder.path(), 2.0).unwrap();
        let tried = pairs.each(&seen, &AtomicBool::new(false), &|| ());
        let expected = [
            ("000000-000002".to_owned(), (0, [1.0, 3.0], 2.5)),
            ("000003-000004".to_owned(), (1, [4.0, 5.0], 3.0)),
        ];
        assert_eq!(tried.done, expected);
        let far = KnownPairs::list(folder.path(), 7.0).unwrap_err().to_string();
        assert!(far.ends_with("none of its 5 scans has one 7 m on"), "{far}");
    }

    #[test]
    fn the_truth_of_survey_coordinates_is_that_of_the_clouds_near_the_origin() {
        let (target, source) = ("500001 0 0\n", "499999 0 0\n");
        let files = [("a_target.xyz", target), ("a_source.xyz", source)];
        let truth = ("a_target_from_source.txt", "1 0 0 2 0 1 0 0 0 0 1 0\n");
        let folder = folder(&[files[0], files[1], truth]);
        let pairs = KnownPairs::list(folder.path(), 2.0).unwrap();
        let laid = |_, pair: &KnownPair| {
            let [target, source] =
                pair.clouds.each_ref().map(|cloud| cloud.points[0].map(f64::from));
            (pair.truth * source - target, pair.initial)
        };
        let tried = pairs.each(&laid, &AtomicBool::new(false), &|| ());
        let (missed, initial) = &tried.done[0].1;
        assert!(missed.norm() < 1e-6, "{missed}");
        assert_eq!(*initial, Pose::identity());
        // A guess is in the frames of the files, too: about their origin, 500 km off.
        let turned = "0 -1 0 500000 1 0 0 -500000 0 0 1 0\n";
        fs::write(folder.path().join("a_initial.txt"), turned).unwrap();
        let pairs = KnownPairs::list(folder.path(), 2.0).unwrap();
        let tried = pairs.each(&laid, &AtomicBool::new(false), &|| ());
        let near_m = tried.done[0].1.1.translation.vector.norm();
        assert!(near_m < 10.0, "{near_m}");
    }

    #[test]
    fn a_pair_begins_at_its_guess_and_is_not_tried_without_the_file_it_names() {
        let table = "target,source,truth,initial\na.xyz,b.xyz,t.txt,g.txt\n\
                     a.xyz,b.xyz,t.txt,none.txt\na.xyz,b.xyz,t.txt,\n";
        let clouds = [("a.xyz", "1 0 0\n"), ("b.xyz", "2 0 0\n"), ("t.txt", TRUTH)];
        let more = [("p.csv", table), ("g.txt", "1 0 0 9 0 1 0 0 0 0 1 0\n")];
        let folder = folder(&[&clouds[..], &more].concat());
        let pairs = KnownPairs::list(&folder.path().join("p.csv"), 2.0).unwrap();
        let x = |_, pair: &KnownPair| pair.initial.translation.vector.x;
        let Tried { done, untried } = pairs.each(&x, &AtomicBool::new(false), &|| ());
        assert_eq!(done, [("1".to_owned(), 9.0), ("3".to_owned(), 0.0)]);
        assert!(untried.len() == 1 && untried[0].starts_with("2: "), "{untried:?}");
        assert!(untried[0].contains("none.txt") && pairs.have_initial(), "{untried:?}");
    }

    #[test]
    fn what_is_no_list_of_known_pairs_is_named() {
        let said = |files: &[(&str, &str)], path: &str| {
            let folder = folder(files);
            KnownPairs::list(&folder.path().join(path), 2.0).unwrap_err().to_string()
        };
        let file = said(&[("a.ply", "")], "a.ply");
        assert!(file.contains("a.ply: expected a folder of pairs, a table of them"), "{file}");
        let empty = said(&[("a/pairs.json", "")], "a");
        assert!(empty.contains("expected NAME_target.* and NAME_source.*, or scans"), "{empty}");
        let unposed = said(&[("velodyne/0.bin", "")], "");
        assert!(unposed.contains("expected a pose of each scan in"), "{unposed}");
        let less = said(&[("0.ply", ""), ("1.ply", ""), ("poses.txt", TRUTH)], "");
        assert!(less.ends_with("poses.txt: expected 2 poses, one a scan, found 1"), "{less}");
        // A truth beside a sequence is no half of a pair.
        let truth = said(&[("velodyne/0.bin", ""), ("a_world_from_target.txt", TRUTH)], "");
        assert!(truth.contains("expected a pose of each scan in"), "{truth}");
    }
}
