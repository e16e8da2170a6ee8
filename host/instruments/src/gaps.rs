//! Gaps: ranges that an instrument left out of a record, missing or written as zeros.

use std::ops::Range;

/// Gaps of a record: its missing samples, which are NaN; without any, the runs of zeros inside it,
/// either all of them or none.
///
/// An instrument that keeps only samples near echoes writes the rest as zeros. The runs are gaps
/// when every sample beside a run is higher than the steepest step between two samples outside the
/// runs: a signal that slow does not fall to zero at once. In a record that rests at zero or swings
/// through it, zeros are samples.
pub(super) fn gaps(row: &[f64]) -> Vec<Range<usize>> {
    let missing = runs((0..row.len()).filter(|&i| row[i].is_nan()));
    if !missing.is_empty() {
        return missing;
    }
    let runs = inner_runs(row);
    if runs.is_empty() {
        return runs;
    }
    let steps = row.windows(2).filter(|pair| pair[0] != 0.0 && pair[1] != 0.0);
    let step = |pair: &[f64]| (pair[1] / 2.0 - pair[0] / 2.0).abs();
    let steepest = steps.map(step).fold(0.0, f64::max);
    let lowest = runs.iter().flat_map(|run| [row[run.start - 1], row[run.end]]);
    // Halves, since the step between two finite numbers may overflow.
    if lowest.fold(f64::INFINITY, f64::min) / 2.0 > steepest { runs } else { Vec::new() }
}

/// Runs of zeros with a sample before and after.
fn inner_runs(row: &[f64]) -> Vec<Range<usize>> {
    let last = row.len().saturating_sub(1);
    let mut runs = runs((1..last).filter(|&i| row[i] == 0.0));
    runs.retain(|run| row[run.start - 1] != 0.0 && row[run.end] != 0.0);
    runs
}

/// Runs of indices that follow each other.
fn runs(indices: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for i in indices {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end = i + 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

/// Fills each gap with a line between the samples beside it; one at an end of the record with the
/// sample beside it.
pub(super) fn bridge(values: &mut [f64], gaps: &[Range<usize>]) {
    for gap in gaps {
        let before = gap.start.checked_sub(1).map(|before| values[before]);
        let after = values.get(gap.end).copied();
        let Some((first, last)) = before.or(after).zip(after.or(before)) else { continue };
        let share = |i: usize| (i + 1 - gap.start) as f64 / (gap.len() + 1) as f64;
        for i in gap.clone() {
            values[i] = first * (1.0 - share(i)) + last * share(i);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_beside_high_samples_of_a_slow_signal_are_a_gap() {
        let row = [210., 230., 260., 240., 0., 0., 0., 232., 229., 230., 0., 218.];
        assert_eq!(gaps(&row), [4..7, 10..11]);
        let mut values = row.to_vec();
        bridge(&mut values, &gaps(&row));
        assert_eq!(values[3..8], [240., 238., 236., 234., 232.]);
        assert_eq!(values[10], 224.0);
    }

    #[test]
    fn zeros_of_a_record_that_reaches_zero_are_samples() {
        for row in [
            &[1., 1., 0., 0., 1., 9., 60., 9., 1.][..],
            &[12., 11., 80., 130., 40., 0., 0., 25., 12.],
            &[0., 0., 200., 210., 0., 0.],
            &[7., 0., 0.],
            &[-9., 0., 0., -8., -9.],
            &[],
        ] {
            assert!(gaps(row).is_empty(), "{row:?}");
        }
        assert!(gaps(&[f64::MAX, 0.0, -f64::MAX, f64::MAX]).is_empty());
    }

    #[test]
    fn missing_samples_are_gaps_at_the_ends_too() {
        let row = [f64::NAN, 4.0, f64::NAN, f64::NAN, 10.0, f64::NAN];
        assert_eq!(gaps(&row), [0..1, 2..4, 5..6]);
        let mut values = row.to_vec();
        bridge(&mut values, &gaps(&row));
        assert_eq!(values, [4.0, 4.0, 6.0, 8.0, 10.0, 10.0]);
    }
}
