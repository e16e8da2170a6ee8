//! Reasons why chosen values lie outside the search's last band.

use crate::significant;
use echoloop_closed_loop::parameters::{choices, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::{AxisRecord, RunResult};
use echoloop_closed_loop::search::Origin;

/// The origin of the choice, then a sentence for each parameter that was chosen more than one
/// standard deviation from the search's last mean; empty where there is none.
pub(crate) fn explained(
    result: &RunResult,
    axes: &[AxisRecord],
    generations: &[Generation],
) -> Vec<String> {
    let Some(last) = generations.last() else { return Vec::new() };
    let outside = |(number, axis)| outside(result, axis, number, last);
    let mut sentences: Vec<String> = axes.iter().enumerate().filter_map(outside).collect();
    if !sentences.is_empty() {
        let summary = format!(
            "Chosen outside the search’s last band: {} of {} parameters, for the choice is {}, \
             which won the race on the training pairs, where what the search had passed runs as \
             well as where it ended.",
            sentences.len(),
            axes.len(),
            origin(&result.origin, last)
        );
        sentences.insert(0, summary);
    }
    sentences
}

/// A sentence about a value outside the last generation's mean ± one standard deviation. `None` for
/// one inside, for an axis that the last search held still, and for a choice of names.
fn outside(
    result: &RunResult,
    axis: &AxisRecord,
    number: usize,
    last: &Generation,
) -> Option<String> {
    let (mean, deviation) = (last.mean.get(number)?, last.deviations.get(number)?);
    let chosen = effective(&result.tuned, &axis.name)?;
    if *deviation <= 0.0 || !choices(&axis.name).is_empty() {
        return None;
    }
    let [low, high] = [mean - deviation, mean + deviation].map(|u| axis.axis().from_cube(u));
    // A value that was rounded to the sensor's steps may miss its own band by one.
    let within = (low - 1e-6 * low.abs()..=high + 1e-6 * high.abs()).contains(&chosen);
    let side = if chosen < low { "below" } else { "above" };
    let unit = if axis.unit.is_empty() { String::new() } else { format!(" {}", axis.unit) };
    (!within).then(|| {
        format!(
            "{} = {}{unit} is {side} the band of {} to {}{unit} (mean ± one standard deviation)",
            axis.name,
            significant(chosen),
            significant(low),
            significant(high)
        )
    })
}

/// Origin of the chosen parameters in words.
fn origin(written: &str, last: &Generation) -> String {
    match Origin::read(written) {
        Some(Origin::Start) => "the start itself".to_owned(),
        Some(Origin::WarmStart(_)) => format!("what was tuned elsewhere ({written})"),
        Some(Origin::Survey(_)) => format!("an aim of the survey before the search ({written})"),
        Some(Origin::Combined) => "the winners of both halves, put together".to_owned(),
        Some(Origin::Mean { .. }) => format!("the mean of an earlier search ({written})"),
        Some(Origin::Candidate { generation, .. }) if generation < last.generation => format!(
            "an early candidate ({written}; the search went on to generation {})",
            last.generation
        ),
        Some(Origin::Candidate { .. }) => {
            format!("a single candidate ({written}), drawn from the band but not bound to it")
        }
        None => written.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_closed_loop::parameters::Scale;

    fn axis(name: &str, scale: Scale) -> AxisRecord {
        AxisRecord { name: name.into(), unit: "m".into(), scale, min: 1.0, max: 100.0 }
    }

    fn last(deviations: [f64; 3]) -> Generation {
        Generation {
            generation: 40,
            stage: "joint".into(),
            pairs: vec![0],
            mean: vec![0.5; 3],
            deviations: deviations.to_vec(),
            sigma: 0.1,
            candidates: Vec::new(),
        }
    }

    fn sentences(origin: &str, tuned: [f64; 3], deviations: [f64; 3]) -> Vec<String> {
        let axes = [axis("a", Scale::Log), axis("b", Scale::Log), axis("c", Scale::Integer)];
        let names = axes.iter().map(|axis| axis.name.clone());
        let result = crate::finished_runs::tests::result(origin, names.zip(tuned).collect());
        explained(&result, &axes, &[last(deviations)])
    }

    #[test]
    fn a_value_outside_the_last_band_is_named_with_the_band_and_where_the_choice_came_from() {
        let texts = sentences("joint, generation 3, candidate 7", [10.0, 50.0, 45.0], [0.1; 3]);
        assert_eq!(texts.len(), 2, "{texts:?}");
        assert!(
            texts[0].starts_with("Chosen outside the search’s last band: 1 of 3"),
            "{}",
            texts[0]
        );
        assert!(texts[0].contains(
            "an early candidate (joint, generation 3, candidate 7; the search \
                                  went on to generation 40), which won the race"
        ));
        let band = "b = 50 m is above the band of 6.31 to 15.8 m (mean ± one standard deviation)";
        assert_eq!(texts[1], band);
    }

    #[test]
    fn values_within_the_band_and_axes_held_still_are_not_explained() {
        assert!(sentences("joint, mean", [10.0, 9.0, 50.0], [0.1; 3]).is_empty());
        assert!(sentences("start", [99.0, 99.0, 99.0], [0.0; 3]).is_empty());
        let start = sentences("start", [99.0, 10.0, 50.0], [0.1; 3]);
        assert!(start[0].contains("the choice is the start itself"), "{start:?}");
        let warm = sentences("warm start 2", [99.0, 10.0, 50.0], [0.1; 3]);
        assert!(warm[0].contains("was tuned elsewhere (warm start 2), which won"), "{warm:?}");
    }
}
