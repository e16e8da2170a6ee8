//! Direction of the echoes of a recording.

use super::response::robust::sigma_of_magnitudes;
use super::rows::Rows;

/// Direction of echoes from the ambient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polarity {
    /// They rise above it.
    Positive,
    /// They fall below it.
    Negative,
}

/// Rows that are looked at, evenly over the file.
const ROWS: usize = 1_000;

/// Least height of a signal over the noise of its row.
const CLEAR: f64 = 8.0;

/// Least ratio of fall to rise of a row whose echoes fall. A receiver's undershoot is lower than
/// its echo.
const FALLS: f64 = 2.0;

/// Least share of the rows with a signal.
const MOST: f64 = 0.75;

impl Polarity {
    /// Direction of the echoes of most rows that have a clear one; positive where none has.
    ///
    /// ```text
    /// rest    middle of the narrowest range of a third of the row's samples
    /// σ       median of |x[n + 1] − x[n]| / (0.6745 √2), at least a thousandth of the row's range
    /// falls   rest − min x ≥ max(8 σ, 2 (max x − rest)), and the first sample is within a quarter
    ///         of that fall of the rest: a row of mostly echo rests at its top
    /// ```
    pub fn of(rows: &Rows) -> Self {
        let looked = rows.len().min(ROWS);
        let row = |i: usize| (i as u64 * rows.len() as u64 / looked as u64) as usize;
        let signs: Vec<Self> = (0..looked).filter_map(|i| of_row(&rows.row(row(i)))).collect();
        let falling = signs.iter().filter(|sign| **sign == Self::Negative).count();
        match falling as f64 >= MOST * signs.len() as f64 && falling > 0 {
            true => Self::Negative,
            false => Self::Positive,
        }
    }
}

/// Direction of a row's echoes; `None` where no echo is clear.
fn of_row(row: &[f64]) -> Option<Polarity> {
    let present: Vec<f64> = row.iter().copied().filter(|value| !value.is_nan()).collect();
    let mut sorted = present.clone();
    sorted.sort_by(f64::total_cmp);
    let (least, greatest) = (*sorted.first()?, *sorted.last()?);
    let third = sorted.len() / 3;
    let narrowest = (0..sorted.len() - third).min_by(|&a, &b| {
        (sorted[a + third] - sorted[a]).total_cmp(&(sorted[b + third] - sorted[b]))
    })?;
    let rest = sorted[narrowest] / 2.0 + sorted[narrowest + third] / 2.0;
    let mut steps: Vec<f64> = present.windows(2).map(|two| (two[1] - two[0]).abs()).collect();
    let noise = (sigma_of_magnitudes(&mut steps) / 2f64.sqrt()).max((greatest - least) / 1e3);
    let (rise, fall) = (greatest - rest, rest - least);
    if rise.max(fall) < CLEAR * noise || rise.max(fall) <= 0.0 {
        return None;
    }
    let begins_at_rest = (present[0] - rest).abs() <= fall / 4.0;
    Some(match fall >= FALLS * rise && begins_at_rest {
        true => Polarity::Negative,
        false => Polarity::Positive,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(samples: usize, echoes: &[(f64, f64, f64)]) -> Vec<f64> {
        let value = |n: usize| -> f64 {
            let noise = ((n * 7919) % 7) as f64 - 3.0;
            let echo = |&(time, height, sigma): &(f64, f64, f64)| {
                height * (-(n as f64 - time).powi(2) / (2.0 * sigma * sigma)).exp()
            };
            (3000.0 + noise + echoes.iter().map(echo).sum::<f64>()).round()
        };
        (0..samples).map(value).collect()
    }

    fn of(rows: &[Vec<f64>]) -> Polarity {
        Polarity::of(&Rows::of_rows(rows.iter().cloned()))
    }

    #[test]
    fn echoes_that_fall_are_told_from_echoes_that_rise() {
        let falling = row(200, &[(80.0, -900.0, 3.0), (120.0, -300.0, 3.0)]);
        let rising = row(200, &[(80.0, 900.0, 3.0), (95.0, -300.0, 6.0)]); // an undershoot
        let noise = row(200, &[]);
        assert_eq!(of(&[falling.clone(), noise.clone(), falling.clone()]), Polarity::Negative);
        assert_eq!(of(&[rising.clone(), noise.clone()]), Polarity::Positive);
        assert_eq!(of(&[falling.clone(), rising.clone(), rising.clone()]), Polarity::Positive);
        assert_eq!(of(&[noise]), Polarity::Positive);
        assert_eq!(of(&[]), Polarity::Positive);
    }

    #[test]
    fn a_short_row_of_mostly_echo_does_not_fall() {
        assert_eq!(of(&[row(30, &[(14.0, 200.0, 9.0)])]), Polarity::Positive);
        assert_eq!(of(&[row(24, &[(8.0, 200.0, 5.0), (18.0, 190.0, 5.0)])]), Polarity::Positive);
    }
}
