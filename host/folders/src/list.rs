//! Pairs of a folder, of a table, or of consecutive scans.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_clouds::{
    CloudError, Recorded, is_readable, read_extensions, read_points, read_recorded,
};
use echoloop_registration::pair::in_one_frame;

use crate::kitti;

/// Files of a pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairFiles {
    /// Name, unlike that of any other pair of the list.
    pub name: String,
    /// The cloud that stays; empty where the list has none.
    pub target: PathBuf,
    /// The cloud that moves; empty where the list has none.
    pub source: PathBuf,
    /// File of an initial guess of `target_from_source`.
    pub initial: Option<PathBuf>,
    /// File of the true `target_from_source`.
    pub truth: Option<PathBuf>,
    /// Why the pair cannot be tried, of one that the list does not tell whole.
    pub problem: Option<String>,
}

/// Pairs that cannot be listed.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct ListError {
    path: PathBuf,
    what: String,
}

/// Ends of the names of files of a pair, after the pair's name.
const TARGET: &str = "_target";
const SOURCE: &str = "_source";
const TRUTH: &str = "_target_from_source.txt";
const INITIAL: &str = "_initial.txt";

/// Ends of the names, without extension, of files of motions beside the clouds.
const MOTIONS: [&str; 4] =
    ["_target_from_source", "_world_from_target", "_world_from_source", "_initial"];

impl PairFiles {
    /// Pairs of a folder, or of a table.
    ///
    /// A folder has `NAME_target.*` and `NAME_source.*` of each, and may have their true motions as
    /// `NAME_target_from_source.txt`, as `echoloop pairs` writes them, and initial guesses as
    /// `NAME_initial.txt`. A table, CSV with a heading, has columns `target` and `source`, and may
    /// have `name`, `initial` and `truth`; its paths begin where it lies.
    ///
    /// A pair that lacks a file, or has two for one, comes with its problem, so that the others can
    /// be done.
    ///
    /// # Errors
    ///
    /// [`ListError`] names the path and what was expected there.
    pub fn list(path: &Path) -> Result<Vec<Self>, ListError> {
        let fail = |what| ListError { path: path.to_owned(), what };
        match path.is_dir() {
            true => of_folder(path).map_err(fail),
            false => of_table(path).map_err(fail),
        }
    }

    /// Consecutive scans of a folder, in the order of their names: each is the source of a pair
    /// whose target is the one before it. A pair has the name of its source. Of files of several
    /// formats those of the most frequent one are the scans: a list of poses may lie beside them.
    /// A folder without scans may have them in KITTI's `velodyne`.
    ///
    /// # Errors
    ///
    /// [`ListError`], of fewer than two clouds.
    pub fn consecutive(folder: &Path) -> Result<Vec<Self>, ListError> {
        let fail = |what| ListError { path: folder.to_owned(), what };
        let scans = kitti::scans(folder).map_err(|error| fail(error.to_string()))?;
        let pair = |two: &[PathBuf]| Self {
            name: stem(&two[1]),
            target: two[0].clone(),
            source: two[1].clone(),
            initial: None,
            truth: None,
            problem: None,
        };
        match scans.len() {
            0 | 1 => Err(fail(format!("expected scans, {}; found {}", kinds(), scans.len()))),
            _ => Ok(scans.windows(2).map(pair).collect()),
        }
    }

    /// Target and source in one frame; the source with all columns, if it is `whole`. `scales` are
    /// metres per unit of their files.
    ///
    /// # Errors
    ///
    /// The pair's problem, else the file that cannot be read, and why.
    pub fn read(&self, scales: [f64; 2], whole: bool) -> Result<(Recorded, Recorded), String> {
        self.check()?;
        let said = |error: CloudError| error.to_string();
        let read = if whole { read_recorded } else { read_points };
        let (mut target, _) = read_points(&self.target).map_err(said)?;
        let (mut source, _) = read(&self.source).map_err(said)?;
        target.scale(scales[0]);
        source.scale(scales[1]);
        in_one_frame(&target, &mut source);
        Ok((target, source))
    }

