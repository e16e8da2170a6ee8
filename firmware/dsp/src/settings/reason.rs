//! Reasons why a value of a setting is refused.

/// Reason why a value is refused. Bounds are in the field's wire unit unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// The value is below the lowest.
    BelowMinimum {
        /// Lowest value.
        minimum: i32,
    },
    /// The value is above the highest.
    AboveMaximum {
        /// Highest value.
        maximum: i32,
    },
    /// The value is none of those that the field takes.
    NotAChoice,
    /// The pulse energy, power × width, is above the limit. Both in picojoules.
    EnergyAboveLimit {
        /// Energy that was asked for.
        energy_pj: u32,
        /// Limit of the emitter.
        limit_pj: u32,
    },
    /// The saturation level is not above the noise floor. Both in ppm of full scale.
    SaturationNotAboveFloor {
        /// Noise floor.
        floor_ppm: i32,
    },
    /// The pulse width spans fewer than 2.5 samples.
    Undersampled {
        /// Sample period that the resolution gives.
        sample_period_fs: u32,
    },
    /// The gain is full only beyond the middle of the window. Noise is measured where it is full,
    /// which must be at least half of the window.
    BeyondMiddle {
        /// Middle of the window, mm.
        middle_mm: u32,
    },
    /// The scan pattern is not steered: it has no aim.
    NotSteered,
    /// The aim reaches beyond the mount.
    BeyondMount {
        /// Largest angle that the mount allows, 0.01°.
        most_cdeg: i32,
    },
    /// Two beams would point to the same cell of the mount's raster.
    FinerThanRaster {
        /// Step of the raster, 0.01°.
        step_cdeg: i32,
    },
    /// The shots of a scan take longer than the scan.
    FrameTooShort {
        /// Time that they take, µs.
        needed_us: u32,
    },
}
