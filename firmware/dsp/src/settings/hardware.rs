//! Hardware of the sensor: converter, range window, emitter, receiver.

/// Speed of light, m/s.
pub const SPEED_OF_LIGHT_M_S: u64 = 299_792_458;

/// Constants of the sensor's hardware: no setting changes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hardware {
    /// Resolution of the ADC, 8 to 14 bits; any other counts as the nearest.
    pub adc_bits: u32,
    /// Range of the first sample, mm.
    pub range_min_mm: u32,
    /// Range one window after it, mm.
    pub range_max_mm: u32,
    /// Highest pulse energy, pJ.
    pub energy_limit_pj: u32,
    /// Amplitude of the echo of a white Lambertian surface square to the beam at 1 m, at 1 W and 0
    /// dB: 1/1000 of full scale. Reflectivity is measured against it.
    pub unit_echo_milli: u32,
    /// Shot noise: variance that a signal of full scale adds to the noise at 0 dB, ppm of full
    /// scale squared.
    pub shot_noise_ppm: u32,
}

impl Hardware {
    /// Reference sensor: 12 bits, 1 to 120 m, 400 nJ, and the receiver of the link budget.
    pub const REFERENCE: Self = Self {
        adc_bits: 12,
        range_min_mm: 1_000,
        range_max_mm: 120_000,
        energy_limit_pj: 400_000,
        unit_echo_milli: 199_591,
        shot_noise_ppm: 928,
    };

    /// Largest code, full scale.
    pub const fn full_scale_code(&self) -> u16 {
        0x7fff >> self.code_shift()
    }

    /// Left shift that brings a code to Q1.15: 1 to 7.
    pub const fn code_shift(&self) -> u32 {
        match 15u32.saturating_sub(self.adc_bits) {
            0 => 1,
            shift @ 1..=7 => shift,
            8.. => 7,
        }
    }
}

/// Sample period that spreads `bins` over the window: 2 (R_max − R_min) / (c·N), to the nearest
/// femtosecond.
///
/// The emitter's trigger, the ADC's clock divider and the range conversion all use this one
/// integer. It saturates; a window that ends before it begins is empty.
pub const fn sample_period_fs(bins: u32, hardware: &Hardware) -> u32 {
    let window_mm = hardware.range_max_mm.saturating_sub(hardware.range_min_mm) as u64;
    let numerator = window_mm.saturating_mul(2_000_000_000_000);
    let denominator = (bins as u64).saturating_mul(SPEED_OF_LIGHT_M_S);
    match numerator.saturating_add(denominator / 2).checked_div(denominator) {
        Some(period) if period <= u32::MAX as u64 => period as u32,
        _ => u32::MAX,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_give_the_sample_rate_of_the_physics() {
        // f_s = c·N / (2 (R_max − R_min)): 794 bins are 1 GS/s, 2400 are 3.02 GS/s.
        let rate = |bins| 1e6 / f64::from(sample_period_fs(bins, &Hardware::REFERENCE));
        assert!((rate(794) - 1.0001).abs() < 1e-3);
        assert!((rate(2400) - 3.023).abs() < 1e-3);
    }
}
