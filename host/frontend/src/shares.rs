//! How much of a beam ends at which surface.

use crate::light::Return;

/// Shares of a beam's light by where it ends.
///
/// A scene's response says how strong a return is, not how much of the beam it took. The share is
/// estimated as `strength · R²`, normalised: exact where a beam's surfaces are alike. A beam
/// without returns goes on for ever; one with returns ends at the last.
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

    /// Range of every return, and the share of the beam that gets as far.
    pub(crate) fn steps(self) -> impl Iterator<Item = (f64, f64)> + 'a {
        let mut open = 1.0;
        self.taken().map(move |(range_m, share)| {
            let before = open;
            open -= share;
            (range_m, before)
        })
    }

    /// Share that gets beyond all returns.
    pub(crate) fn beyond(self) -> f64 {
        if self.returns.is_empty() { 1.0 } else { 0.0 }
    }

    /// Share that gets as far as this.
    pub(crate) fn open_at(self, range_m: f64) -> f64 {
        self.steps().find(|(end_m, _)| range_m < *end_m).map_or(self.beyond(), |(_, open)| open)
    }
}

/// In proportion to a return's share.
fn weight(echo: &Return) -> f64 {
    let range_m = f64::from(echo.range_m);
    f64::from(echo.strength_per_m2) * range_m * range_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_like_surfaces_are_those_of_the_beam() {
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
