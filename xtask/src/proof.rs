//! `cargo xtask proof`: both halves tuned together, against whatever would explain their gain away.
//!
//! The plan is `benches/plans/proof.toml`. A line of its record has the error of every held-out
//! pair, and the tables of `benches/record/proof.md` and `docs/results.md` are written from the
//! lines alone.

mod interactions;
mod picture;
mod record;
mod table;

use std::collections::BTreeMap;
use std::fs;
use std::sync::LazyLock;

use anyhow::{Context, Result, anyhow};
use echoloop_campaign::{Cell, Line, Plan, Unfinished};

use crate::program::{self, Job, priced, recorded, write_parameters};
use crate::record::write_page;
use crate::shell::{built, workspace};
use interactions::TAKEN_BACK;
use record::Run;

static PROOF: LazyLock<Plan> =
    LazyLock::new(|| Plan::read(include_str!("../../benches/plans/proof.toml")));

const PAGE: &str = "benches/record/proof.md";
const RESULTS: &str = "docs/results.md";
const FIGURES: &str = "docs/figures";
/// Condition whose pictures are drawn.
const SHOWN: &str = "dim";

/// Cells to run.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Proof {
    /// Only these rows: what is tuned.
    #[arg(long, value_delimiter = ',', value_parser = PROOF.choices("tuned"))]
    tuned: Vec<String>,
    /// Only these methods.
    #[arg(long, value_delimiter = ',', value_parser = PROOF.choices("method"))]
    method: Vec<String>,
    /// Only these kinds of scene.
    #[arg(long, value_delimiter = ',', value_parser = PROOF.choices("scene"))]
    scene: Vec<String>,
    /// Only these conditions. Unless rows or methods are given, random points and the ideal
    /// detector are run for ICP and FGR alone; and of `whole`, which leaves little to gain, both
    /// together alone, for three seeds, without GICP.
    #[arg(long, value_delimiter = ',', default_value = "dim,whole",
          value_parser = PROOF.choices("condition"))]
    condition: Vec<String>,
    /// Only these seeds; the towns of a seed are its own.
    #[arg(long, value_delimiter = ',', default_value = "623,624,625,626,627",
          value_parser = clap::value_parser!(u64).range(1..))]
    seed: Vec<u64>,
    /// Run nothing: say how many cells are left, and what they will take.
    #[arg(long, conflicts_with = "page")]
    price: bool,
    /// Run nothing: write the page and its pictures from the record.
    #[arg(long)]
    page: bool,
}

/// Runs the cells that the record lacks, takes apart what both together chose, then writes the page
/// and its pictures.
///
/// # Errors
///
/// When runs fail, which the others do not wait for, or the record cannot be read or written. Lines
/// of finished runs are kept.
pub(crate) fn run(args: &Proof) -> Result<()> {
    let cells = args.cells();
    let apart = interactions::cells(&cells);
    if args.price {
        let lines = recorded(&PROOF)?;
        println!("searches: {}", price_of(&cells, &lines, &lines));
        println!("taken back: {}", price_of(&apart, &recorded(&TAKEN_BACK)?, &lines));
        return Ok(());
    }
    let ended = match args.page {
        true => Ok(()),
        false => run_all(&cells, &apart),
    };
    let lines = recorded(&PROOF)?;
    write_page(PAGE, "cargo xtask proof", &page(&lines, &recorded(&TAKEN_BACK)?))?;
    let shown = table::of_condition(&lines, SHOWN);
    write_page(RESULTS, "cargo xtask proof", &table::claim(&shown))?;
    for (name, svg) in picture::pictures(&shown)? {
        let path = workspace()?.join(FIGURES).join(name);
        fs::write(&path, svg).with_context(|| format!("cannot write {}", path.display()))?;
    }
    ended
}

