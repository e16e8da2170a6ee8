//! Pieces that an instrument left out of a record, written as zeros.

use std::ops::Range;

use super::sample::Sample;

/// Runs of zeros inside a record that no signal falls to.
///
/// An instrument that keeps only what lies near an echo writes the rest as zeros. The runs of a
/// record are such gaps when the neighbours of all are higher than any step between two samples
/// beside the runs: what changes so slowly elsewhere did not fall to zero there. Zeros of a record
/// that rests at zero, or swings through it, are samples, and one such makes all of them samples.
pub(super) fn gaps<S: Sample>(row: &[S]) -> Vec<Range<usize>> {
    let runs = inner_runs(row);
    if runs.is_empty() {
        return runs;
    }
    let value = |i: usize| -> f64 { row[i].into() };
    let is_zero = |v: S| -> bool { Into::<f64>::into(v) == 0.0 };
    let steps = row.windows(2).filter(|pair| !is_zero(pair[0]) && !is_zero(pair[1]));
    let half = |v: S| -> f64 { Into::<f64>::into(v) / 2.0 };
    let step = |pair: &[S]| (half(pair[1]) - half(pair[0])).abs();
    let steepest = steps.map(step).fold(0.0, f64::max);
    let lowest = runs.iter().flat_map(|run| [run.start - 1, run.end]).map(value);
    // Halves, for the step between finite numbers may be infinite.
    if lowest.fold(f64::INFINITY, f64::min) / 2.0 > steepest { runs } else { Vec::new() }
}

/// Runs of zeros with a sample before and after.
fn inner_runs<S: Sample>(row: &[S]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let last = row.len().saturating_sub(1);
    for i in (1..last).filter(|&i| row[i].into() == 0.0) {
        match runs.last_mut() {
            Some(run) if run.end == i => run.end = i + 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs.retain(|run| row[run.start - 1].into() != 0.0 && row[run.end].into() != 0.0);
    runs
}

/// Draws a line over each gap.
pub(super) fn bridge(values: &mut [f64], gaps: &[Range<usize>]) {
    for gap in gaps {
        let (first, last) = (values[gap.start - 1], values[gap.end]);
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
    fn zeros_that_nothing_falls_to_are_a_gap() {
        let row = [210., 230., 260., 240., 0., 0., 0., 232., 229., 230., 0., 218.];
        assert_eq!(gaps(&row), [4..7, 10..11]);
        let mut values = row.to_vec();
        bridge(&mut values, &gaps(&row));
        assert_eq!(values[3..8], [240., 238., 236., 234., 232.]);
        assert_eq!(values[10], 224.0);
    }

    #[test]
    fn zeros_of_a_record_at_rest_there_are_samples() {
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
}
