//! Where `warm` may begin: at what `fast` tuned with seed 1 in each kind of scene, by the record.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use clap::ValueEnum;
use serde_json::json;

use super::cell::{Cell, Condition, Protocol, Scene, Strategy};
use super::record::Line;

/// The seed whose towns the starts were tuned in, and no other's are.
pub(super) const SEED: u64 = 1;

/// The flags for a cell's starts, each a file in the folder.
///
/// # Errors
///
/// When the record lacks one, or a file cannot be written.
pub(super) fn flags(cell: &Cell, lines: &[Line], folder: &Path) -> Result<Vec<String>> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let flag = |&scene: &Scene| {
        let tuned = source(cell, scene);
        let line = lines.iter().find(|line| line.cell == tuned && !line.parameters.is_empty());
        let line = line.with_context(|| {
            let ask = format!("--strategy fast --protocol joint --seed {SEED}");
            format!("no parameters of {tuned}: run cargo xtask study {ask} before")
        })?;
        let path = folder.join(format!("{}-{scene}.json", cell.method));
        fs::write(&path, json!({ "parameters": line.parameters }).to_string())
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(format!("--warm-start={}", path.display()))
    };
    Scene::value_variants().iter().map(flag).collect()
}

/// The cell that a kind's start is of.
fn source(cell: &Cell, scene: Scene) -> Cell {
    let (strategy, protocol, condition) = (Strategy::Fast, Protocol::Joint, Condition::Clear);
    Cell { strategy, protocol, method: cell.method, scene, condition, seed: SEED }
}

#[cfg(test)]
mod tests {
    use super::super::cell::Method;
    use super::super::record::Judged;
    use super::*;

    #[test]
    fn the_starts_are_the_first_seed_s_of_each_kind_and_one_that_is_missing_is_named() {
        let method = Method::Gicp;
        let asked = Cell {
            strategy: Strategy::Warm,
            method,
            protocol: Protocol::Joint,
            scene: Scene::Structured,
            condition: Condition::Fog,
            seed: 3,
        };
        let line = |scene: Scene| Line {
            cell: source(&asked, scene),
            made: String::new(),
            registrations: 1,
            origin: String::new(),
            parameters: [("lidar.power".to_owned(), scene as u8 as f64)].into(),
            start: Judged { recall_pct: 0.0, mean_cm: None, energy_mj: 0.0, errors: vec![1] },
            tuned: Judged { recall_pct: 0.0, mean_cm: None, energy_mj: 0.0, errors: vec![1] },
        };
        let mut lines: Vec<Line> = Scene::value_variants().iter().map(|&s| line(s)).collect();
        let folder = tempfile::tempdir().unwrap();
        let flags = flags(&asked, &lines, folder.path()).unwrap();
        assert_eq!(flags.len(), 3);
        let path = flags[2].strip_prefix("--warm-start=").unwrap();
        assert!(path.ends_with("gicp-unstructured.json"), "{path}");
        assert_eq!(fs::read_to_string(path).unwrap(), r#"{"parameters":{"lidar.power":2.0}}"#);
        lines[1].parameters.clear();
        let error = super::flags(&asked, &lines, folder.path()).unwrap_err().to_string();
        assert!(error.contains("fast joint gicp semi-structured clear seed 1"), "{error}");
    }
}