/// Runs the searches, then takes what they chose apart, as far as they got.
fn run_all(cells: &[Cell], apart: &[Cell]) -> Result<()> {
    let searched = program::run(&PROOF, cells, job, |c, lines| Some(seconds(c, lines)), Run::new);
    let lines = recorded(&PROOF)?;
    let is_chosen = |cell: &&Cell| line_of(&interactions::chosen(cell), &lines).is_ok();
    let apart: Vec<Cell> = apart.iter().filter(is_chosen).cloned().collect();
    let job = |cell: &Cell, _: &[Line<Run>]| {
        judged(cell, &interactions::parameters(cell, &lines)?).map(Some)
    };
    let taken = program::run(&TAKEN_BACK, &apart, job, |c, _| Some(seconds(c, &lines)), Run::new);
    match (searched, taken) {
        (Err(searched), Err(taken)) => Err(anyhow!("{searched:#}\n{taken:#}")),
        (searched, taken) => searched.and(taken),
    }
}

fn page(lines: &[Line<Run>], taken_back: &[Line<Run>]) -> String {
    table::tables(lines) + &interactions::tables(lines, taken_back)
}

impl Proof {
    fn cells(&self) -> Vec<Cell> {
        let seeds: Vec<String> = self.seed.iter().map(u64::to_string).collect();
        let any = ["any".to_owned()];
        let cells = PROOF.cells(&[
            ("tuned", &self.tuned),
            ("method", &self.method),
            ("scene", &self.scene),
            ("condition", &self.condition),
            ("seed", &seeds),
            ("hand", &any),
        ]);
        let is_left_out = |cell: &Cell| {
            let [condition, tuned, method] = ["condition", "tuned", "method"].map(|a| cell.of(a));
            let seed = cell.of("seed").to_owned();
            let is_of_whole = ["nothing", "joint"].contains(&tuned) && method != "gicp";
            let is_default = self.tuned.is_empty() && self.method.is_empty();
            is_default
                && match condition {
                    "whole" => !(is_of_whole && seeds[..3.min(seeds.len())].contains(&seed)),
                    _ => ["random", "ideal"].contains(&tuned) && !["icp", "fgr"].contains(&method),
                }
        };
        // No axis of cells: it has the settings of rows of a sensor set by hand.
        let mut cells: Vec<Cell> = cells.into_iter().map(|cell| cell.without("hand")).collect();
        cells.retain(|cell| !is_left_out(cell));
        // One condition after the other: what is to be shown comes first.
        cells.sort_by_key(|cell| self.condition.iter().position(|c| c == cell.of("condition")));
        cells
    }
}

/// Cells left of those done, and the processor time they will take by the searches' lines.
fn price_of(cells: &[Cell], done: &[Line<Run>], lines: &[Line<Run>]) -> String {
    let is_done = |cell: &Cell| Some(done.iter().any(|line| line.cell == *cell));
    let left = Unfinished::of(cells, is_done);
    let price = priced(&left.cells, |cell| Some(seconds(cell, lines)));
    format!("{} of {} cells are done{price}", left.done, cells.len())
}

/// Processor time of a cell, s: that of the lines of its row, method and condition; without any,
/// what the plan says, by what the lines took of what it said. A choice taken apart is judged as
/// halves put together are.
fn seconds(cell: &Cell, lines: &[Line<Run>]) -> f64 {
    let cell =
        &if interactions::is_one(cell) { cell.with("tuned", "combined") } else { cell.clone() };
    let alike: [&[&str]; 2] =
        [&["tuned", "method", "condition", "scene"], &["tuned", "method", "condition"]];
    let of_alike = alike.iter().find_map(|axes| {
        let is_alike = |line: &&Line<Run>| axes.iter().all(|a| line.cell.of(a) == cell.of(a));
        let of_them: Vec<f64> =
            lines.iter().filter(is_alike).map(|line| line.result.cpu_s).collect();
        (!of_them.is_empty()).then(|| of_them.iter().sum::<f64>() / of_them.len() as f64)
    });
    of_alike.unwrap_or_else(|| {
        let taken: f64 = lines.iter().map(|line| line.result.cpu_s).sum();
        let planned: f64 = lines.iter().map(|line| PROOF.cost(&line.cell)).sum();
        PROOF.cost(cell) * if lines.is_empty() { 1.0 } else { taken / planned }
    })
}

