//! What is somewhere else in the second scan of a pair.

use std::ops::Range;

use super::mesh::Mesh;

/// From place to place of a way, metres.
pub(crate) const STEP_M: f64 = 1.0;

/// A vehicle on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// Its corners in the scene's mesh.
    pub vertices: Range<usize>,
    /// How fast it drives, m/s.
    pub speed_m_s: f64,
    /// Where it goes, a place every metre: the first is where the mesh has it. At the last it
    /// waits.
    pub way: Vec<Placement>,
}

/// Where a vehicle stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Below its middle, metres.
    pub at: [f64; 3],
    /// The way that it looks, radians counter-clockwise from x.
    pub heading_rad: f64,
}

impl Mover {
    /// Where it stands so many seconds later.
    #[must_use]
    pub fn after(&self, seconds: f64) -> Option<Placement> {
        let steps = (self.speed_m_s * seconds / STEP_M).max(0.0);
        let last = self.way.len().checked_sub(1)?;
        let (k, part) = ((steps as usize).min(last), steps.fract());
        let (from, to) = (self.way[k], self.way[(k + 1).min(last)]);
        let turn = turned(to.heading_rad - from.heading_rad);
        Some(Placement {
            at: std::array::from_fn(|i| from.at[i] + part * (to.at[i] - from.at[i])),
            heading_rad: from.heading_rad + part * turn,
        })
    }

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

/// The same angle between −π and π.
fn turned(angle_rad: f64) -> f64 {
    libm::atan2(libm::sin(angle_rad), libm::cos(angle_rad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Ahead for a metre, then round a quarter of a turn, then ahead.
    fn mover() -> Mover {
        let at = |x: f64, y: f64, heading_rad| Placement { at: [x, y, 0.5], heading_rad };
        let way = vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(2.0, 1.0, FRAC_PI_2)];
        Mover { vertices: 1..2, speed_m_s: 2.0, way }
    }

    #[test]
    fn a_vehicle_drives_along_its_way_and_waits_at_its_end() {
        let mover = mover();
        assert_eq!(mover.after(0.0), mover.way.first().copied());
        assert_eq!(mover.after(0.25).map(|f| f.at), Some([0.5, 0.0, 0.5]));
        let turning = mover.after(0.75).expect("a place");
        assert!((turning.heading_rad - 0.25 * PI).abs() < 1e-12);
        assert_eq!(mover.after(99.0), mover.way.last().copied());
    }

    #[test]
    fn a_way_past_half_a_turn_takes_the_short_side() {
        let way = [3.1, -3.1].map(|heading_rad| Placement { at: [0.0; 3], heading_rad });
        let mover = Mover { vertices: 0..0, speed_m_s: 1.0, way: way.to_vec() };
        let half = mover.after(0.5).expect("a place").heading_rad;
        assert!((half - PI).abs() < 1e-12, "{half}");
    }
}
