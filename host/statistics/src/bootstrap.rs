//! Percentile bootstrap: Efron and Tibshirani, "An Introduction to the Bootstrap" (1993), Ch. 13.

use echoloop_random::Generator;

use crate::quantile;

/// Resamples of a bootstrap.
const RESAMPLES: u64 = 2_000;

/// "bootstrap" as a number: keeps these draws apart from those of other uses.
const PURPOSE: u64 = 0x626f_6f74_7374_7261;

/// 95 % interval of a figure of `count` things: percentiles of the figure over resamples, each of
/// `count` indices drawn with repetition. Resamples whose figure is not finite are left out; where
/// those are half or more, and of nothing, there is no interval.
pub fn bootstrap(count: usize, figure: &dyn Fn(&[usize]) -> f64) -> [f64; 2] {
    let resampled = |sample: u64| {
        let mut random = Generator::from_key([sample, count as u64, 0, PURPOSE]);
        figure(&(0..count).map(|_| random.index(count)).collect::<Vec<_>>())
    };
    let samples = if count == 0 { 0 } else { RESAMPLES };
    let mut figures: Vec<f64> = (0..samples).map(resampled).filter(|f| f.is_finite()).collect();
    if figures.len() <= RESAMPLES as usize / 2 {
        return [f64::NAN; 2];
    }
    figures.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| quantile(&figures, share))
}

/// 95 % interval of the mean of `values`, by [`bootstrap`].
pub fn mean_interval(values: &[f64]) -> [f64; 2] {
    let mean =
        |drawn: &[usize]| drawn.iter().map(|&i| values[i]).sum::<f64>() / values.len() as f64;
    bootstrap(values.len(), &mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error_and_holds_it_as_often_as_said() {
        let mut random = Generator::new(3, 0);
        let mut missed = 0;
        for _ in 0..200 {
            let values = random.normals(60);
            let [low, high] = mean_interval(&values);
            // 3.92 standard errors
            assert!((0.7..1.4).contains(&((high - low) / (3.92 / libm::sqrt(60.0)))));
            missed += u32::from(low > 0.0 || high < 0.0);
        }
        assert!((2..=24).contains(&missed), "{missed} of 200 miss the mean, 5 % should");
        assert_eq!(mean_interval(&[2.5; 7]), [2.5, 2.5]);
        assert!(mean_interval(&[]).iter().all(|end| end.is_nan()));
    }

    #[test]
    fn resamples_without_a_figure_are_left_out_and_where_most_are_there_is_no_interval() {
        let without = |least: usize| {
            bootstrap(10, &|drawn| {
                if drawn[0] < least { f64::NAN } else { drawn[0] as f64 }
            })
        };
        assert_eq!(without(2), [2.0, 9.0]);
        assert!(without(8)[0].is_nan());
    }
}