/// Run of a cell.
fn job(cell: &Cell, lines: &[Line<Run>]) -> Result<Option<Job>> {
    let evaluate = |arguments| Some(Job { command: "evaluate".into(), arguments });
    let tune = |arguments| Some(Job { command: "tune".into(), arguments });
    Ok(match cell.of("tuned") {
        "nothing" => evaluate(Vec::new()),
        "combined" | "combined-half" | "combined-hand" | "ideal" => candidate(cell, lines)?,
        "registration" | "registration-half" => tune(Vec::new()),
        "sequence" => tune(sensor_of(&cell.with("tuned", parts("sequence")[0]), lines)?),
        "hand" => tune(set_by_hand(cell).iter().map(|own| format!("--set={own}")).collect()),
        // What searches the sensor knows the one set by hand.
        _ => tune(warm_start(&set_by_hand(cell)).into_iter().collect()),
    })
}

/// Settings of the sensor set by hand for a cell's condition.
fn set_by_hand(cell: &Cell) -> Vec<String> {
    let mut settings = PROOF.settings(&Cell::default().with("hand", cell.of("condition")));
    settings.retain(|setting| setting.starts_with("lidar."));
    settings
}

/// Flags that set the sensor to what a cell's search chose, where that differs from the start: no
/// choice among names is searched, so these are numbers.
fn sensor_of(cell: &Cell, lines: &[Line<Run>]) -> Result<Vec<String>> {
    let start = &line_of(&cell.with("tuned", "nothing"), lines)?.result.parameters;
    let own = line_of(cell, lines)?.result.parameters.iter();
    let own =
        own.filter(|(name, value)| name.starts_with("lidar.") && start.get(*name) != Some(*value));
    Ok(own.map(|(name, value)| format!("--set={name}={value}")).collect())
}

/// Flag by which a search may begin at these settings.
fn warm_start(settings: &[String]) -> Option<String> {
    let field = |setting: &String| {
        let (key, value) = setting.split_once('=')?;
        Some(format!("\"{key}\"={value}"))
    };
    let table: Vec<String> = settings.iter().filter_map(field).collect();
    (!table.is_empty()).then(|| format!("--set=tune.warm_starts=[{{{}}}]", table.join(",")))
}

/// Searches whose sensor and registration a row takes, and the one that it begins at.
fn parts(tuned: &str) -> &'static [&'static str] {
    match tuned {
        "combined" => &["lidar", "registration"],
        "combined-half" => &["lidar-half", "registration-half"],
        "combined-hand" => &["lidar", "hand"],
        "ideal" => &["hand"],
        "sequence" => &["lidar-half"],
        _ => &[],
    }
}

/// Run that judges the sensor of a row's first part with the registration of its last.
fn candidate(cell: &Cell, lines: &[Line<Run>]) -> Result<Option<Job>> {
    let parts = parts(cell.of("tuned"));
    let ends = parts.first().zip(parts.last()).context("a row without parts")?;
    judged(cell, &combined(cell, lines, [ends.0, ends.1])?).map(Some)
}

/// Run that judges these parameters.
fn judged(cell: &Cell, parameters: &BTreeMap<String, f64>) -> Result<Job> {
    let name = format!("proof/{}.json", cell.to_string().replace(' ', "-"));
    let path = built(&workspace()?).join(name);
    write_parameters(&path, parameters)?;
    let arguments = vec![format!("--candidate={}", path.display()), "--pairs=test".into()];
    Ok(Job { command: "evaluate".into(), arguments })
}

/// The sensor of one row and the registration of another, of the same place and seed.
fn combined(
    cell: &Cell,
    lines: &[Line<Run>],
    [sensor, registration]: [&str; 2],
) -> Result<BTreeMap<String, f64>> {
    let mut all = BTreeMap::new();
    for (row, section) in [(sensor, "lidar."), (registration, "registration.")] {
        let line = line_of(&cell.with("tuned", row), lines)?;
        let own = line.result.parameters.iter().filter(|(name, _)| name.starts_with(section));
        all.extend(own.map(|(name, &value)| (name.clone(), value)));
    }
    Ok(all)
}

