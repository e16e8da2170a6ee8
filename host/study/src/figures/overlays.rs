//! A held-out pair of each scene from above, before and after registration.

use super::super::axes::{TableMethod, name_of};
use super::super::cell::Cell;
use super::super::record::Record;
use super::Drawn;
use super::cells::Cells;
use super::search::Search;
use echoloop_clouds::Cloud;
use echoloop_clouds::pose::{Pose, rotation_error_deg, translation_error_m};
use echoloop_report::{Overlay, Panel, PanelDrawing, Plate, fixed};
use echoloop_statistics::median;

/// Half of the side of a panel, m.
const HALF_M: f64 = 16.0;

/// Length of the scale bar, m.
const BAR_M: f64 = 5.0;

/// The panel is centred on the target's points nearer than this to its sensor, m.
const NEAR_M: f64 = 25.0;

/// Points lower than this below their sensor, m, are ground and left out.
const GROUND_M: f64 = -1.4;

/// A pair that was scanned and registered again.
#[derive(Clone, Debug)]
pub struct SeenPair {
    /// The cell where both were tuned.
    pub cell: Cell,
    /// Index among the held-out pairs.
    pub pair: usize,
    /// Before registration; with the default, the LiDAR tuned, registration tuned, both. `None`
    /// where a half is unfinished or cannot be shown.
    pub views: [Option<LaidOn>; 5],
}

/// Names of the views of a pair.
const STEPS: [&str; 5] = ["before", "default", "LiDAR tuned", "registration tuned", "both tuned"];

/// Pairs that were scanned and registered again.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// The pairs.
    pub pairs: Vec<SeenPair>,
    /// Finished cells whose pair cannot be shown, with the reason.
    pub unseen: Vec<(Cell, String)>,
}

/// Two clouds, one laid on the other.
#[derive(Clone, Debug)]
pub struct LaidOn {
    /// x and y of target and source in the target's frame, m, without the ground around the
    /// sensor.
    pub clouds: [Vec<[f64; 2]>; 2],
    /// e_t, m.
    pub translation_m: f64,
    /// e_R, degrees.
    pub rotation_deg: f64,
}

impl LaidOn {
    /// Lays the source on the target by a motion; each cloud is in its sensor's frame.
    pub fn new([target, source]: &[Cloud; 2], target_from_source: &Pose, truth: &Pose) -> Self {
        let above = |cloud: &Cloud, pose: &Pose| -> Vec<[f64; 2]> {
            let points = cloud.points.iter().filter(|point| f64::from(point.z) > GROUND_M);
            let laid = points.map(|point| pose * point.cast::<f64>());
            laid.map(|point| [point.x, point.y]).collect()
        };
        Self {
            clouds: [above(target, &Pose::identity()), above(source, target_from_source)],
            translation_m: translation_error_m(target_from_source, truth),
            rotation_deg: rotation_error_deg(target_from_source, truth),
        }
    }
}

/// Index of the pair of median error ‖T − T*‖_F; of an even number, the better of the middle two.
pub fn shown_pair(record: &Record) -> Option<usize> {
    let mut errors: Vec<_> = record.summary.errors.iter().collect();
    errors.sort_by(|a, b| a.frobenius.total_cmp(&b.frobenius).then(a.pair.cmp(&b.pair)));
    errors.get(errors.len().checked_sub(1)? / 2).map(|error| error.pair)
}

/// A figure for each method, or the reason why there is none.
pub(super) fn plates(cells: &Cells, search: &Search, seen: &Seen) -> Drawn {
    let methods = search.methods().into_iter().map(|method| (method, search.joint(method)));
    let wanted = methods.filter(|(_, joint)| !joint.is_empty());
    wanted.map(|(method, joint)| plate(cells, search, seen, method, &joint)).collect()
}

