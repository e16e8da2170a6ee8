//! Distribution of the errors on the held-out pairs, a curve for each protocol.

use super::super::axes::name_of;
use super::super::cell::Cell;
use super::super::record::Record;
use super::cells::Cells;
use super::missing::Missing;
use super::search::Search;
use echoloop_closed_loop::config::DataConfig;
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_report::{Panel, PanelDrawing, Plate, Shares};

/// A part of a pose error.
pub(super) struct Part {
    /// Name in files.
    pub(super) name: &'static str,
    /// Caption of the axis, with the unit.
    pub(super) axis: &'static str,
    /// Errors below this are drawn at it.
    floor: f64,
    pub(super) read: fn(&PairError) -> f64,
    pub(super) bound: fn(&DataConfig) -> f64,
}

/// In the units of the table.
pub(super) const PARTS: [Part; 2] = [
    Part {
        name: "translation",
        axis: "translation error, cm",
        floor: 0.01,
        read: |error| 100.0 * error.translation_m,
        bound: |data| 100.0 * data.success_translation_m,
    },
    Part {
        name: "rotation",
        axis: "rotation error, °",
        floor: 1e-4,
        read: |error| error.rotation_deg,
        bound: |data| data.success_rotation_deg,
    },
];

impl Part {
    /// Ends of a logarithmic axis with room for the errors, the bound, and a tenth of it.
    pub(super) fn span(&self, errors: impl Iterator<Item = f64>, bound: f64) -> [f64; 2] {
        let known = errors.filter(|error| error.is_finite()).map(|error| error.max(self.floor));
        let ends = (0.1 * bound, bound);
        let (low, high) = known.fold(ends, |(low, high), e| (low.min(e), high.max(e)));
        [low / 1.3, high * 1.3]
    }
}

/// Figure of a search: a row for each method and part, a column for each scene.
pub(super) fn plate(cells: &Cells, search: &Search, missing: &Missing) -> Result<Plate, String> {
    let figure = format!("errors by protocol, {}", search.in_words());
    let (done, absent): (Vec<Cell>, Vec<Cell>) =
        search.cells.iter().partition(|cell| cells.record(cell).is_some());
    if done.is_empty() {
        return Err(missing.of_all(&figure, &absent));
    }
    let scenes = search.scenes();
    let mut panels = Vec::new();
    for method in search.methods() {
        for part in &PARTS {
            let of_row = || done.iter().filter(|cell| cell.method == method);
            let records: Vec<&Record> = of_row().filter_map(|cell| cells.record(cell)).collect();
            let bound = records.first().map_or(1.0, |record| (part.bound)(&record.data));
            let errors = records.iter().flat_map(|record| all(record, part));
            let span = part.span(errors, bound);
            panels.extend(scenes.iter().map(|&scene| {
                let curve = |cell: &Cell| {
                    let record = cells.record(cell)?;
                    Some((cell.protocol, all(record, part).collect()))
                };
                let curves = search.of(method, scene).filter_map(curve).collect();
                Panel {
                    name: format!(
                        "errors-{}-{}-{}-{}",
                        search.name(),
                        name_of(method),
                        name_of(scene),
                        part.name
                    ),
                    title: format!("{}, {}", method.title(), name_of(scene)),
                    drawing: PanelDrawing::Shares(Shares {
                        axis: part.axis.into(),
                        span,
                        bound,
                        curves,
                    }),
                }
            }));
        }
    }
    Ok(Plate {
        name: format!("errors-{}", search.name()),
        title: format!("Errors on the held-out pairs, {}", search.in_words()),
        caption: format!(
            "Share of all pairs, failed ones included, with at most this error, by what was tuned. \
             The line is the bound of success; a pair that is found is within both, of translation \
             and of rotation. Where curves coincide, the dashed lie on the full. {}",
            cells.sources(&search.cells)
        ),
        missing: missing.of_some(search.cells.len(), &absent),
        columns: scenes.len(),
        panels,
    })
}

/// Errors of all pairs, found or not.
fn all(record: &Record, part: &Part) -> impl Iterator<Item = f64> {
    record.summary.errors.iter().map(part.read)
}
