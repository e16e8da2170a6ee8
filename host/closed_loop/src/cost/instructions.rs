//! Model of the detector's instructions, fitted to counts.
//!
//! | stage | instructions |
//! |---|---|
//! | a shot; their sum | `a + b N`, where there are more shots than one |
//! | statistics | `a + b N`, of samples of full gain |
//! | baseline | `a + b N + c N_near` |
//! | filter | `N (a + b T)` |
//! | peaks | `a + b N + c E` |
//! | report | `E (a + b T)`; `+ c + d E` where several echoes are kept; `+ e` for each near one |
//!
//! N samples, T taps, E echoes found. Least squares of relative errors over the counted cases,
//! solved at run time, so that no coefficient has to be kept up to date. Upsampling adds less than
//! the model's error.

use echoloop_dsp::{Hardware, Settings};
use nalgebra::{DMatrix, DVector};

use super::record::{Case, Load};

/// Fitted stages of a processor.
pub(super) struct Model {
    shot: Stage,
    sum: Stage,
    /// Stages from a waveform to its echoes.
    pipeline: Vec<Stage>,
}

impl Model {
    /// Fits the model to counts.
    pub(super) fn fitted(cases: &[Case]) -> Self {
        let of_shots: Terms = |load| vec![1.0, load.samples];
        let pipeline = OF_PIPELINE.iter().map(|(name, terms)| Stage::fitted(name, *terms, cases));
        Self {
            shot: Stage::fitted("shot", of_shots, cases),
            sum: Stage::fitted("sum", of_shots, cases),
            pipeline: pipeline.collect(),
        }
    }

    /// Instructions a waveform by settings and `[echoes, near echoes]`; `None` for settings that
    /// are refused.
    pub(super) fn of(
        &self,
        settings: &Settings,
        hardware: &Hardware,
        echoes: [f64; 2],
    ) -> Option<f64> {
        Load::new(settings, hardware, echoes).map(|load| self.instructions(&load))
    }

    /// Instructions a waveform.
    pub(super) fn instructions(&self, load: &Load) -> f64 {
        let summed = match load.shots > 1.0 {
            true => load.shots * self.shot.instructions(load) + self.sum.instructions(load),
            false => 0.0,
        };
        summed + self.pipeline.iter().map(|stage| stage.instructions(load)).sum::<f64>()
    }
}

/// Terms whose weighted sum is the instructions of a stage.
type Terms = fn(&Load) -> Vec<f64>;

/// Fitted stage.
struct Stage {
    terms: Terms,
    coefficients: DVector<f64>,
}

impl Stage {
    /// Fits the coefficients of a stage by least squares of relative errors.
    fn fitted(name: &str, terms: Terms, cases: &[Case]) -> Self {
        let counted = cases.iter().filter_map(|case| Some((case, *case.stages.get(name)?)));
        let counted: Vec<(&Case, f64)> = counted.filter(|(_, n)| *n > 0.0).collect();
        let rows: Vec<Vec<f64>> = counted
            .iter()
            .map(|(case, n)| terms(&case.load).iter().map(|term| term / n).collect())
            .collect();
        let columns = rows.first().map_or(0, Vec::len);
        let matrix = DMatrix::from_row_iterator(rows.len(), columns, rows.into_iter().flatten());
        let ones = DVector::repeat(counted.len(), 1.0);
        let coefficients = matrix.svd(true, true).solve(&ones, 1e-9);
        let coefficients = coefficients.unwrap_or_else(|_| DVector::zeros(columns));
        Self { terms, coefficients }
    }

    fn instructions(&self, load: &Load) -> f64 {
        let terms = (self.terms)(load);
        terms.iter().zip(&self.coefficients).map(|(term, coefficient)| term * coefficient).sum()
    }
}

const OF_PIPELINE: [(&str, Terms); 5] = [
    ("statistics", |load| vec![1.0, load.samples - load.near_samples]),
    ("baseline", |load| vec![1.0, load.samples, load.near_samples]),
    ("filter", |load| vec![load.samples, load.samples * load.taps]),
    ("peaks", |load| vec![1.0, load.samples, load.echoes]),
    ("report", |load| {
        let several = f64::from(u8::from(load.several));
        let (echoes, near) = (load.echoes, load.near_echoes);
        vec![echoes, echoes * load.taps, several, several * echoes, near]
    }),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::Processor;
    use crate::cost::record::cases;

    /// Largest relative error of the model.
    const TOLERANCE: f64 = 0.05;

    #[test]
    fn the_model_is_within_five_percent_of_every_counted_waveform() {
        let cases = cases(&Processor::REFERENCE);
        let model = Model::fitted(&cases);
        assert!(cases.len() >= 8, "{} cases are read of the record", cases.len());
        for case in &cases {
            let (model, counted) = (model.instructions(&case.load), case.stages["pipeline"]);
            let off = model / counted - 1.0;
            assert!(off.abs() < TOLERANCE, "{}: {model:.0} for {counted}, {off:+.3}", case.name);
        }
    }

    #[test]
    fn sixteen_shots_cost_sixteen_counted_shots_and_their_sum() {
        let cases = cases(&Processor::REFERENCE);
        let model = Model::fitted(&cases);
        for case in &cases {
            let with = |shots| model.instructions(&Load { shots, ..case.load });
            let counted = 16.0 * case.stages["shot"] + case.stages["sum"];
            let off = (with(16.0) - with(1.0)) / counted - 1.0;
            assert!(off.abs() < TOLERANCE, "{}: {off:+.3}", case.name);
        }
    }

    #[test]
    fn a_waveform_left_out_of_the_fit_is_predicted_within_a_tenth() {
        let mut rest = cases(&Processor::REFERENCE);
        let left_out = rest.iter().position(|case| case.name == "1024x16 one echo");
        let case = rest.remove(left_out.expect("it was counted"));
        for (name, terms) in OF_PIPELINE {
            let model = Stage::fitted(name, terms, &rest).instructions(&case.load);
            let off = model / case.stages[name] - 1.0;
            assert!(off.abs() < 0.1, "{name}: {off:+.3}");
        }
    }
}
