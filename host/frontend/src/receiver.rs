//! Optics, detector, amplifier and converter.

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::litl_units as litl;
use crate::mode::Mode;
use crate::weather::{Air, Weather};

const ELEMENTARY_CHARGE_C: f64 = 1.602_176_634e-19;
const PLANCK_J_S: f64 = 6.626_070_15e-34;
pub(crate) const SPEED_OF_LIGHT_M_NS: f64 = 0.299_792_458;

/// The receiver's constants. Defaults are the reference receiver; parts from data sheets, the set
/// our own.
///
/// ```text
/// i(t) = M·R0·(P_s + P_b) + i_dark                 R0 = QE·q·λ/(h·c)
/// P_s  = P0·η·A_r · strength · e^(−2αR) · p(t)
/// strength = Σ w_k ρ_k cosθ_k / (π R_k²)           from the scanner
/// P_b  = E_λ·Δλ·(ρ_b/π)·Ω·A_r·η                     ambient; does not depend on range
/// σ_i² = 2·q·M²·F·B·(R0·(P_s + P_b) + I_db) + i_TIA²
/// F    = k·M + (1 − k)(2 − 1/M)                     McIntyre excess noise
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Receiver {
    /// Diameter of the aperture, mm.
    pub aperture_mm: f64,
    /// η, transmission of the optics.
    pub transmission: f64,
    /// QE of the avalanche photodiode.
    pub quantum_efficiency: f64,
    /// M, its gain.
    pub multiplication: f64,
    /// k, its ratio of ionisation.
    pub ionisation_ratio: f64,
    /// I_db, bulk dark current before multiplication, nA.
    pub bulk_dark_current_na: f64,
    /// i_dark, dark current that is not multiplied, nA.
    pub surface_dark_current_na: f64,
    /// B, noise bandwidth, MHz.
    pub bandwidth_mhz: f64,
    /// i_TIA, noise of the amplifier, nA rms.
    pub amplifier_noise_na: f64,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Δλ of the optical filter, nm.
    pub filter_nm: f64,
    /// E_λ, sunlight on the scene, W/m²/nm.
    pub irradiance_w_m2_nm: f64,
    /// ρ_b, reflectance of what the ambient light comes from.
    pub background_reflectance: f64,
    /// Beam divergence, which is also the field of view of a pixel, mrad.
    pub divergence_mrad: [f64; 2],
    /// Sub-rays along each axis of the divergence, odd.
    pub subrays: u8,
    /// Current that fills the converter at 0 dB, µA.
    pub full_scale_ua: f64,
    /// Where the amplifier clips, as a fraction of the converter's full scale.
    pub analog_limit: f64,
    /// b, bits of the converter.
    pub adc_bits: u32,
    /// α of clear air, 1/m; that of the weather comes on top.
    pub extinction_per_m: f64,
    /// What waveforms are made of: `physical`, or `litl-compat`, arbitrary units with Poisson
    /// noise.
    pub mode: Mode,
    /// Spread of the moment at which the pulse leaves, from shot to shot, ns rms.
    pub timing_jitter_ns: f64,
    /// Fraction of the channels that are dead: their converter reads 0. A channel is a row of
    /// beams, or a laser.
    pub dead_channels: f64,
    /// Fraction of the channels that are weak, …
    pub weak_channels: f64,
    /// … and how much of the light they lose, dB of optical power.
    pub weak_channel_db: f64,
    /// Decides which channels; the same in every scan.
    pub channel_seed: u64,
    /// Tail of an amplifier that was overloaded, as a fraction of what it could not follow; 0: it
    /// recovers at once.
    pub overload_tail: f64,
    /// Time constant with which that tail decays, ns.
    pub overload_tail_ns: f64,
    /// The weather before it: the configuration's `[weather]`.
    #[serde(skip)]
    pub weather: Weather,
    /// Channels of its scan pattern, from `[scanner]`, which beams have in turn: rows of a grid,
    /// lasers of a head; 0: not known, every beam has a channel of its own.
    #[serde(skip)]
    pub rows: u16,
    /// Channel of each beam, where they do not come in turn; empty: they do.
    #[serde(skip)]
    pub channels: Arc<[u16]>,
}

impl Default for Receiver {
    fn default() -> Self {
        Self {
            aperture_mm: 25.0,
            transmission: 0.7,
            quantum_efficiency: 0.75,
            multiplication: 100.0,
            ionisation_ratio: 0.02,
            bulk_dark_current_na: 0.0,
            surface_dark_current_na: 0.0,
            bandwidth_mhz: 220.0,
            amplifier_noise_na: 49.0,
            wavelength_nm: 905.0,
            filter_nm: 20.0,
            irradiance_w_m2_nm: 0.65,
            background_reflectance: 0.5,
            divergence_mrad: [3.0, 1.5],
            subrays: 5,
            full_scale_ua: 30.0,
            analog_limit: 1.0,
            adc_bits: 12,
            extinction_per_m: 0.0,
            mode: Mode::Physical,
            timing_jitter_ns: 0.0,
            dead_channels: 0.0,
            weak_channels: 0.0,
            weak_channel_db: 6.0,
            channel_seed: 1,
            overload_tail: 0.0,
            overload_tail_ns: 20.0,
            weather: Weather::default(),
            rows: 0,
            channels: Arc::default(),
        }
    }
}

