//! Spiral from the middle outwards.

use core::f64::consts::PI;
use core::{f32, fmt};

/// Spiral of Archimedes around the view axis, drawn by one laser from the middle outwards.
///
/// ```text
/// k = (beam + ½)/beams        the beam leaves at edge · k from x
/// φ = 2π · turns · k          counter-clockwise seen from behind, from y towards z
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Spiral {
    /// Number of beams of a scan.
    pub beams: u32,
    /// Number of turns from the middle to the edge.
    pub turns: u16,
    /// Angle between the view axis and the edge, 0.01°.
    pub edge_cdeg: u16,
}

impl Spiral {
    /// 10,000 beams in 50 turns, 40° across.
    pub const USUAL: Self = Self { beams: 10_000, turns: 50, edge_cdeg: 2_000 };

    /// Unit vector of a beam. In f32, within 10⁻⁶ of the exact one.
    pub fn direction(&self, beam: u32) -> [f32; 3] {
        let whole = u64::from(self.beams.max(1)).saturating_mul(2);
        let halves = u64::from(beam).saturating_mul(2).saturating_add(1);
        let turned = halves.saturating_mul(self.turns.into()).checked_rem(whole).unwrap_or(0);
        let [k, turn] = [halves, turned].map(|part| part as f32 / whole as f32);
        let (sin_off, cos_off) =
            libm::sincosf(f32::from(self.edge_cdeg) * (PI as f32 / 18_000.0) * k);
        let (sin, cos) = libm::sincosf(f32::consts::TAU * turn);
        [cos_off, sin_off * cos, sin_off * sin]
    }

    /// Unit vector of a beam, by its definition.
    pub fn exact_direction(&self, beam: u32) -> [f64; 3] {
        let k = (f64::from(beam) + 0.5) / f64::from(self.beams);
        let (sin_off, cos_off) = libm::sincos(f64::from(self.edge_cdeg) * (PI / 18_000.0) * k);
        let (sin, cos) = libm::sincos(2.0 * PI * f64::from(self.turns) * k);
        [cos_off, sin_off * cos, sin_off * sin]
    }
}

impl fmt::Display for Spiral {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { beams, turns, edge_cdeg } = self;
        write!(f, "{beams} of a spiral ({turns} turns to {edge_cdeg} × 0.01°)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spiral_moves_outwards_from_the_middle_to_its_edge() {
        let spiral = Spiral::USUAL;
        let off = |beam| libm::acosf(spiral.direction(beam)[0]).to_degrees();
        assert!(off(0) < 0.05 && (off(9_999) - 20.0).abs() < 0.01);
        assert!((1..100).all(|i| off(100 * i) > off(100 * (i - 1))));
        // A quarter of a turn, 50 beams, from y to z.
        let [_, y, z] = spiral.direction(5_049);
        assert!(y.abs() < z * 0.02, "{y} {z}");
    }
}
