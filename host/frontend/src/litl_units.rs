//! Arbitrary units of the compatibility mode, [`super::litl`].

use std::f64::consts::PI;

/// Power of the preset, units; a laser of [`POWER_W`] has it.
pub const POWER: f64 = 200.0;
/// Default power of the laser, W; other powers scale [`POWER`].
pub const POWER_W: f64 = 75.0;
/// Units at which a waveform saturates: full scale of the converter.
pub const SATURATION: f64 = 1_000.0;
/// Units of ambient light. The preset's threshold is the same: `lidar.noise_floor` 0.001.
pub const NOISE_FLOOR: f64 = 1.0;
/// Units of signal per unit of power and of ρ cosθ / R², m². No source gives it. Our choice: a wall
/// of ρ = 0.1 peaks at the noise floor at 120 m, the end of the preset's window (2400 bins from 1 m
/// on). The same wall then saturates nearer than 3.8 m.
pub const SCALE_M2: f64 = NOISE_FLOOR * 120.0 * 120.0 / (0.1 * POWER);

/// Units of a return of strength 1/m² at this power, in clear air.
pub(crate) fn units(power_w: f64) -> f64 {
    power_w / POWER_W * POWER * SCALE_M2 * PI
}