fn plate(
    cells: &Cells,
    search: &Search,
    seen: &Seen,
    method: TableMethod,
    joint: &[Cell],
) -> Result<Plate, String> {
    let of = |cell: &Cell| seen.pairs.iter().find(|pair| pair.cell == *cell);
    let pairs: Vec<&SeenPair> = joint.iter().filter_map(of).collect();
    let is_unseen = |cell: &Cell| seen.unseen.iter().any(|(unseen, _)| unseen == cell);
    let is_missing = |cell: &&Cell| of(cell).is_none() && !is_unseen(cell);
    let mut absent: Vec<Cell> = joint.iter().filter(is_missing).copied().collect();
    let is_half = |cell: &Cell, half: &Cell| cell.halves().contains(half);
    let wanted = |half: &Cell| pairs.iter().any(|pair| is_half(&pair.cell, half));
    let missing_half = |half: &&Cell| wanted(half) && cells.record(half).is_none();
    absent.extend(search.cells.iter().filter(missing_half));
    let is_own = |cell: &Cell| joint.iter().any(|own| own == cell || is_half(own, cell));
    let unseen = seen.unseen.iter().filter(|(cell, _)| is_own(cell));
    let unseen: Vec<String> = unseen.map(|(cell, why)| format!("{cell}: {why}.")).collect();
    if pairs.is_empty() {
        let figure = format!("registered clouds, {}, {}", method.title(), search.in_words());
        return Err(match unseen.is_empty() {
            true => cells.missing.of_all(&figure, &absent),
            false => format!("Left out: {figure}. {}", unseen.join(" ")),
        });
    }
    let names = pairs.iter().map(|pair| format!("{} pair {}", name_of(pair.cell.scene), pair.pair));
    let missing = cells.missing.of_some(joint.len(), &absent);
    Ok(Plate {
        name: format!("overlays-{}-{}", search.name(), name_of(method)),
        title: format!("Registered clouds: {}, {}", method.title(), search.in_words()),
        caption: format!(
            "A held-out pair of each scene from above: as scanned with the default, registered \
             with the default, and scanned and registered with the LiDAR tuned, registration \
             tuned, and both. It is the pair of median error with both tuned ({}). A panel is {} m \
             wide around the middle of the target; points more than {} m below their sensor (the \
             ground) are left out. {}",
            names.collect::<Vec<_>>().join(", "),
            2.0 * HALF_M,
            -GROUND_M,
            cells.sources(joint)
        ),
        missing: [vec![missing], unseen].concat().join(" ").trim().to_owned(),
        columns: STEPS.len(),
        panels: pairs.iter().flat_map(|pair| panels(search, pair)).collect(),
    })
}

fn panels(search: &Search, pair: &SeenPair) -> Vec<Panel> {
    let scene = name_of(pair.cell.scene);
    let target = pair.views.iter().flatten().next().map(|view| &view.clouds[0]);
    let centre_m = middle(target.map_or(&[], Vec::as_slice));
    let panel = |(step, view): (&str, &Option<LaidOn>)| Panel {
        name: format!(
            "overlay-{}-{}-{scene}-{}",
            search.name(),
            name_of(pair.cell.method),
            step.to_lowercase().replace(' ', "-")
        ),
        title: match view {
            Some(view) => format!(
                "{scene}, {step}: {} cm, {}°",
                fixed(100.0 * view.translation_m, 1),
                fixed(view.rotation_deg, 2)
            ),
            None => format!("{scene}, {step}: not to be had"),
        },
        drawing: PanelDrawing::Overlay(Overlay {
            half_m: HALF_M,
            centre_m,
            clouds: view.as_ref().map(|view| view.clouds.clone()).unwrap_or_default(),
            bar_m: BAR_M,
        }),
    };
    STEPS.into_iter().zip(&pair.views).map(panel).collect()
}

/// Centre of a panel: median x and y of the target's points near its sensor.
fn middle(target: &[[f64; 2]]) -> [f64; 2] {
    let near = |point: &&[f64; 2]| point[0].hypot(point[1]) < NEAR_M;
    let along = |axis: usize| median(target.iter().filter(near).map(|point| point[axis]));
    [0, 1].map(along).map(|middle| if middle.is_finite() { middle } else { 0.0 })
}