/// A constant of the receiver that physics does not allow.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("receiver.{field} = {value} must be {expected}")]
pub struct OpticsError {
    /// The field.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub expected: &'static str,
}

/// A field's name, value, limits and what they are called.
type Bound = (&'static str, f64, std::ops::RangeInclusive<f64>, &'static str);

impl Receiver {
    /// Checks every constant.
    ///
    /// # Errors
    ///
    /// [`OpticsError`] names the first that is out of bounds.
    pub fn check(&self) -> Result<(), OpticsError> {
        let tiny = f64::MIN_POSITIVE;
        let bounds: [Bound; 26] = [
            ("aperture_mm", self.aperture_mm, tiny..=1e3, "above 0 and at most 1000"),
            ("transmission", self.transmission, tiny..=1.0, "above 0 and at most 1"),
            ("quantum_efficiency", self.quantum_efficiency, tiny..=1.0, "above 0 and at most 1"),
            ("multiplication", self.multiplication, 1.0..=1e7, "1 to 10^7"),
            ("ionisation_ratio", self.ionisation_ratio, 0.0..=1.0, "0 to 1"),
            ("bulk_dark_current_na", self.bulk_dark_current_na, 0.0..=1e6, "0 to 10^6"),
            ("surface_dark_current_na", self.surface_dark_current_na, 0.0..=1e6, "0 to 10^6"),
            ("bandwidth_mhz", self.bandwidth_mhz, tiny..=1e5, "above 0 and at most 10^5"),
            ("amplifier_noise_na", self.amplifier_noise_na, 0.0..=1e6, "0 to 10^6"),
            ("wavelength_nm", self.wavelength_nm, 200.0..=3000.0, "200 to 3000"),
            ("filter_nm", self.filter_nm, 0.0..=1000.0, "0 to 1000"),
            ("irradiance_w_m2_nm", self.irradiance_w_m2_nm, 0.0..=10.0, "0 to 10"),
            ("background_reflectance", self.background_reflectance, 0.0..=1.0, "0 to 1"),
            ("divergence_mrad[0]", self.divergence_mrad[0], 0.0..=100.0, "0 to 100"),
            ("divergence_mrad[1]", self.divergence_mrad[1], 0.0..=100.0, "0 to 100"),
            ("subrays", f64::from(self.subrays), 1.0..=15.0, "odd, 1 to 15"),
            ("full_scale_ua", self.full_scale_ua, tiny..=1e6, "above 0 and at most 10^6"),
            ("analog_limit", self.analog_limit, tiny..=10.0, "above 0 and at most 10"),
            ("adc_bits", f64::from(self.adc_bits), 8.0..=14.0, "8 to 14"),
            ("extinction_per_m", self.extinction_per_m, 0.0..=10.0, "0 to 10"),
            ("timing_jitter_ns", self.timing_jitter_ns, 0.0..=10.0, "0 to 10"),
            ("dead_channels", self.dead_channels, 0.0..=1.0, "0 to 1"),
            (
                "weak_channels",
                self.weak_channels,
                0.0..=1.0 - self.dead_channels,
                "0 to 1 less dead_channels",
            ),
            ("weak_channel_db", self.weak_channel_db, 0.0..=60.0, "0 to 60"),
            ("overload_tail", self.overload_tail, 0.0..=1.0, "0 to 1"),
            ("overload_tail_ns", self.overload_tail_ns, 0.1..=1e4, "0.1 to 10^4"),
        ];
        for (field, value, limits, expected) in bounds {
            if !limits.contains(&value) || (field == "subrays" && self.subrays.is_multiple_of(2)) {
                return Err(OpticsError { field, value, expected });
            }
        }
        Ok(())
    }

    /// The peak of an echo of 1 W from 1/(π m²), in clear air at 0 dB, over the converter's full
    /// scale.
    pub fn unit_echo(&self) -> f64 {
        match self.mode {
            Mode::Physical => self.peak_current_ua(1.0, 0.0, 1.0 / PI) / self.full_scale_ua,
            Mode::LitlCompat => litl::units(1.0) / PI / litl::SATURATION,
        }
    }

    /// The variance of a signal over the signal, both over full scale, at 0 dB.
    pub fn shot_noise(&self) -> f64 {
        match self.mode {
            Mode::Physical => self.shot_variance_ua() / self.full_scale_ua,
            Mode::LitlCompat => 1.0 / litl::SATURATION,
        }
    }

    /// The air before it.
    pub fn air(&self) -> Air {
        self.weather.air(self.wavelength_nm)
    }

    /// α: clear air and weather, 1/m.
    pub fn extinction_per_m(&self) -> f64 {
        self.extinction_per_m + self.air().extinction_per_m
    }

    /// e^(−2αR).
    pub fn through_air(&self, range_m: f64) -> f64 {
        (-2.0 * self.extinction_per_m() * range_m).exp()
    }

