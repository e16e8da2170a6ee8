//! The paper's Table 1.

use serde::Serialize;

use super::axes::{Scene, TableMethod};
use echoloop_closed_loop::config::preset::Protocol;

/// The paper's figures of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperFigures {
    /// Mean e_t over the successes, cm.
    pub translation_cm: f64,
    /// Mean e_R over the successes, degrees.
    pub rotation_deg: f64,
    /// Share of successes, percent.
    pub recall_pct: f64,
}

type Kinds = [[f64; 3]; 3];

/// Translation (cm), rotation (degrees) and recall (percent) in structured, semi-structured and
/// unstructured scenes. Rows: nothing, the sensor, registration, both tuned.
const ICP: [Kinds; 4] = [
    [[3.0, 0.2, 100.0], [4.0, 0.3, 100.0], [4.0, 0.4, 100.0]],
    [[3.0, 0.2, 100.0], [4.0, 0.3, 100.0], [4.0, 0.4, 100.0]],
    [[2.0, 0.2, 100.0], [6.0, 0.6, 100.0], [10.0, 0.9, 100.0]],
    [[1.0, 0.1, 100.0], [2.0, 0.2, 100.0], [2.0, 0.1, 100.0]],
];
const FGR: [Kinds; 4] = [
    [[61.0, 3.33, 14.1], [69.0, 3.41, 6.06], [67.0, 2.64, 18.1]],
    [[78.0, 2.75, 22.2], [69.0, 3.22, 11.1], [17.0, 2.59, 5.05]],
    [[61.0, 2.90, 31.3], [80.0, 2.43, 13.1], [63.0, 3.12, 35.3]],
    [[63.0, 1.73, 35.4], [78.0, 2.8, 17.1], [71.0, 1.71, 60.0]],
];
const MAC: [Kinds; 4] = [
    [[87.0, 4.02, 48.4], [92.0, 4.61, 49.4], [61.0, 3.61, 56.6]],
    [[94.0, 4.46, 56.6], [62.0, 3.12, 51.5], [51.0, 2.92, 60.0]],
    [[65.0, 2.81, 48.4], [59.0, 2.98, 47.5], [49.0, 2.98, 60.0]],
    [[56.0, 2.63, 52.6], [51.0, 2.46, 68.6], [41.0, 2.63, 81.8]],
];

/// The paper's figures of a cell. Both our FGR rows have those of its one.
pub fn paper(protocol: Protocol, method: TableMethod, scene: Scene) -> PaperFigures {
    let of_method = match &*method.choice().name {
        "icp" => ICP,
        "mac" => MAC,
        _ => FGR,
    };
    let [translation_cm, rotation_deg, recall_pct] = of_method[protocol as usize][scene.0];
    PaperFigures { translation_cm, rotation_deg, recall_pct }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_of_the_table_are_the_paper_s() {
        let at = |protocol, method, scene| {
            let (method, scene) = (TableMethod::named(method), Scene::named(scene));
            let PaperFigures { translation_cm, rotation_deg, recall_pct } =
                paper(protocol, method.unwrap(), scene.unwrap());
            [translation_cm, rotation_deg, recall_pct]
        };
        let (first, last) = ("structured", "unstructured");
        assert_eq!(at(Protocol::Default, "icp", first), [3.0, 0.2, 100.0]);
        assert_eq!(at(Protocol::Lidar, "fgr", last), [17.0, 2.59, 5.05]);
        assert_eq!(at(Protocol::Registration, "icp", last), [10.0, 0.9, 100.0]);
        assert_eq!(at(Protocol::Joint, "fgr-open3d", last), [71.0, 1.71, 60.0]);
        assert_eq!(at(Protocol::Registration, "mac", "semi-structured"), [59.0, 2.98, 47.5]);
        assert_eq!(at(Protocol::Joint, "mac", last), [41.0, 2.63, 81.8]);
    }
}
