//! Values chosen for each parameter, by scene.

use super::super::axes::{Scene, TableMethod, name_of};
use super::super::cell::Cell;
use super::Drawn;
use super::cells::Cells;
use super::search::Search;
use echoloop_closed_loop::config::preset::Protocol;
use echoloop_closed_loop::parameters::effective;
use echoloop_closed_loop::run_folder::run::AxisRecord;
use echoloop_report::{ChosenLane, ChosenRange, Panel, PanelDrawing, Plate};

/// A figure for each method with a search, or the reason why there is none.
pub(super) fn plates(cells: &Cells, search: &Search) -> Drawn {
    let of_method = |method: TableMethod| {
        let is_of = |cell: &&Cell| cell.method == method && cell.is_searched();
        search.cells.iter().filter(is_of).copied().collect::<Vec<Cell>>()
    };
    let methods = search.methods().into_iter().map(|method| (method, of_method(method)));
    let wanted = methods.filter(|(_, wanted)| !wanted.is_empty());
    wanted.map(|(method, wanted)| plate(cells, search, method, &wanted)).collect()
}

fn plate(
    cells: &Cells,
    search: &Search,
    method: TableMethod,
    wanted: &[Cell],
) -> Result<Plate, String> {
    let (done, absent): (Vec<Cell>, Vec<Cell>) =
        wanted.iter().partition(|cell| cells.run(cell).is_some());
    let axes = axes(cells, &done);
    if axes.is_empty() {
        let figure = format!("what was chosen, {}, {}", method.title(), search.in_words());
        return Err(cells.missing.of_all(&figure, wanted));
    }
    Ok(Plate {
        name: format!("parameters-{}-{}", search.name(), name_of(method)),
        title: format!("What was chosen: {}, {}", method.title(), search.in_words()),
        caption: format!(
            "Every searched parameter over its range, with a logarithmic axis where the search is \
             logarithmic: the start of all searches (dashed), and the value that each chose in \
             each scene. A dot at an end suggests a wider range. {}",
            cells.sources(wanted)
        ),
        missing: cells.missing.of_some(wanted.len(), &absent),
        columns: 3,
        panels: axes.iter().map(|axis| panel(cells, search, &done, axis)).collect(),
    })
}

/// Axes of all searches, each once, the sensor's first.
fn axes(cells: &Cells, done: &[Cell]) -> Vec<AxisRecord> {
    let mut all: Vec<AxisRecord> = Vec::new();
    for cell in done {
        let background = cells.run(cell).and_then(|run| run.background().ok());
        for axis in background.into_iter().flat_map(|background| &background.axes) {
            if !all.iter().any(|known| known.name == axis.name) {
                all.push(axis.clone());
            }
        }
    }
    all.sort_by_key(|axis| !axis.name.starts_with("lidar."));
    all
}

fn panel(cells: &Cells, search: &Search, done: &[Cell], record: &AxisRecord) -> Panel {
    let (section, short) = record.name.split_once('.').unwrap_or(("", &record.name));
    let of_method = done.first().map_or_else(String::new, |cell| name_of(cell.method));
    let start = done.first().and_then(|cell| cells.run(cell));
    let start = start.and_then(|run| effective(&run.result.default, &record.name));
    let is_in_name = short.ends_with(&format!("_{}", record.unit));
    let unit = match record.unit.as_str() {
        unit if unit.is_empty() || is_in_name => String::new(),
        unit => format!(", {unit}"),
    };
    let tag = if ChosenRange::is_log(record) { ", log axis" } else { "" };
    let lane = |scene: Scene| lane(cells, done, scene, record);
    Panel {
        name: format!(
            "chosen-{}-{of_method}-{section}-{}",
            search.name(),
            short.replace(['_', '.'], "-")
        ),
        title: format!("{short}{unit}{tag}"),
        drawing: PanelDrawing::Chosen(ChosenRange {
            axis: record.clone(),
            start: start.unwrap_or(f64::NAN),
            lanes: search.scenes().into_iter().map(lane).collect(),
        }),
    }
}

/// Values that the searches chose which moved the parameter.
fn lane(cells: &Cells, done: &[Cell], scene: Scene, record: &AxisRecord) -> ChosenLane {
    let mark = |cell: &Cell| {
        let run = cells.run(cell)?;
        let background = run.background().ok()?;
        background.axes.iter().find(|axis| axis.name == record.name)?;
        Some((cell.protocol, effective(&run.result.tuned, &record.name)?))
    };
    // Both together last: its dot lies inside the rings.
    let order = [Protocol::Lidar, Protocol::Registration, Protocol::Joint];
    let of = |protocol: Protocol| {
        let is_it = move |cell: &&Cell| (cell.scene, cell.protocol) == (scene, protocol);
        done.iter().filter(is_it).filter_map(mark).collect::<Vec<_>>()
    };
    ChosenLane { name: name_of(scene), marks: order.into_iter().flat_map(of).collect() }
}
