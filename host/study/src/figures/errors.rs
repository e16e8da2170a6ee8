//! Distribution of the errors on the held-out pairs, a curve for each protocol.

use super::super::axes::name_of;
use super::super::cell::Cell;
use super::super::record::Record;
use super::Drawn;
use super::cells::Cells;
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
    bound: fn(&DataConfig) -> f64,
}

/// Parts of the pose error, in the units of the table.
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
    /// Bound of success of some records, and the ends of a logarithmic axis with room for their
    /// errors, the bound, and a tenth of it.
    pub(super) fn range(&self, records: &[&Record]) -> (f64, [f64; 2]) {
        let bound = records.first().map_or(1.0, |record| (self.bound)(&record.data));
        let errors = records.iter().flat_map(|record| self.errors(record));
        let known = errors.filter(|error| error.is_finite()).map(|error| error.max(self.floor));
        let ends = (0.1 * bound, bound);
        let (low, high) = known.fold(ends, |(low, high), e| (low.min(e), high.max(e)));
        (bound, [low / 1.3, high * 1.3])
    }

    /// Errors of all pairs, found or not.
    fn errors(&self, record: &Record) -> impl Iterator<Item = f64> {
        record.summary.errors.iter().map(self.read)
    }
}

/// Figure of a search: a row for each method and part, a column for each scene.
pub(super) fn plates(cells: &Cells, search: &Search) -> Drawn {
    let absent = cells.absent(&search.cells);
    if absent.len() == search.cells.len() {
        let figure = format!("errors by protocol, {}", search.in_words());
        return vec![Err(cells.missing.of_all(&figure, &absent))];
    }
    let scenes = search.scenes();
    let mut panels = Vec::new();
    for method in search.methods() {
        let of_method = search.cells.iter().filter(|cell| cell.method == method);
        let records: Vec<&Record> = of_method.filter_map(|cell| cells.record(cell)).collect();
        for part in &PARTS {
            let (bound, span) = part.range(&records);
            panels.extend(scenes.iter().map(|&scene| {
                let curve =
                    |cell: &Cell| Some((cell.protocol, part.errors(cells.record(cell)?).collect()));
                let curves = search.of(method, scene).filter_map(curve).collect();
                let axis = part.axis.into();
                let of = [search.name(), name_of(method), name_of(scene)].join("-");
                Panel {
                    name: format!("errors-{of}-{}", part.name),
                    title: format!("{}, {}", method.title(), name_of(scene)),
                    drawing: PanelDrawing::Shares(Shares { axis, span, bound, curves }),
                }
            }));
        }
    }
    vec![Ok(Plate {
        name: format!("errors-{}", search.name()),
        title: format!("Errors on the held-out pairs, {}", search.in_words()),
        caption: format!(
            "Share of all pairs, failed ones included, with at most this error, by what was tuned. \
             The line is the bound of success; a pair that is found is within both, of translation \
             and of rotation. Where curves coincide, the dashed lie on the full. {}",
            cells.sources(&search.cells)
        ),
        missing: cells.missing.of_some(search.cells.len(), &absent),
        columns: scenes.len(),
        panels,
    })]
}
