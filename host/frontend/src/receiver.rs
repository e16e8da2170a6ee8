//! Optics, detector, amplifier and converter.

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

use echoloop_parameters::{Bounds, Refused, section};
use serde::{Deserialize, Serialize};

use crate::litl_units as litl;
use crate::mode::Mode;
use crate::weather::{Air, Weather};

const ELEMENTARY_CHARGE_C: f64 = 1.602_176_634e-19;
const PLANCK_J_S: f64 = 6.626_070_15e-34;
pub(crate) const SPEED_OF_LIGHT_M_NS: f64 = 0.299_792_458;

section! {
    /// Constants of the receiver. The defaults are the reference receiver: its parts have data
    /// sheets, their combination is ours.
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
    #[serde(deny_unknown_fields, default, expecting = "a table, [receiver]")]
    pub struct Receiver in "receiver" {
        aperture_mm: f64, "mm", Bounds::above(0.0, 1e3),
            "Diameter of the aperture, mm.";
        transmission: f64, "", Bounds::above(0.0, 1.0),
            "η, transmission of the optics.";
        quantum_efficiency: f64, "", Bounds::above(0.0, 1.0),
            "QE of the avalanche photodiode.";
        multiplication: f64, "", Bounds::between(1.0, 1e7),
            "M, gain of the photodiode.";
        ionisation_ratio: f64, "", Bounds::between(0.0, 1.0),
            "k, ratio of ionisation of the photodiode.";
        bulk_dark_current_na: f64, "nA", Bounds::between(0.0, 1e6),
            "I_db, bulk dark current before multiplication, nA.";
        surface_dark_current_na: f64, "nA", Bounds::between(0.0, 1e6),
            "i_dark, dark current that is not multiplied, nA.";
        bandwidth_mhz: f64, "MHz", Bounds::above(0.0, 1e5),
            "B, noise bandwidth, MHz.";
        amplifier_noise_na: f64, "nA", Bounds::between(0.0, 1e6),
            "i_TIA, noise of the amplifier, nA rms.";
        wavelength_nm: f64, "nm", Bounds::between(200.0, 3000.0),
            "Wavelength, nm.";
        filter_nm: f64, "nm", Bounds::between(0.0, 1000.0),
            "Δλ of the optical filter, nm.";
        irradiance_w_m2_nm: f64, "W/m²/nm", Bounds::between(0.0, 10.0),
            "E_λ, sunlight on the scene, W/m²/nm.";
        background_reflectance: f64, "", Bounds::between(0.0, 1.0),
            "ρ_b, reflectance of the surfaces that return the ambient light.";
        divergence_mrad: [f64; 2], "mrad", Bounds::between(0.0, 100.0),
            "Beam divergence, which is also the field of view of a pixel, mrad.";
        subrays: u8, "", Bounds::odd(1.0, 15.0),
            "Sub-rays along each axis of the divergence.";
        full_scale_ua: f64, "µA", Bounds::above(0.0, 1e6),
            "Current that fills the converter at 0 dB, µA.";
        analog_limit: f64, "of full scale", Bounds::above(0.0, 10.0),
            "Level at which the amplifier clips, as a fraction of the converter's full scale.";
        adc_bits: u32, "bits", Bounds::between(8.0, 14.0),
            "b, bits of the converter.";
        extinction_per_m: f64, "1/m", Bounds::between(0.0, 10.0),
            "α of clear air, 1/m; that of the weather comes on top.";
        mode: Mode, "", Mode::BOUNDS,
            "Model that makes the waveforms: `physical`, or `litl-compat`, arbitrary units with \
             Poisson noise.";
        timing_jitter_ns: f64, "ns", Bounds::between(0.0, 10.0),
            "Spread of the moment at which the pulse leaves, from shot to shot, ns rms.";
        dead_channels: f64, "", Bounds::between(0.0, 1.0),
            "Fraction of the channels that are dead: their converter reads 0. A channel is a row \
             of beams, or a laser.";
        weak_channels: f64, "", Bounds::between(0.0, 1.0),
            "Fraction of the channels that lose `weak_channel_db` of the light; with the dead ones \
             no more than all.";
        weak_channel_db: f64, "dB", Bounds::between(0.0, 60.0),
            "Loss of light in weak channels, dB of optical power.";
        channel_seed: u64, "", Bounds::SEED,
            "Seed that decides which channels are dead or weak; the same in every scan.";
        overload_tail: f64, "", Bounds::between(0.0, 1.0),
            "Tail of an overloaded amplifier, as a fraction of the excess over its limit; 0: it \
             recovers at once.";
        overload_tail_ns: f64, "ns", Bounds::between(0.1, 1e4),
            "Time constant with which that tail decays, ns.";
    }
    beside {
        /// Weather in front of it: the configuration's `[weather]`.
        #[serde(skip)]
        pub weather: Weather,
        /// Number of channels that beams use in turn: rows of a grid, lasers of a head. From
        /// `[scanner]`; 0: unknown, every beam has its own channel.
        #[serde(skip)]
        pub rows: u16,
        /// Channel of each beam, if beams do not use them in turn; else empty.
        #[serde(skip)]
        pub channels: Arc<[u16]>,
    }
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

impl Receiver {
    /// Checks every constant.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the first that is out of bounds.
    pub fn check(&self) -> Result<(), Refused> {
        self.check_keys()?;
        let weak = Self::KEYS.iter().find(|key| key.key == "receiver.weak_channels");
        match weak.filter(|_| self.weak_channels > 1.0 - self.dead_channels) {
            Some(key) => Err(key.refused(self.weak_channels, "0 to 1 less dead_channels")),
            None => Ok(()),
        }
    }

    /// Peak of an echo of 1 W and strength 1/(π m²), in clear air at 0 dB, over full scale.
    pub fn unit_echo(&self) -> f64 {
        match self.mode {
            Mode::Physical => self.peak_current_ua(1.0, 0.0, 1.0 / PI) / self.full_scale_ua,
            Mode::LitlCompat => litl::units(1.0) / PI / litl::SATURATION,
        }
    }

    /// Ratio of a signal's variance to the signal, both relative to full scale, at 0 dB.
    pub fn shot_noise(&self) -> f64 {
        match self.mode {
            Mode::Physical => self.shot_variance_ua() / self.full_scale_ua,
            Mode::LitlCompat => 1.0 / litl::SATURATION,
        }
    }

    /// Optical constants of the weather at the receiver's wavelength.
    pub fn air(&self) -> Air {
        self.weather.air(self.wavelength_nm)
    }

    /// α of clear air and weather together, 1/m.
    pub fn extinction_per_m(&self) -> f64 {
        self.extinction_per_m + self.air().extinction_per_m
    }

    /// Transmission of the air to a range and back, e^(−2αR).
    pub fn through_air(&self, range_m: f64) -> f64 {
        (-2.0 * self.extinction_per_m() * range_m).exp()
    }

    /// R0, photocurrent per optical power before multiplication, A/W.
    pub fn responsivity_a_w(&self) -> f64 {
        self.quantum_efficiency * ELEMENTARY_CHARGE_C * self.wavelength_nm * 1e-9
            / (PLANCK_J_S * (1e9 * SPEED_OF_LIGHT_M_NS))
    }

    /// A_r, area of the aperture, m².
    pub fn aperture_m2(&self) -> f64 {
        FRAC_PI_4 * (self.aperture_mm * 1e-3).powi(2)
    }

    /// Codes per µA at 0 dB.
    pub fn codes_per_ua(&self) -> f64 {
        f64::from(1u32 << self.adc_bits) / self.full_scale_ua
    }

    /// P_b, ambient power, W.
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

    /// Shot-noise variance per µA of multiplied signal current, µA: 2·q·M·F·B.
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
    fn the_link_budget_agrees_with_its_table() {
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

    /// Expected values computed independently, from the equations and defaults of
    /// benches/record/physics.md and CODATA's constants.
    #[test]
    fn the_current_without_a_signal_is_that_of_the_sun_on_the_whole_footprint() {
        let receiver = Receiver::default();
        let same = |got: f64, expected: f64| (got / expected - 1.0).abs() < 1e-6;
        assert!(same(receiver.responsivity_a_w(), 0.547_448_795));
        assert!(same(receiver.ambient_w(), 3.199_218_75e-9));
        assert!(same(receiver.quiescent_current_ua(), 0.175_140_845));
        assert!(same(receiver.quiescent_variance_ua2(), 7.278_189_109e-3));
        // 3 nA that are not multiplied, 2 nA that are, no sun.
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
            "receiver.transmission = NaN must be above 0, at most 1"
        );
        let even = Receiver { subrays: 4, ..Receiver::default() };
        assert_eq!(even.check().unwrap_err().key, "receiver.subrays");
        Receiver::default().check().unwrap();
    }
}
