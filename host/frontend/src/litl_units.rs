//! The arbitrary units of the compatibility mode, [`super::litl`].

use std::f64::consts::PI;

/// Power of the preset; what the laser of [`POWER_W`] stands for.
pub const POWER: f64 = 200.0;
/// The laser's default power, W: other settings scale [`POWER`].
pub const POWER_W: f64 = 75.0;
/// Units at which a waveform saturates: full scale of the converter.
pub const SATURATION: f64 = 1_000.0;
/// Units of light that is always there; also that simulator's threshold, so `lidar.noise_floor`
/// 0.001 is its preset.
pub const NOISE_FLOOR: f64 = 1.0;
/// Units of signal per unit of power and of ρ cosθ / R², m². Our choice, since no source gives it:
/// ρ = 0.1 peaks at the noise floor at 120 m, the end of the preset's window, 2400 bins from 1 m
/// on. ρ = 0.1 then saturates inside 3.8 m.
pub const SCALE_M2: f64 = NOISE_FLOOR * 120.0 * 120.0 / (0.1 * POWER);

/// Units of a return of strength 1/m² at this power, without air.
pub(crate) fn units(power_w: f64) -> f64 {
    power_w / POWER_W * POWER * SCALE_M2 * PI
}
