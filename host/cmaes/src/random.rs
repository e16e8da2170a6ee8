//! Chance by counter: what candidate i of generation g draws is a function of (seed, g, i).

use echoloop_random::Generator;

/// "CMA-ES" as a number: keeps these keys apart from those of other uses.
const PURPOSE: u64 = 0x0043_4d41_2d45_5300;

/// One candidate's draws: its normals first, then a number of 0 to 1 for each choice.
pub(super) struct Draws(Generator);

impl Draws {
    pub(super) fn new(seed: u64, generation: u64, candidate: u64) -> Self {
        Self(Generator::from_key([seed, generation, candidate, PURPOSE]))
    }

    /// `n` independent standard normals.
    pub(super) fn normals(&mut self, n: usize) -> Vec<f64> {
        self.0.normals(n)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.0.unit()
    }
}
