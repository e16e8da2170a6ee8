//! Fig. 1: interactions of parameters, from the covariance of the joint search.

use super::super::axes::name_of;
use super::super::cell::Cell;
use super::Drawn;
use super::cells::Cells;
use super::chance::{BlindSearch, Chance};
use super::search::Search;
use echoloop_closed_loop::config::preset::Strategy;
use echoloop_closed_loop::parameters::choices;
use echoloop_closed_loop::run_folder::run::Background;
use echoloop_report::finished_runs::FinishedRun;
use echoloop_report::{Moved, Panel, PanelDrawing, Plate, fixed, significant};

/// Bound on the number of parameters; a file with more is not ours.
const MAX_NAMES: usize = 100;

/// A figure for each cell where both were tuned, and a sentence about those that are missing.
pub(super) fn plates(cells: &Cells, search: &Search) -> Drawn {
    let mut chance = Chance::default();
    let joint: Vec<Cell> =
        search.methods().into_iter().flat_map(|method| search.joint(method)).collect();
    let (mut all, mut absent) = (Drawn::new(), Vec::new());
    for &cell in &joint {
        match plate(cells, search, &cell, &mut chance) {
            Some(plate) => all.push(Ok(plate)),
            None => absent.push(cell),
        }
    }
    if !absent.is_empty() {
        let figure = format!(
            "{} of {} maps of how parameters interact (Fig. 1), {}",
            absent.len(),
            joint.len(),
            search.in_words()
        );
        all.push(Err(cells.missing.of_all(&figure, &absent)));
    }
    all
}

fn plate(cells: &Cells, search: &Search, cell: &Cell, chance: &mut Chance) -> Option<Plate> {
    let run = cells.run(cell)?;
    let background = run.background().ok()?;
    let moved = moved(run, background, chance)?;
    let [learned, all] = moved.learned();
    let of = format!("{}, {}", cell.method.title(), name_of(cell.scene));
    let (name, strength) = (
        format!("interactions-{}-{}-{}", search.name(), name_of(cell.method), name_of(cell.scene)),
        moved.chance,
    );
    let stage = background.stages.last()?;
    let title = format!("How parameters interact (Fig. 1): {of}, {}", search.in_words());
    Some(Plate {
        title,
        caption: format!(
            "Correlations of the search distribution at its end, D^−1/2 C D^−1/2 of CMA-ES: red \
             where two parameters grew together, blue where one grew as the other fell. Parameters \
             of the sensor come before the lines, those of registration after. Grey is no stronger \
             than {}, which 95 % of the correlations stay below when the same search ({} \
             generations of {} candidates) gets random numbers for errors; {learned} of {all} are \
             stronger, and by chance about {} would be. Correlations show where good candidates \
             lay in one run, not the effect of a parameter on the error. From the cell {}.",
            significant(strength),
            stage.generations,
            stage.population,
            fixed(0.05 * all as f64, 0),
            cell.file_name()
        ),
        missing: String::new(),
        columns: 1,
        panels: vec![Panel {
            name: format!("{name}-map"),
            title: of,
            drawing: PanelDrawing::Moved(moved),
        }],
        name,
    })
}

fn moved(run: &FinishedRun, background: &Background, chance: &mut Chance) -> Option<Moved> {
    let names = &background.correlated;
    let square = &background.correlations;
    let is_square = square.len() == names.len() && square.iter().all(|r| r.len() == names.len());
    if !(2..=MAX_NAMES).contains(&names.len()) || !is_square {
        return None;
    }
    let stage = background.stages.last()?;
    // The paper's search has no choices among names.
    let has_choices = run.config.tune.strategy == Strategy::Fast;
    let count = |name: &String| Some(choices(name).len()).filter(|&n| n > 0 && has_choices);
    let blind = BlindSearch {
        choices: names.iter().map(count).collect(),
        sigma: run.config.tune.sigma,
        population: stage.population,
        generations: stage.generations,
    };
    Some(Moved {
        of_sensor: names.iter().filter(|name| name.starts_with("lidar.")).count(),
        chance: chance.of(&blind),
        names: names.clone(),
        matrix: square.clone(),
    })
}