    /// The pair's problem, if the list does not tell it whole.
    pub(crate) fn check(&self) -> Result<(), String> {
        self.problem.clone().map_or(Ok(()), Err)
    }

    /// The reason why a pair cannot be judged that has no file of its truth.
    pub(crate) fn without_truth(&self) -> String {
        let (target, name) = (self.target.display(), &self.name);
        format!("{target}: expected its truth, in {name}{TRUTH} or in the table's column truth")
    }

    /// Scans of consecutive pairs, in their order.
    pub fn scans(pairs: &[Self]) -> impl Iterator<Item = &Path> {
        let first = pairs.first().map(|pair| &*pair.target);
        first.into_iter().chain(pairs.iter().map(|pair| &*pair.source))
    }
}

pub(crate) fn kinds() -> String {
    format!("{} files", read_extensions())
}

/// Files of clouds in a folder, by name.
pub(crate) fn clouds(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut paths = fs::read_dir(folder)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<io::Result<Vec<_>>>()?;
    paths.retain(|path| is_readable(path) && path.is_file());
    paths.sort();
    Ok(paths)
}

/// Those of the extension that most have; of the first in the alphabet, if two have as many.
pub(crate) fn most_alike(paths: Vec<PathBuf>) -> Vec<PathBuf> {
    let extension = |path: &PathBuf| path.extension().unwrap_or_default().to_ascii_lowercase();
    let mut counts = BTreeMap::new();
    paths.iter().for_each(|path| *counts.entry(extension(path)).or_insert(0) += 1);
    let most = counts.iter().rev().max_by_key(|(_, count)| **count).map(|(most, _)| most.clone());
    paths.into_iter().filter(|path| Some(extension(path)) == most).collect()
}

pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// True when a folder has a half of a pair.
pub(crate) fn has_pairs(folder: &Path) -> io::Result<bool> {
    let stems = clouds(folder)?.into_iter().map(|path| stem(&path));
    let mut halves = stems.filter(|stem| !is_motion(stem));
    Ok(halves.any(|stem| [TARGET, SOURCE].iter().any(|half| stem.ends_with(half))))
}

fn is_motion(stem: &str) -> bool {
    MOTIONS.iter().any(|motion| stem.ends_with(motion))
}

/// True of a file that is read as a table, by its extension.
pub(crate) fn is_csv(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
}

fn of_folder(folder: &Path) -> Result<Vec<PairFiles>, String> {
    let mut halves: BTreeMap<String, [Vec<PathBuf>; 2]> = BTreeMap::new();
    for path in clouds(folder).map_err(|error| error.to_string())? {
        let stem = stem(&path);
        if is_motion(&stem) {
            continue;
        }
        for (half, suffix) in [TARGET, SOURCE].into_iter().enumerate() {
            if let Some(name) = stem.strip_suffix(suffix) {
                halves.entry(name.to_owned()).or_default()[half].push(path.clone());
            }
        }
    }
    let beside = |name: &str, suffix: &str| {
        Some(folder.join(format!("{name}{suffix}"))).filter(|path| path.exists())
    };
    let pair = |(name, halves): (String, [Vec<PathBuf>; 2])| {
        let problem = halves_problem(&name, &halves);
        let [target, source] = halves.map(|half| half.into_iter().next().unwrap_or_default());
        let (initial, truth) = (beside(&name, INITIAL), beside(&name, TRUTH));
        PairFiles { name, target, source, initial, truth, problem }
    };
    match halves.is_empty() {
        true => Err(format!(
            "expected NAME{TARGET}.* and NAME{SOURCE}.*, {}; --sequence registers consecutive \
             scans",
            kinds()
        )),
        false => Ok(halves.into_iter().map(pair).collect()),
    }
}

