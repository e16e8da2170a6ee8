//! What can be wrong with a value of a setting.

/// What is wrong with a value. Bounds are in the field's wire unit unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// Below the least value.
    BelowMinimum {
        /// The least value.
        minimum: i32,
    },
    /// Above the greatest value.
    AboveMaximum {
        /// The greatest value.
        maximum: i32,
    },
    /// None of the values this field takes.
    NotAChoice,
    /// Pulse energy, power × width, in picojoules.
    EnergyAboveLimit {
        /// Energy asked for.
        energy_pj: u32,
        /// The emitter's limit.
        limit_pj: u32,
    },
    /// The saturation level must lie above the noise floor. Both in ppm of full scale.
    SaturationNotAboveFloor {
        /// The noise floor.
        floor_ppm: i32,
    },
    /// Fewer than 2.5 samples per pulse width.
    Undersampled {
        /// The sample period the resolution gives.
        sample_period_fs: u32,
    },
    /// Noise is measured where the gain is full, which must be half of the window at least.
    BeyondMiddle {
        /// The middle of the window, mm.
        middle_mm: u32,
    },
}
