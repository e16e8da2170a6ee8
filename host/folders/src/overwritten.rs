//! Outputs that would overwrite an input.

use std::collections::BTreeSet;
use std::fs::canonicalize;
use std::path::{Path, PathBuf};

use echoloop_files::folder_of;

use crate::list::PairFiles;

/// The first output whose place is that of an input, by whatever path or link. Inputs are the files
/// of the pairs and those in `more`.
pub fn overwritten<'a>(
    outputs: &'a [PathBuf],
    pairs: &[PairFiles],
    more: &[&Path],
) -> Option<&'a Path> {
    let of_pairs = pairs.iter().flat_map(|pair| {
        let motions = [&pair.initial, &pair.truth].into_iter().flatten();
        [&pair.target, &pair.source].into_iter().chain(motions).map(PathBuf::as_path)
    });
    let inputs: BTreeSet<PathBuf> =
        of_pairs.chain(more.iter().copied()).filter_map(place).collect();
    outputs.iter().map(PathBuf::as_path).find(|path| {
        let place = place(path);
        place.is_some_and(|place| inputs.contains(&place))
    })
}

/// Path without links. A file that is not there yet has the place in its folder: a pair's output
/// may be another pair's input.
fn place(path: &Path) -> Option<PathBuf> {
    let in_folder = || Some(canonicalize(folder_of(path)).ok()?.join(path.file_name()?));
    canonicalize(path).ok().or_else(in_folder)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs;

    use super::*;

    fn pair(folder: &Path) -> PairFiles {
        PairFiles {
            name: "a".into(),
            target: folder.join("t.ply"),
            source: folder.join("s.ply"),
            initial: Some(folder.join("i.txt")),
            truth: Some(folder.join("m.txt")),
            problem: None,
        }
    }

    #[test]
    fn an_output_in_the_place_of_an_input_is_found_by_any_path() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        fs::create_dir_all(at("in/deep")).unwrap();
        fs::create_dir(at("out")).unwrap();
        ["t.ply", "s.ply", "i.txt"].iter().for_each(|name| {
            fs::write(at("in").join(name), "").unwrap();
        });
        let (pairs, poses) = ([pair(&at("in"))], at("in/poses.txt"));
        let found = |name: &str| {
            let outputs = [at("out/t.ply"), at(name), at("in/other.ply")];
            let found = overwritten(&outputs, &pairs, &[&poses])?;
            assert_eq!(found, at(name));
            Some(())
        };
        let inputs = ["in/t.ply", "in/s.ply", "in/i.txt", "in/m.txt", "in/poses.txt"];
        for name in inputs.into_iter().chain(["in/deep/../s.ply", "out/../in/m.txt"]) {
            assert_eq!(found(name), Some(()), "{name}");
        }
        assert_eq!(found("out/s.ply"), None);
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("../in/s.ply", at("out/s.ply")).unwrap();
            assert_eq!(found("out/s.ply"), Some(()), "it would be written through the link");
        }
    }
}
