//! Samples in any unit as ADC codes, which the DSP takes.

use std::ops::Range;

use super::gaps::{bridge, gaps};

/// Largest code: 14 bits.
const TOP: f64 = 16_383.0;

/// A waveform as codes, and the way back to its units.
#[derive(Clone, Debug, PartialEq)]
pub struct Codes {
    /// Samples minus their least, in codes.
    pub codes: Vec<u16>,
    /// Left shift that brings a code to Q1.15.
    pub shift: u32,
    /// One code in the input's units.
    pub unit: f64,
    /// Ranges that the instrument left out; their codes are a line from end to end.
    pub gaps: Vec<Range<usize>>,
}

impl Codes {
    /// Scales finite numbers; a missing one is NaN, and not all are.
    ///
    /// ```text
    /// whole numbers over less than 2¹⁴:  code = v − min,                unit = 1
    /// others:                            code = round((v − min)/unit),  unit = (max − min)/16383
    /// shift = 15 − bits of the largest code, 1 to 7
    /// ```
    ///
    /// Whole numbers keep their step, so that it counts as noise; a line over a gap of them is
    /// rounded.
    pub fn from_samples(samples: &[f64]) -> Self {
        let gaps = gaps(samples);
        if gaps.is_empty() {
            return Self::from_whole_record(samples);
        }
        let mut values = samples.to_vec();
        let whole = values.iter().all(|v| v.is_nan() || v.fract() == 0.0);
        bridge(&mut values, &gaps);
        if whole {
            values.iter_mut().for_each(|v| *v = v.round());
        }
        Self { gaps, ..Self::from_whole_record(&values) }
    }

    fn from_whole_record(samples: &[f64]) -> Self {
        let values = || samples.iter().copied();
        let min = values().fold(f64::INFINITY, f64::min);
        let max = values().fold(f64::NEG_INFINITY, f64::max);
        // Halves, since the range of two finite numbers may overflow.
        let half_range = max / 2.0 - min / 2.0;
        let whole = 2.0 * half_range <= TOP && values().all(|v| v.fract() == 0.0);
        let unit = if whole { 1.0 } else { half_range / TOP * 2.0 };
        let code = |v: f64| match whole {
            true => (v - min) as u16,
            false => ((v / 2.0 - min / 2.0) / half_range * TOP + 0.5) as u16,
        };
        Self::of_codes(values().map(code).collect(), unit, Vec::new())
    }

    pub(super) fn of_codes(codes: Vec<u16>, unit: f64, gaps: Vec<Range<usize>>) -> Self {
        let bits = 16 - codes.iter().copied().max().unwrap_or_default().leading_zeros();
        Self { codes, shift: 15u32.saturating_sub(bits).clamp(1, 7), unit, gaps }
    }

    /// Those of some ranges that have no gap, and the record's highest code twice at most: more is
    /// a clipped top.
    pub(super) fn undisturbed(
        &self,
        ranges: impl Iterator<Item = Range<usize>>,
    ) -> impl Iterator<Item = Range<usize>> {
        let highest = self.codes.iter().max();
        ranges.filter(move |at| {
            let has_gap = self.gaps.iter().any(|gap| gap.start < at.end && at.start < gap.end);
            let is_highest = |code: &&u16| Some(*code) == highest;
            !has_gap && self.codes[at.clone()].iter().filter(is_highest).count() < 3
        })
    }

    /// True when a sample lies in a gap or beside one.
    pub fn is_beside_gap(&self, sample: usize) -> bool {
        self.gaps.iter().any(|gap| (gap.start.saturating_sub(1)..=gap.end).contains(&sample))
    }

    /// A code in Q1.15.
    pub(super) fn scale(&self) -> f64 {
        f64::from(1u32 << self.shift)
    }

    /// A height in Q1.15 in codes.
    pub fn of_height(&self, height: i64) -> f64 {
        height as f64 / self.scale()
    }

    /// Noise in Q13.19 in codes.
    pub(super) fn of_sigma(&self, sigma: u32) -> f64 {
        self.of_height(sigma.into()) / 16.0
    }

    /// Noise in the input's units in Q13.19.
    pub(super) fn sigma_of(&self, sigma: f64) -> u32 {
        (16.0 * self.scale() * sigma / self.unit).round() as u32
    }

    /// A height in Q1.15 in the input's units.
    pub fn to_units(&self, height: i64) -> f64 {
        (self.of_height(height) * self.unit).min(f64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_keep_their_step() {
        let codes = Codes::from_samples(&[-3.0, 0.0, 1020.0]);
        let expected = Codes { codes: vec![0, 3, 1023], shift: 5, unit: 1.0, gaps: vec![] };
        assert_eq!(codes, expected);
        assert_eq!(codes.to_units(1023 << 5), 1023.0);
    }

    #[test]
    fn other_numbers_fill_fourteen_bits() {
        let codes = Codes::from_samples(&[0.0, 0.25, 0.5]);
        assert_eq!((&codes.codes[..], codes.shift), (&[0, 8192, 16_383][..], 1));
        assert!((codes.to_units(16_383 << 1) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn extreme_numbers_scale_too() {
        assert_eq!(Codes::from_samples(&[-f64::MAX, 0.0, f64::MAX]).codes, [0, 8192, 16_383]);
        assert_eq!(Codes::from_samples(&[1e-300, 3e-300]).codes, [0, 16_383]);
        assert_eq!(Codes::from_samples(&[f64::MIN_POSITIVE; 4]).codes, [0; 4]);
        assert_eq!(Codes::from_samples(&[7.0; 3]).codes, [0; 3]);
        assert!(Codes::from_samples(&[]).codes.is_empty());
    }
}
