//! Fig. 1: settings tuned by hand, the default, and our joint tuning.

use super::super::axes::{ByHand, Scene, name_of};
use super::super::cell::Cell;
use super::super::record::Record;
use super::Drawn;
use super::cells::Cells;
use super::errors::{PARTS, Part};
use super::search::Search;
use clap::ValueEnum;
use echoloop_closed_loop::config::preset::{Preset, Protocol};
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::succeeds;
use echoloop_report::{Panel, PanelDrawing, Plate, StripRow, Strips, fixed};
use echoloop_statistics::median;

/// Figure of a search; none where its method is not selected.
pub(super) fn plates(cells: &Cells, search: &Search) -> Drawn {
    let is_selected = search.methods().contains(&ByHand::METHOD);
    is_selected.then(|| plate(cells, search)).into_iter().collect()
}

/// Rows of a scene: the default, the cases tuned by hand, joint tuning.
fn rows(search: &Search, scene: Scene) -> Vec<Cell> {
    let is_wanted = |cell: &&Cell| matches!(cell.protocol, Protocol::Default | Protocol::Joint);
    let mut rows: Vec<Cell> = search.of(ByHand::METHOD, scene).filter(is_wanted).copied().collect();
    let start = rows.first().map(Cell::untuned).into_iter();
    let by_hand = |start, hand| Cell { by_hand: Some(hand), ..start };
    let all = ByHand::value_variants();
    let hands = start.flat_map(|start| all.iter().map(move |&hand| by_hand(start, hand)));
    let place = usize::from(rows.iter().any(|cell| cell.protocol == Protocol::Default));
    rows.splice(place..place, hands.collect::<Vec<_>>());
    rows
}

fn plate(cells: &Cells, search: &Search) -> Result<Plate, String> {
    let scenes = search.scenes();
    let wanted: Vec<Vec<Cell>> = scenes.iter().map(|&scene| rows(search, scene)).collect();
    let all = wanted.concat();
    let hands: Vec<Cell> = all.iter().filter(|cell| cell.by_hand.is_some()).copied().collect();
    if cells.absent(&hands).len() == hands.len() {
        let figure = format!("tuned by hand against ours (Fig. 1), {}", search.in_words());
        return Err(cells.missing.of_all(&figure, &hands));
    }
    let records: Vec<&Record> = all.iter().filter_map(|cell| cells.record(cell)).collect();
    let mut panels = Vec::new();
    for part in &PARTS {
        let (bound, span) = part.range(&records);
        panels.extend(scenes.iter().zip(&wanted).map(|(&scene, of_scene)| Panel {
            name: format!("by-hand-{}-{}-{}", search.name(), name_of(scene), part.name),
            title: format!("{}, {}", ByHand::METHOD.title(), name_of(scene)),
            drawing: PanelDrawing::Strips(Strips {
                axis: part.axis.into(),
                span,
                bound,
                said: "recall".into(),
                rows: of_scene.iter().map(|cell| row(cell, cells.record(cell), part)).collect(),
            }),
        }));
    }
    Ok(Plate {
        name: format!("by-hand-{}", search.name()),
        title: format!("Tuned by hand against ours (Fig. 1), {}", search.in_words()),
        caption: caption(cells, search, &all),
        missing: cells.missing.of_some(all.len(), &cells.absent(&all)),
        columns: scenes.len(),
        panels,
    })
}

fn caption(cells: &Cells, search: &Search, all: &[Cell]) -> String {
    let cases = ByHand::value_variants().iter().map(|&hand| {
        format!("Case {} ({}): {}.", hand.0 + 1, name_of(hand), in_words(hand, search.ranges))
    });
    format!(
        "The error of every held-out pair with the default, with three cases tuned by hand as the \
         paper describes them, and with both tuned by the search; at the right the recall. {} All \
         else is the default. {}",
        cases.collect::<Vec<_>>().join(" "),
        cells.sources(all)
    )
}

/// Settings of a case in words.
fn in_words(case: ByHand, ranges: Preset) -> String {
    let words = |setting: &String| {
        let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
        match key {
            "lidar.power" => format!("{value} W"),
            "lidar.gain" => format!(", gain {value} dB"),
            "lidar.noise_floor" => format!(", noise floor {value} of full scale"),
            "lidar.snr_threshold" => format!(", threshold {value} σ"),
            "registration.normal_neighbours" => format!("; normals of {value} points"),
            "registration.normal_radius_m" => format!(" within {value} m"),
            "registration.max_pair_distance_m" => format!(", pairs up to {value} m"),
            _ => format!(", {setting}"),
        }
    };
    case.settings(ranges).iter().map(words).collect()
}

/// Row of a cell; empty where it is not finished.
fn row(cell: &Cell, record: Option<&Record>, part: &Part) -> StripRow {
    let name = match cell.by_hand {
        Some(hand) => format!("{} {}", hand.0 + 1, name_of(hand)),
        None => name_of(cell.protocol),
    };
    let pair = |of: &Record, error: &PairError| ((part.read)(error), succeeds(error, &of.data));
    let pairs = |of: &Record| of.summary.errors.iter().map(|error| pair(of, error)).collect();
    let pairs: Vec<(f64, bool)> = record.map_or_else(Vec::new, pairs);
    let recall = |of: &Record| format!("{} %", fixed(of.summary.recall_pct, 0));
    StripRow {
        name,
        strong: cell.is_joint(),
        median: median(pairs.iter().map(|(error, _)| *error)),
        pairs,
        said: record.map_or_else(|| "not run".into(), recall),
    }
}
