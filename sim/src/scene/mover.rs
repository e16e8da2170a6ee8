//! Vehicles that move between the scans of a pair.

use std::ops::Range;

use super::mesh::Mesh;
use crate::vector::mix;

/// Distance between the places of a path, metres.
pub(crate) const STEP_M: f64 = 1.0;

/// Vehicle that follows a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// Its vertices in the mesh of the scene.
    pub vertices: Range<usize>,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Path, one place every metre. The mesh has the vehicle at the first; it stops at the last.
    pub way: Vec<Placement>,
}

/// Position and heading of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Point on the ground below its middle, metres.
    pub at: [f64; 3],
    /// Heading, radians counter-clockwise from x.
    pub heading_rad: f64,
}

impl Mover {
    /// Placement after some seconds; `None` without a path.
    #[must_use]
    pub fn after(&self, seconds: f64) -> Option<Placement> {
        let steps = (self.speed_m_s * seconds / STEP_M).max(0.0);
        let last = self.way.len().checked_sub(1)?;
        let (k, part) = ((steps as usize).min(last), steps.fract());
        let (from, to) = (self.way[k], self.way[(k + 1).min(last)]);
        let turn = turned(to.heading_rad - from.heading_rad);
        Some(Placement {
            at: mix(from.at, to.at, part),
            heading_rad: from.heading_rad + part * turn,
        })
    }

    /// Moves its vertices to where they are after some seconds.
    pub(super) fn drive(&self, mesh: &mut Mesh, seconds: f64) {
        let (Some(from), Some(to)) = (self.way.first(), self.after(seconds)) else { return };
        let turn = to.heading_rad - from.heading_rad;
        let (sin, cos) = (libm::sin(turn), libm::cos(turn));
        for vertex in mesh.vertices.get_mut(self.vertices.clone()).into_iter().flatten() {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(vertex[i]) - from.at[i]);
            let now = [cos * x - sin * y, sin * x + cos * y, z];
            *vertex = std::array::from_fn(|i| (to.at[i] + now[i]) as f32);
        }
    }
}

/// The same angle, from −π to π.
fn turned(angle_rad: f64) -> f64 {
    libm::atan2(libm::sin(angle_rad), libm::cos(angle_rad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// 1 m straight ahead, then a quarter turn to the left.
    fn mover() -> Mover {
        let at = |x: f64, y: f64, heading_rad| Placement { at: [x, y, 0.5], heading_rad };
        let way = vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(2.0, 1.0, FRAC_PI_2)];
        Mover { vertices: 1..2, speed_m_s: 2.0, way }
    }

    #[test]
    fn a_vehicle_follows_its_path_and_stops_at_the_end() {
        let mover = mover();
        assert_eq!(mover.after(0.0), mover.way.first().copied());
        assert_eq!(mover.after(0.25).map(|f| f.at), Some([0.5, 0.0, 0.5]));
        let turning = mover.after(0.75).expect("a place");
        assert!((turning.heading_rad - 0.25 * PI).abs() < 1e-12);
        assert_eq!(mover.after(99.0), mover.way.last().copied());
    }

    #[test]
    fn a_heading_across_half_a_turn_takes_the_short_way() {
        let way = [3.1, -3.1].map(|heading_rad| Placement { at: [0.0; 3], heading_rad });
        let mover = Mover { vertices: 0..0, speed_m_s: 1.0, way: way.to_vec() };
        let half = mover.after(0.5).expect("a place").heading_rad;
        assert!((half - PI).abs() < 1e-12, "{half}");
    }
}
