//! The model that makes waveforms.

use echoloop_parameters::choice;

choice! {
    /// Model that makes the waveforms.
    pub enum Mode by default Physical {
        /// Optical power, currents, shot noise and amplifier noise.
        Physical = "physical",
        /// Arbitrary units and Poisson noise.
        LitlCompat = "litl-compat",
    }
}
