//! Light that a scene returns to a scanner's beams, before any electronics.

use std::sync::Arc;

/// Light returned by one part of a beam's footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// Distance, metres.
    pub range_m: f32,
    /// `Σ_k w_k ρ_k cosθ_k / (π R_k²)`, 1/m²: received power over `P0 η A_r`, in clear air and at
    /// full overlap.
    pub strength_per_m2: f32,
}

/// Light of a bright surface in another beam, which the sensor's optics scatter into this one. No
/// surface in this beam returns it: weather behind its range is seen as without it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glare {
    /// Beam that sees it.
    pub beam: u32,
    /// Range and strength of the light.
    pub light: Return,
}

/// Light of another LiDAR's pulse that a beam sees while the pulse lasts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OtherLight {
    /// Irradiance at the aperture, from within the beam's field of view, in clear air, W/m².
    pub irradiance_w_m2: f32,
    /// Way of the light through the air, m.
    pub path_m: f32,
}

/// Returns of the surfaces in every beam, by increasing range within a beam, and other light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneResponse {
    /// Beam `i` owns `returns[beams[i]..beams[i + 1]]`; one entry more than there are beams.
    pub beams: Vec<u32>,
    /// All returns, beam after beam.
    pub returns: Vec<Return>,
    /// Cell that each beam is steered to, column · 2¹⁶ + row, rising; none where no beam is
    /// steered.
    pub cells: Vec<u32>,
    /// Glare, by beam and by increasing range within a beam. Steered beams have none.
    pub glare: Vec<Glare>,
    /// Light of another LiDAR in each beam; none where there is no other.
    pub other: Vec<OtherLight>,
    /// First of the beams that are fired at the same moment as each; none where each is fired by
    /// itself, and where neither bright signs nor another LiDAR are simulated.
    pub fired_with: Arc<[u32]>,
}

impl SceneResponse {
    /// Beams without returns.
    #[must_use]
    pub fn empty(beams: u32) -> Self {
        Self { beams: vec![0; beams as usize + 1], ..Self::default() }
    }

    /// Number of beams.
    #[must_use]
    pub fn len(&self) -> usize {
        self.beams.len().saturating_sub(1)
    }

    /// True when there are no beams.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns of one beam.
    ///
    /// # Panics
    ///
    /// When there is no such beam.
    #[must_use]
    pub fn of(&self, beam: usize) -> &[Return] {
        &self.returns[self.beams[beam] as usize..self.beams[beam + 1] as usize]
    }

    /// Returns of a beam that was steered to `cell`; none from a cell that no beam has. A beam that
    /// is not steered is known by its number, and has none beyond the last.
    #[must_use]
    pub fn at(&self, beam: usize, cell: u32) -> &[Return] {
        self.index(beam, cell).map_or(&[], |beam| self.of(beam))
    }

    /// Glare in a beam.
    #[must_use]
    pub fn glare_in(&self, beam: u32) -> &[Glare] {
        let from = self.glare.partition_point(|of| of.beam < beam);
        let count = self.glare[from..].partition_point(|of| of.beam == beam);
        &self.glare[from..from + count]
    }

    /// Light of another LiDAR in such a beam.
    #[must_use]
    pub fn other_at(&self, beam: usize, cell: u32) -> Option<OtherLight> {
        let light = self.other.get(self.index(beam, cell)?)?;
        Some(*light).filter(|light| light.irradiance_w_m2 > 0.0)
    }

    /// First of the beams that are fired at the same moment as a beam.
    #[must_use]
    pub fn first_fired_with(&self, beam: u32) -> u32 {
        self.fired_with.get(beam as usize).copied().unwrap_or(beam)
    }

    fn index(&self, beam: usize, cell: u32) -> Option<usize> {
        match self.cells.is_empty() {
            true => Some(beam).filter(|beam| *beam < self.len()),
            false => self.cells.binary_search(&cell).ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_beam_has_its_own_glare() {
        let light = |range_m| Return { range_m, strength_per_m2: 1.0 };
        let glare = [(2, 10.0), (2, 20.0), (5, 10.0)];
        let glare = glare.map(|(beam, range_m)| Glare { beam, light: light(range_m) }).to_vec();
        let scene = SceneResponse { glare, ..SceneResponse::default() };
        let seen = |beam| scene.glare_in(beam).iter().map(|of| of.light.range_m).collect();
        let seen: Vec<Vec<f32>> = [0, 2, 3, 5, 6].map(seen).to_vec();
        assert_eq!(seen, [vec![], vec![10.0, 20.0], vec![], vec![10.0], vec![]]);
    }

    #[test]
    fn a_steered_beam_sees_the_returns_of_its_cell_and_of_no_other() {
        let back = |range_m| Return { range_m, strength_per_m2: 1.0 };
        let fixed = SceneResponse {
            beams: vec![0, 1, 1, 3],
            returns: vec![back(1.0), back(2.0), back(3.0)],
            ..SceneResponse::default()
        };
        assert_eq!(fixed.at(2, 7), &[back(2.0), back(3.0)], "a beam that is not steered");
        assert!(fixed.at(3, 0).is_empty(), "a beam beyond the last");
        let steered = SceneResponse { cells: vec![7, 9, 1 << 16], ..fixed };
        assert_eq!(steered.at(2, 7), &[back(1.0)]);
        assert_eq!(steered.at(0, 1 << 16), &[back(2.0), back(3.0)]);
        assert!(steered.at(0, 9).is_empty() && steered.at(0, 8).is_empty());
    }
}