    /// R0, photocurrent per optical power before multiplication, A/W.
    pub fn responsivity_a_w(&self) -> f64 {
        self.quantum_efficiency * ELEMENTARY_CHARGE_C * self.wavelength_nm * 1e-9
            / (PLANCK_J_S * (1e9 * SPEED_OF_LIGHT_M_NS))
    }

    /// A_r, m².
    pub fn aperture_m2(&self) -> f64 {
        FRAC_PI_4 * (self.aperture_mm * 1e-3).powi(2)
    }

    /// Codes that a current of 1 µA makes at 0 dB.
    pub fn codes_per_ua(&self) -> f64 {
        f64::from(1u32 << self.adc_bits) / self.full_scale_ua
    }

    /// P_b, W.
    pub fn ambient_w(&self) -> f64 {
        let solid_angle_sr = self.divergence_mrad[0] * self.divergence_mrad[1] * 1e-6;
        let radiance = self.irradiance_w_m2_nm * self.filter_nm * self.background_reflectance / PI;
        radiance * solid_angle_sr * self.aperture_m2() * self.transmission
    }

    /// Peak signal current of a return, µA: M·R0·P_s at p = 1.
    pub fn peak_current_ua(&self, power_w: f64, range_m: f64, strength_per_m2: f64) -> f64 {
        let received_w = power_w
            * self.transmission
            * self.aperture_m2()
            * strength_per_m2
            * self.through_air(range_m);
        self.multiplication * self.responsivity_a_w() * received_w * 1e6
    }

    /// Current without a signal, µA.
    pub fn quiescent_current_ua(&self) -> f64 {
        self.multiplication * self.responsivity_a_w() * self.ambient_w() * 1e6
            + self.surface_dark_current_na * 1e-3
    }

    /// Variance of the current without a signal, µA².
    pub fn quiescent_variance_ua2(&self) -> f64 {
        let primary_ua =
            self.responsivity_a_w() * self.ambient_w() * 1e6 + self.bulk_dark_current_na * 1e-3;
        self.multiplication * self.shot_variance_ua() * primary_ua
            + (self.amplifier_noise_na * 1e-3).powi(2)
    }

    /// Shot-noise variance a microampere of multiplied signal current adds, µA²: 2·q·M·F·B.
    pub fn shot_variance_ua(&self) -> f64 {
        let (m, k) = (self.multiplication, self.ionisation_ratio);
        let excess = k * m + (1.0 - k) * (2.0 - 1.0 / m);
        2.0 * ELEMENTARY_CHARGE_C * m * excess * self.bandwidth_mhz * 1e6 * 1e6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(got: f64, expected: f64) -> bool {
        (got / expected - 1.0).abs() < 0.01
    }

    #[test]
    fn the_link_budget_meets_its_check_values() {
        let receiver = Receiver::default();
        assert!(near(receiver.ambient_w(), 3.2e-9), "{}", receiver.ambient_w());
        for (range_m, current_ua) in [(10.0, 448.0), (50.0, 17.9), (100.0, 4.48), (200.0, 1.12)] {
            let strength = 0.1 / PI / range_m / range_m;
            let got = receiver.peak_current_ua(75.0, range_m, strength);
            assert!(near(got, current_ua), "{range_m} m: {got} µA");
        }
        // The table's 17.8, 4.4 and 1.08 µA include air of about 9e-5 /m; its A/σ is 12.6.
        let sigma_ua = receiver.quiescent_variance_ua2().sqrt();
        assert!(near(1.08 / sigma_ua, 12.6), "{sigma_ua}");
    }

    /// Worked out apart from this file, from the equations and defaults of docs/physics.md with the
    /// constants of CODATA.
    #[test]
    fn the_current_without_a_signal_is_that_of_the_sun_on_the_whole_footprint() {
        let receiver = Receiver::default();
        let same = |got: f64, expected: f64| (got / expected - 1.0).abs() < 1e-6;
        assert!(same(receiver.responsivity_a_w(), 0.547_448_795));
        assert!(same(receiver.ambient_w(), 3.199_218_75e-9));
        assert!(same(receiver.quiescent_current_ua(), 0.175_140_845));
        assert!(same(receiver.quiescent_variance_ua2(), 7.278_189_109e-3));
        // 3 nA that are not multiplied, 2 nA that are; the sun is left out.
        let dark = Receiver {
            surface_dark_current_na: 3.0,
            bulk_dark_current_na: 2.0,
            irradiance_w_m2_nm: 0.0,
            ..receiver
        };
        assert!(same(dark.quiescent_current_ua(), 0.003));
        assert!(same(dark.quiescent_variance_ua2(), 7.970_447_963e-3));
    }

    #[test]
    fn a_constant_out_of_bounds_is_named() {
        let bad = Receiver { transmission: f64::NAN, ..Receiver::default() };
        assert_eq!(
            bad.check().unwrap_err().to_string(),
            "receiver.transmission = NaN must be above 0 and at most 1"
        );
        let even = Receiver { subrays: 4, ..Receiver::default() };
        assert_eq!(even.check().unwrap_err().field, "subrays");
        Receiver::default().check().unwrap();
    }
}
