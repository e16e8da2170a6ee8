//! Echoes in wire units.

use super::config::BitTrue;
use super::numbers::{floor_of, nearest, nearest_ratio, product, two_to};
use super::refine::LOW_CONFIDENCE;
use super::values::{Echo, Refined, Threshold};

fn in_u16(value: f64) -> f64 {
    value.clamp(0.0, 65_535.0)
}

impl BitTrue {
    /// A refined peak in wire units; `None` at a negative range.
    pub fn echo(&self, refined: &Refined, threshold: &Threshold, index: usize) -> Option<Echo> {
        // time · step may take 61 bits, hence whole samples and the fraction apart.
        let samples = (refined.time / two_to(16)).floor();
        let fraction = refined.time - samples * two_to(16);
        let along = samples * self.range_step + (fraction * self.range_step / two_to(16)).floor();
        let range = self.range_origin + nearest(along / two_to(16));
        if !(0.0..two_to(32)).contains(&range) {
            return None;
        }
        let height = refined.height.max(0.0);
        let low = if height < 1.25 * threshold.level { LOW_CONFIDENCE } else { 0 };
        Some(Echo {
            range,
            amplitude: in_u16(self.amplitude(height)),
            width: in_u16(nearest_ratio(refined.width * self.period_fs, 1e6 * two_to(12))),
            snr: in_u16((height * two_to(12) / threshold.sigma.max(1.0)).floor()),
            deviation: in_u16(floor_of(
                refined.sigma,
                (self.range_step / two_to(8)).floor(),
                two_to(24),
            )),
            reflectivity: self.reflectivity(
                self.at_full_gain(refined.amplitude.clamp(0.0, two_to(25)), index),
                (range / two_to(8)).floor(),
            ),
            flags: refined.flags | low,
        })
    }

    /// Height at full gain of a height seen at sample `n`.
    pub(super) fn at_full_gain(&self, height: f64, n: usize) -> f64 {
        self.ramp.map_or(height, |ramp| ramp.at_full_gain(height, n))
    }

    /// Reflectivity A R² / (U P G ξ), U6.10.
    fn reflectivity(&self, amplitude: f64, range_mm: f64) -> f64 {
        let most = u128::from(u64::MAX);
        let blind_mm = (self.overlap_mm * 9.0 / 10.0).floor();
        let whole = match range_mm < self.overlap_mm {
            true => {
                let part = (range_mm - blind_mm).max(0.0) * two_to(16);
                let overlap = (part / (self.overlap_mm - blind_mm)).floor().max(two_to(12));
                (amplitude * two_to(16) / overlap).floor()
            }
            false => amplitude,
        };
        let light = (product(range_mm, range_mm) * whole as u128).min(most);
        in_u16(((light * u128::from(self.reflectivity_scale) + (1 << 63)) >> 64) as f64)
    }
}
