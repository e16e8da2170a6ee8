//! Starts of `warm`: the parameters that `fast` tuned with seed 1 in each kind of scene.

use std::path::Path;

use anyhow::{Context, Result};
use echoloop_campaign::{Cell, Line};

use super::STUDY;
use super::record::Run;
use crate::program::write_parameters;
use crate::shell::{built, workspace};

/// Seed whose towns the starts were tuned in.
const SEED: &str = "1";

/// True when a warm start would begin at what was tuned in the cell's own towns.
pub(super) fn is_in_its_own_towns(cell: &Cell) -> bool {
    [cell.of("strategy"), cell.of("seed")] == ["warm", SEED]
}

/// Further arguments of a cell: its warm starts.
///
/// # Errors
///
/// When the record lacks one, or a file cannot be written.
pub(super) fn arguments(cell: &Cell, lines: &[Line<Run>]) -> Result<Vec<String>> {
    match cell.of("strategy") {
        "warm" => flags(cell, lines, &built(&workspace()?).join("study/warm")),
        _ => Ok(Vec::new()),
    }
}

/// A flag for each start, which is a file in the folder.
fn flags(cell: &Cell, lines: &[Line<Run>], folder: &Path) -> Result<Vec<String>> {
    let flag = |scene: &str| {
        let tuned = source(cell, scene);
        let is_it = |line: &&Line<Run>| line.cell == tuned && !line.result.parameters.is_empty();
        let line = lines.iter().find(is_it).with_context(|| {
            let flags = format!("--strategy fast --protocol joint --seed {SEED}");
            format!("no parameters of {tuned}: run cargo xtask study {flags} before")
        })?;
        let path = folder.join(format!("{}-{scene}.json", cell.of("method")));
        write_parameters(&path, &line.result.parameters)?;
        Ok(format!("--warm-start={}", path.display()))
    };
    STUDY.names("scene").map(flag).collect()
}

/// Cell that tuned the start of a kind of scene.
fn source(cell: &Cell, scene: &str) -> Cell {
    let fast = cell.with("strategy", "fast").with("protocol", "joint").with("condition", "clear");
    fast.with("scene", scene).with("seed", SEED)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::record::Judged;
    use super::*;

    #[test]
    fn the_starts_are_the_first_seed_s_of_each_kind_and_one_that_is_missing_is_named() {
        let cells = STUDY.cells(&[("seed", &["3".to_owned()])]);
        let is_it = |cell: &&Cell| [cell.of("strategy"), cell.of("method")] == ["warm", "gicp"];
        let cell = cells.iter().find(is_it).unwrap();
        let judged = || Judged {
            recall_pct: 0.0,
            mean_cm: None,
            worst_cm: None,
            energy_mj: 0.0,
            errors: vec![1],
        };
        let line = |(i, scene): (u8, &str)| Line {
            cell: source(cell, scene),
            made: String::new(),
            result: Run {
                registrations: 1,
                origin: String::new(),
                parameters: [("lidar.power".to_owned(), f64::from(i))].into(),
                start: judged(),
                tuned: judged(),
            },
        };
        let mut lines: Vec<Line<Run>> = (0..).zip(STUDY.names("scene")).map(line).collect();
        let folder = tempfile::tempdir().unwrap();
        let flags = flags(cell, &lines, folder.path()).unwrap();
        assert_eq!(flags.len(), 3);
        let path = flags[2].strip_prefix("--warm-start=").unwrap();
        assert!(path.ends_with("gicp-unstructured.json"), "{path}");
        assert_eq!(fs::read_to_string(path).unwrap(), r#"{"parameters":{"lidar.power":2.0}}"#);
        lines[1].result.parameters.clear();
        let error = super::flags(cell, &lines, folder.path()).unwrap_err().to_string();
        assert!(error.contains("clear gicp joint semi-structured seed 1 fast"), "{error}");
    }
}
