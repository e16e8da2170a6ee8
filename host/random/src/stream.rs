//! Random numbers by index.

use crate::split_mix::{derive, split_mix_64};
use crate::uniform::{box_muller, open};

/// Stream of random numbers, read by index.
///
/// A number is a pure function of (seed, purpose, number, index): the same on any number of
/// threads, in any order.
#[derive(Clone, Copy, Debug)]
pub struct Stream(u64);

impl Stream {
    /// Stream of a numbered item; `purpose` keeps different uses of a seed apart.
    pub const fn new(seed: u64, purpose: u64, number: u64) -> Self {
        Self(derive(seed, purpose, number))
    }

    /// Stream of a numbered part of the item.
    #[must_use]
    pub const fn part(self, number: u64) -> Self {
        Self(split_mix_64(self.0 ^ number))
    }

    /// Uniform in (0, 1), 53 bits, neither end included.
    pub fn uniform(self, index: u64) -> f64 {
        open(split_mix_64(self.0.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15))))
    }

    /// Exponential of mean 1.
    pub fn exponential(self, index: u64) -> f64 {
        -libm::log(self.uniform(index))
    }

    /// Standard normal; uses the numbers `index` and `index + 1`.
    pub fn normal(self, index: u64) -> f64 {
        box_muller(self.exponential(index), self.uniform(index + 1))[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u64 = 100_000;

    fn moments(draw: impl Fn(u64) -> f64) -> (f64, f64) {
        let mean = (0..N).map(&draw).sum::<f64>() / N as f64;
        let variance = (0..N).map(|i| (draw(i) - mean).powi(2)).sum::<f64>() / N as f64;
        (mean, variance)
    }

    #[test]
    fn streams_have_the_moments_of_their_distributions() {
        let stream = Stream::new(7, 1, 0);
        // (draw, mean, variance); standard errors of the mean below 0.0032, of the variance below
        // 0.009.
        let close = |(mean, variance): (f64, f64), expected: (f64, f64)| {
            assert!(
                (mean - expected.0).abs() < 0.013 && (variance - expected.1).abs() < 0.04,
                "{mean} {variance}"
            );
        };
        close(moments(|i| stream.uniform(i)), (0.5, 1.0 / 12.0));
        close(moments(|i| stream.exponential(i)), (1.0, 1.0));
        close(moments(|i| stream.normal(2 * i)), (0.0, 1.0));
        close(moments(|i| Stream::new(7, 1, i).normal(0)), (0.0, 1.0));
    }
}
