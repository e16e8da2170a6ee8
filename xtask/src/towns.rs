//! `cargo xtask towns`: time to trace, store and read pairs of the nine towns, a table of
//! `benches/record/data.md`. Towns on CARLA's roads need its files, which `ECHOLOOP_DATA` names.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::record::{printed, stamp, write_page};
use crate::shell::{build_release, built, echoloop, workspace};

const PAGE: &str = "benches/record/data.md";

/// The nine towns, and all of a kind together.
const SCENES: [&str; 12] = [
    "town01",
    "town10hd",
    "old-town",
    "town07",
    "garden-suburb",
    "hillside",
    "forest-hills",
    "rocky-valley",
    "lake-shore",
    "structured-towns",
    "semi-structured-towns",
    "unstructured-towns",
];

/// Numbers of pairs of a scene, as in the paper (Sec. 4.1).
const PAIRS: [&str; 3] = ["scanner.pattern=grid", "data.train_pairs=10", "data.test_pairs=100"];

/// Measures every scene and writes the table.
pub(crate) fn run() -> Result<()> {
    build_release()?;
    let folder = built(&workspace()?).join("towns");
    std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
    let mut rows = String::new();
    let mut all_s = 0.0;
    for scene in SCENES {
        let (row, took_s) = measured(scene, &folder)?;
        rows += &row;
        all_s += if scene.ends_with("-towns") { 0.0 } else { took_s };
    }
    let text = format!(
        "\
{}. All nine: {all_s:.0} s.

| scene | traced and kept in | file | read and kept again in | overlap of the held-out, median | \
least distance |
|---|---|---|---|---|---|
{rows}",
        stamp()?
    );
    write_page(PAGE, "cargo xtask towns", &text)
}

/// Row of the table, and the seconds of its first column.
fn measured(scene: &str, folder: &Path) -> Result<(String, f64)> {
    let kept = folder.join(format!("{scene}.pairs"));
    let sets = PAIRS.iter().flat_map(|set| ["--set", set]);
    let begun = Instant::now();
    let mut trace = echoloop()?;
    trace.args(["store", "--json", "-q", "--scene", scene]).args(sets).arg("-o").arg(&kept);
    printed(&mut trace)?;
    let traced_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let mut read = echoloop()?;
    read.args(["store", "--json", "-q", "--stored"]).arg(&kept).arg("-o").arg(&kept);
    let document = printed(&mut read)?.json;
    Ok((row(scene, traced_s, begun.elapsed().as_secs_f64(), &document), traced_s))
}

fn row(scene: &str, traced_s: f64, read_s: f64, document: &Value) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let megabytes = number(&document["bytes"]) / 1e6;
    let overlap = number(&document["set"]["test"]["overlap"][2]);
    let apart_m = number(&document["set"]["least_apart_m"]);
    format!(
        "| `{scene}` | {traced_s:.1} s | {megabytes:.1} MB | {read_s:.1} s | {overlap:.2} | \
         {apart_m:.1} m |\n"
    )
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_row_has_what_was_measured_and_what_the_set_says_of_itself() {
        let set = json!({"test": {"overlap": [0.1, 0.2, 0.734, 0.8, 0.9]}, "least_apart_m": 10.04});
        let document = json!({"bytes": 17_600_000, "set": set});
        let expected = "| `town01` | 12.3 s | 17.6 MB | 0.4 s | 0.73 | 10.0 m |\n";
        assert_eq!(row("town01", 12.34, 0.41, &document), expected);
    }
}
