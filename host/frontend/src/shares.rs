//! Shares of a beam that its surfaces block.

use crate::light::Return;

/// Share of the beam that each return blocks.
///
/// A [`Return`] has a strength but not the share of the beam that made it. The share is estimated
/// as `strength · R²`, normalised: exact when all surfaces of the beam are alike. A beam without
/// returns is never blocked; one with returns ends at the last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shares<'a> {
    returns: &'a [Return],
    total: f64,
}

impl<'a> Shares<'a> {
    pub(crate) fn new(returns: &'a [Return]) -> Self {
        Self { returns, total: returns.iter().map(weight).sum() }
    }

    /// Range and share of every return, the nearest first.
    pub(crate) fn taken(self) -> impl Iterator<Item = (f64, f64)> + 'a {
        self.returns.iter().map(move |r| (f64::from(r.range_m), weight(r) / self.total))
    }

    /// Range of every return, and the share of the beam that reaches it.
    pub(crate) fn steps(self) -> impl Iterator<Item = (f64, f64)> + 'a {
        let mut open = 1.0;
        self.taken().map(move |(range_m, share)| {
            let before = open;
            open -= share;
            (range_m, before)
        })
    }

    /// Share that passes all returns.
    pub(crate) fn beyond(self) -> f64 {
        if self.returns.is_empty() { 1.0 } else { 0.0 }
    }

    /// Share that reaches a range.
    pub(crate) fn open_at(self, range_m: f64) -> f64 {
        self.steps().find(|(end_m, _)| range_m < *end_m).map_or(self.beyond(), |(_, open)| open)
    }
}

/// Share of a return, not normalised.
fn weight(echo: &Return) -> f64 {
    let range_m = f64::from(echo.range_m);
    f64::from(echo.strength_per_m2) * range_m * range_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_exact_for_surfaces_that_are_alike() {
        let at = |range_m: f32, share: f32| Return {
            range_m,
            strength_per_m2: share * 0.1 / (range_m * range_m),
        };
        let returns = [at(5.0, 0.25), at(20.0, 0.75)];
        let shares = Shares::new(&returns);
        for (range_m, open) in [(1.0, 1.0), (6.0, 0.75), (30.0, 0.0)] {
            assert!((shares.open_at(range_m) - open).abs() < 1e-6, "{range_m} m");
        }
        assert_eq!(Shares::new(&[]).open_at(500.0), 1.0);
    }
}
