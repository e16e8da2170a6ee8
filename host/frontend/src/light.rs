//! Light that a scene returns to a scanner's beams, before any electronics.

/// Light returned by one part of a beam's footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// Distance, metres.
    pub range_m: f32,
    /// `Σ_k w_k ρ_k cosθ_k / (π R_k²)`, 1/m²: received power over `P0 η A_r`, in clear air and at
    /// full overlap.
    pub strength_per_m2: f32,
}

/// Returns of every beam, by increasing range within a beam.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneResponse {
    /// Beam `i` owns `returns[beams[i]..beams[i + 1]]`; one entry more than there are beams.
    pub beams: Vec<u32>,
    /// All returns, beam after beam.
    pub returns: Vec<Return>,
}

impl SceneResponse {
    /// Beams without returns.
    #[must_use]
    pub fn empty(beams: u32) -> Self {
        Self { beams: vec![0; beams as usize + 1], returns: Vec::new() }
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
}