/// What is wrong with the files found of a pair, which are to be one target and one source.
fn halves_problem(name: &str, halves: &[Vec<PathBuf>; 2]) -> Option<String> {
    if halves.iter().any(Vec::is_empty) {
        return Some(format!("expected both {name}{TARGET}.* and {name}{SOURCE}.*"));
    }
    let mut named = [TARGET, SOURCE].into_iter().zip(halves);
    named.find_map(|(suffix, half)| {
        let [one, other, ..] = &half[..] else { return None };
        let (one, other) = (one.display(), other.display());
        Some(format!("expected one {name}{suffix}.*, found {one} and {other}"))
    })
}

fn of_table(path: &Path) -> Result<Vec<PairFiles>, String> {
    if !is_csv(path) {
        return Err("expected a folder of pairs, a table of them (.csv), or a second cloud".into());
    }
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_path(path)
        .map_err(|error| error.to_string())?;
    let heading = reader.headers().map_err(|error| error.to_string())?.clone();
    let column = |name: &str| heading.iter().position(|of| of == name);
    let (Some(target), Some(source)) = (column("target"), column("source")) else {
        let found: Vec<&str> = heading.iter().collect();
        return Err(format!(
            "expected a heading with target and source, found {}",
            found.join(", ")
        ));
    };
    let known = ["name", "target", "source", "initial", "truth"];
    if let Some(other) = heading.iter().find(|of| !known.contains(of)) {
        return Err(format!("expected columns {}, found {other}", known.join(", ")));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut pairs: Vec<PairFiles> = Vec::new();
    for (row, record) in (1..).zip(reader.records()) {
        let record = record.map_err(|error| error.to_string())?;
        let at = |column: usize| record.get(column).filter(|cell| !cell.is_empty());
        let cell = |name: &str| column(name).and_then(at);
        let file = |name: &str| cell(name).map(|cell| folder.join(cell));
        let name = cell("name").map_or_else(|| row.to_string(), str::to_owned);
        if pairs.iter().any(|pair| pair.name == name) {
            return Err(format!("row {row}: another pair has the name {name}"));
        }
        if name.contains(['/', '\\']) || name.chars().any(char::is_control) {
            return Err(format!("row {row}: expected a name that a file can have, found {name:?}"));
        }
        let (target, source) = (at(target), at(source));
        let problem = if record.len() != heading.len() {
            let (found, expected) = (record.len(), heading.len());
            Some(format!("row {row}: expected {expected} cells, as its heading, found {found}"))
        } else if target.is_none() || source.is_none() {
            Some(format!("row {row} lacks its target or source"))
        } else {
            None
        };
        let [target, source] =
            [target, source].map(|cell| cell.map(|cell| folder.join(cell)).unwrap_or_default());
        let (initial, truth) = (file("initial"), file("truth"));
        pairs.push(PairFiles { name, target, source, initial, truth, problem });
    }
    if pairs.is_empty() { Err("has no pair".into()) } else { Ok(pairs) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::of_tests::folder;

    fn said(files: &[(&str, &str)], path: &str) -> String {
        let folder = folder(files);
        let error = PairFiles::list(&folder.path().join(path)).unwrap_err();
        error.what
    }

    #[test]
    fn a_folder_s_pairs_come_by_name_with_their_truth_and_guess() {
        let folder = folder(&[
            ("b_target.ply", ""),
            ("b_source.pcd", ""),
            ("a_source.PLY", ""),
            ("a_target.ply", ""),
            ("a_target_from_source.txt", ""),
            ("a_world_from_source.txt", ""),
            ("b_initial.txt", ""),
            ("pairs.json", ""),
        ]);
        let pairs = PairFiles::list(folder.path()).unwrap();
        let names: Vec<&str> = pairs.iter().map(|pair| &*pair.name).collect();
        assert_eq!(names, ["a", "b"]);
        assert_eq!(pairs[0].truth, Some(folder.path().join("a_target_from_source.txt")));
        assert_eq!((&pairs[0].initial, &pairs[1].truth), (&None, &None));
        assert_eq!(pairs[1].initial, Some(folder.path().join("b_initial.txt")));
        assert_eq!(pairs[1].source, folder.path().join("b_source.pcd"));
    }

    #[test]
    fn a_table_names_files_beside_it() {
        let text = "target, source, truth\na.ply, b.ply, t.txt\nc.ply, d.ply,\n";
        let folder = folder(&[("p.csv", text)]);
        let pairs = PairFiles::list(&folder.path().join("p.csv")).unwrap();
        assert_eq!((&*pairs[0].name, &*pairs[1].name), ("1", "2"));
        assert_eq!(pairs[0].truth, Some(folder.path().join("t.txt")));
        assert_eq!((&pairs[1].truth, &pairs[1].target), (&None, &folder.path().join("c.ply")));
    }

    #[test]
    fn what_is_no_list_is_named() {
        assert!(said(&[("scan.ply", "")], "").ends_with("--sequence registers consecutive scans"));
        let table = |text| said(&[("p.csv", text)], "p.csv");
        assert!(
            table("a,b\n").starts_with("expected a heading with target and source, found a, b")
        );
        assert!(table("target,source,trust\n").ends_with("found trust"));
        assert_eq!(table("target,source\n"), "has no pair");
        let same = table("name,target,source\nx,a,b\nx,c,d\n");
        assert_eq!(same, "row 2: another pair has the name x");
        assert!(table("name,target,source\n../x,a,b\n").contains("that a file can have"));
        assert!(said(&[("a.ply", "")], "a.ply").starts_with("expected a folder of pairs"));
    }

    #[test]
    fn a_pair_that_is_not_whole_has_its_problem_and_the_others_have_none() {
        let problems = |files: &[(&str, &str)], path: &str| {
            let folder = folder(files);
            let pairs = PairFiles::list(&folder.path().join(path)).unwrap();
            pairs.into_iter().map(|pair| (pair.name, pair.problem)).collect::<Vec<_>>()
        };
        let names =
            ["a_target.ply", "b_source.ply", "c_target.pcd", "c_target.ply", "c_source.ply"];
        let whole = ["d_target.ply", "d_source.ply"];
        let files: Vec<(&str, &str)> =
            names.into_iter().chain(whole).map(|name| (name, "")).collect();
        let [a, b, c, d] = problems(&files, "").try_into().unwrap();
        assert_eq!(a, ("a".into(), Some("expected both a_target.* and a_source.*".into())));
        assert_eq!(b, ("b".into(), Some("expected both b_target.* and b_source.*".into())));
        let twice = c.1.unwrap();
        assert!(
            twice.starts_with("expected one c_target.*, found ") && twice.contains(".pcd and ")
        );
        assert_eq!(d, ("d".into(), None));
        let rows = "a.ply,\n,b.ply\nc.ply\nd.ply,e.ply,f.ply\ng.ply,h.ply\n";
        let found = problems(&[("p.csv", &format!("target,source\n{rows}"))], "p.csv");
        let lacks = |row| Some(format!("row {row} lacks its target or source"));
        let cells = |row, found| {
            Some(format!("row {row}: expected 2 cells, as its heading, found {found}"))
        };
        let expected = [lacks(1), lacks(2), cells(3, 1), cells(4, 3), None];
        let expected = (1..).map(|row| row.to_string()).zip(expected);
        assert_eq!(found, expected.collect::<Vec<(String, Option<String>)>>());
    }

    #[test]
    fn consecutive_scans_are_targets_of_the_next() {
        let folder = folder(&[("2.ply", ""), ("10.ply", ""), ("1.ply", ""), ("poses.txt", "")]);
        let pairs = PairFiles::consecutive(folder.path()).unwrap();
        let names: Vec<String> = PairFiles::scans(&pairs).map(stem).collect();
        assert_eq!(names, ["1", "10", "2"], "in the order of names, as ls has it");
        assert_eq!((&*pairs[0].name, stem(&pairs[0].target)), ("10", "1".into()));
        let none = tempfile::tempdir().unwrap();
        assert!(PairFiles::consecutive(none.path()).unwrap_err().what.contains("expected scans"));
    }
}