/// Line of a cell.
fn line_of<'a>(cell: &Cell, lines: &'a [Line<Run>]) -> Result<&'a Line<Run>> {
    let line = lines.iter().find(|line| line.cell == *cell);
    line.with_context(|| format!("no line of {cell}, which comes first"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        proof: Proof,
    }

    fn cells(flags: &[&str]) -> Vec<Cell> {
        Command::parse_from([&["proof"], flags].concat()).proof.cells()
    }

    fn line(cell: &Cell, cpu_s: f64, parameters: &[(&str, f64)]) -> Line<Run> {
        let parameters = parameters.iter().map(|&(name, value)| (name.to_owned(), value));
        let result = Run { cpu_s, parameters: parameters.collect(), ..record::fixture(100, 1) };
        Line { cell: cell.clone(), made: "today".into(), result }
    }

    #[test]
    fn all_of_it_is_every_row_in_the_dim_then_two_with_the_whole_budget_a_seed_after_the_other() {
        let all = cells(&[]);
        let is_of = |condition: &'static str| move |cell: &&Cell| cell.of("condition") == condition;
        let dim: Vec<&Cell> = all.iter().filter(is_of("dim")).collect();
        let whole: Vec<&Cell> = all.iter().filter(is_of("whole")).collect();
        assert_eq!([dim.len(), whole.len()], [(13 * 4 - 2 * 2) * 3 * 5, 2 * 3 * 3 * 3]);
        assert!(all[..dim.len()].iter().eq(dim.iter().copied()));
        assert!(dim.is_sorted_by_key(|cell| cell.of("seed")));
        assert!(whole.iter().all(|cell| ["nothing", "joint"].contains(&cell.of("tuned"))));
        assert_eq!(cells(&["--condition=whole", "--tuned=hand", "--seed=621"]).len(), 4 * 3);
        assert_eq!(cells(&["--condition=whole", "--method=gicp", "--seed=621"]).len(), 13 * 3);
        // What is put together comes after what it is made of.
        let place = |tuned: &str| all.iter().position(|cell| cell.of("tuned") == tuned).unwrap();
        assert!(place("combined") > place("lidar").max(place("registration")));
        assert!(place("combined-half") > place("lidar-half").max(place("registration-half")));
        assert!(place("combined-hand") > place("lidar").max(place("hand")));
        assert!(place("ideal") > place("hand"));
        assert!(place("sequence") > place("lidar-half"));
    }

    #[test]
    fn registration_after_the_sensor_begins_at_what_the_sensor_s_search_changed() {
        let cell = &cells(&["--tuned=sequence"])[0];
        let with = |power: f64, denoise: f64| {
            [("lidar.power", power), ("lidar.denoise", denoise), ("registration.b", power)]
        };
        let lines = [
            line(&cell.with("tuned", "nothing"), 1.0, &with(1.0, 2.0)),
            line(&cell.with("tuned", "lidar-half"), 1.0, &with(0.25, 2.0)),
        ];
        let flags = |lines: &[Line<Run>]| job(cell, lines).map(|job| job.unwrap().arguments);
        assert_eq!(flags(&lines).unwrap(), ["--set=lidar.power=0.25"]);
        assert!(flags(&lines[..1]).unwrap_err().to_string().contains("lidar-half"));
    }

    #[test]
    fn what_searches_the_sensor_may_begin_at_the_one_set_by_hand() {
        let of = |tuned: &str, condition: &str| {
            let cell = cells(&[&format!("--tuned={tuned}"), &format!("--condition={condition}")]);
            job(&cell[0], &[]).unwrap().unwrap().arguments
        };
        let quarter = "--set=tune.warm_starts=[{\"lidar.rows\"=16,\"lidar.elevation_span\"=30}]";
        for tuned in ["lidar", "lidar-half", "random", "joint"] {
            assert_eq!(of(tuned, "quarter"), [quarter]);
            assert!(of(tuned, "whole").is_empty());
        }
        assert!(of("registration", "quarter").is_empty());
    }

    #[test]
    fn the_halves_combined_are_the_sensor_of_one_and_the_registration_of_the_other() {
        let cell = &cells(&["--tuned=combined"])[0];
        let lines = [
            line(&cell.with("tuned", "lidar"), 1.0, &[("lidar.a", 1.0), ("registration.b", 2.0)]),
            line(
                &cell.with("tuned", "registration"),
                1.0,
                &[("lidar.a", 3.0), ("registration.b", 4.0)],
            ),
            line(&cell.with("tuned", "lidar").with("seed", "9"), 1.0, &[("lidar.a", 5.0)]),
        ];
        let halves = ["lidar", "registration"];
        let both = combined(cell, &lines, halves).unwrap();
        let expected = [("lidar.a".to_owned(), 1.0), ("registration.b".to_owned(), 4.0)];
        assert_eq!(both, expected.into());
        let error = combined(cell, &lines[..1], halves).unwrap_err().to_string();
        assert!(error.contains("registration") && error.contains("comes first"), "{error}");
    }

    #[test]
    fn rows_put_together_take_the_halves_that_their_names_say() {
        let cell = cells(&["--tuned=ideal"])[0].with("seed", "999999"); // a file of its own
        let own = |(row, value): (&str, f64)| {
            line(&cell.with("tuned", row), 1.0, &[("lidar.a", value), ("registration.b", value)])
        };
        let rows = ["lidar", "registration", "lidar-half", "registration-half", "hand"];
        let lines: Vec<Line<Run>> =
            rows.into_iter().zip([1.0, 2.0, 3.0, 4.0, 5.0]).map(own).collect();
        for (row, expected) in [
            ("combined", [1.0, 2.0]),
            ("combined-half", [3.0, 4.0]),
            ("combined-hand", [1.0, 5.0]),
            ("ideal", [5.0, 5.0]),
        ] {
            let job = job(&cell.with("tuned", row), &lines).unwrap().unwrap();
            let path = job.arguments[0].strip_prefix("--candidate=").unwrap();
            let text = fs::read_to_string(path).unwrap();
            let found: serde_json::Value = serde_json::from_str(&text).unwrap();
            let of = |name: &str| found["parameters"][name].as_f64().unwrap();
            assert_eq!([of("lidar.a"), of("registration.b")], expected, "{row}");
            fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn a_cell_costs_what_the_lines_most_like_it_did() {
        let cells = cells(&["--tuned=joint", "--method=icp,mac", "--condition=dim", "--seed=621"]);
        let of = |method: &str, scene: &str| {
            let is_it = |cell: &&Cell| [cell.of("method"), cell.of("scene")] == [method, scene];
            cells.iter().find(is_it).unwrap()
        };
        let same = of("icp", "structured");
        let planned = PROOF.cost(same);
        assert!(planned > 60.0 && seconds(same, &[]) == planned);
        let lines = [line(same, 100.0, &[]), line(of("icp", "unstructured"), 300.0, &[])];
        assert_eq!(seconds(&same.with("seed", "622"), &lines), 100.0);
        assert_eq!(seconds(of("icp", "semi-structured"), &lines), 200.0);
        // Of others it is what the plan says, in the same proportion.
        for other in [of("mac", "structured"), &same.with("tuned", "random")] {
            let expected = PROOF.cost(other) * 200.0 / planned;
            assert!((seconds(other, &lines) / expected - 1.0).abs() < 1e-9, "{other}");
        }
        let left = 200.0 + 3.0 * seconds(of("mac", "structured"), &lines);
        let expected = format!(
            "2 of 6 cells are done; 4 left, about {:.1} hours of a processor",
            left / 3600.0
        );
        assert_eq!(price_of(&cells, &lines, &lines), expected);
    }

    #[test]
    fn a_sensor_set_by_hand_has_its_condition_s_settings_and_registration_is_searched() {
        for condition in PROOF.names("condition") {
            let cell = cells(&["--tuned=hand"])[0].with("condition", condition);
            let job = job(&cell, &[]).unwrap().unwrap();
            assert_eq!(job.command, "tune");
            assert!(PROOF.names("hand").any(|name| name == condition), "{condition}");
            assert!(job.arguments.iter().all(|a| a.starts_with("--set=lidar.")), "{condition}");
            assert!(PROOF.settings(&cell).contains(&"tune.protocol=registration".to_owned()));
        }
    }

    #[test]
    fn every_committed_line_is_a_cell_of_its_plan() {
        let both = [&*PROOF, &*TAKEN_BACK].map(|plan| recorded::<Run>(plan).unwrap());
        for Line { cell, .. } in both.into_iter().flatten() {
            for axis in ["tuned", "method", "scene", "condition"] {
                assert!(PROOF.names(axis).any(|value| value == cell.of(axis)), "{cell}: {axis}");
            }
        }
    }
}
