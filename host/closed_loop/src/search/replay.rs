//! Comparison of a journal's generations with those that a search would write now.

use crate::run_folder::journal::{CandidateRecord, Generation};

/// First field in which a generation of the journal differs, bit for bit, from the one that would
/// be written now. The errors of the pairs are taken from the journal; the fitness made of them is
/// compared.
///
/// A search's start depends on the defaults of this version besides its configuration, so equal
/// headers do not suffice.
pub(crate) fn difference(
    found: &Generation,
    drawn: &Generation,
    fitness: &dyn Fn(&CandidateRecord) -> f64,
) -> Option<String> {
    let fields = [
        ("generation", found.generation == drawn.generation),
        ("stage", found.stage == drawn.stage),
        ("pairs", found.pairs == drawn.pairs),
        ("mean", found.mean == drawn.mean),
        ("deviations", found.deviations == drawn.deviations),
        ("sigma", found.sigma == drawn.sigma),
        ("candidates", found.candidates.len() == drawn.candidates.len()),
    ];
    if let Some((field, _)) = fields.into_iter().find(|(_, same)| !same) {
        return Some(field.to_owned());
    }
    let candidates = found.candidates.iter().zip(&drawn.candidates).enumerate();
    candidates.into_iter().find_map(|(i, (found, asked))| {
        let field = candidate_difference(found, asked, &drawn.pairs, fitness)?;
        Some(format!("candidates[{i}].{field}"))
    })
}

fn candidate_difference(
    found: &CandidateRecord,
    asked: &CandidateRecord,
    pairs: &[usize],
    fitness: &dyn Fn(&CandidateRecord) -> f64,
) -> Option<&'static str> {
    let fields = [
        ("point", found.point == asked.point),
        ("values", found.values == asked.values),
        ("repaired", found.repaired == asked.repaired),
        ("settings", found.settings == asked.settings),
        ("errors", found.errors.iter().map(|error| &error.pair).eq(pairs)),
        ("fitness", found.fitness == fitness(found)),
    ];
    fields.into_iter().find(|(_, same)| !same).map(|(field, _)| field)
}

#[cfg(test)]
mod tests {
    use echoloop_cmaes::{CmaEs, CmaEsConfig};

    use super::*;
    use crate::evaluation::objective::PairError;
    use crate::parameters::Values;

    fn search(start: f64) -> CmaEs {
        CmaEs::new(CmaEsConfig::unit_cube(vec![start; 3], 0.2, 1)).unwrap()
    }

    /// A generation of two pairs, with the errors that a search would have written.
    fn written(optimizer: &CmaEs) -> Generation {
        let error = |pair| PairError { pair, frobenius: pair as f64, ..PairError::default() };
        let record = |point| CandidateRecord {
            point,
            values: Values::from([("lidar.power".into(), 5.0)]),
            repaired: Vec::new(),
            settings: 7,
            errors: vec![error(1), error(4)],
            fitness: 2.0, // capped at 3
            cost: None,
        };
        Generation {
            generation: optimizer.generation() as u32,
            stage: "joint".into(),
            pairs: vec![1, 4],
            mean: optimizer.mean().to_vec(),
            deviations: optimizer.deviations(),
            sigma: optimizer.sigma(),
            candidates: optimizer.ask().into_iter().map(|c| record(c.phenotype)).collect(),
        }
    }

    #[test]
    fn a_search_goes_on_only_from_what_it_would_have_written_itself() {
        let capped = |error: &PairError| error.frobenius.min(3.0);
        let fitness = |c: &CandidateRecord| c.errors.iter().map(capped).sum::<f64>() / 2.0;
        let drawn = written(&search(0.5));
        assert_eq!(difference(&written(&search(0.5)), &drawn, &fitness), None);
        assert_eq!(difference(&written(&search(0.6)), &drawn, &fitness).unwrap(), "mean");
        type Change = fn(&mut Generation);
        let changes: [(&str, Change); 15] = [
            ("generation", |g| g.generation += 1),
            ("stage", |g| g.stage.push('s')),
            ("pairs", |g| g.pairs.reverse()),
            ("mean", |g| g.mean.clear()),
            ("deviations", |g| g.deviations[0] *= 1.0 + 1e-15),
            ("sigma", |g| g.sigma = 1e308),
            ("candidates", |g| g.candidates.clear()),
            ("candidates[0].point", |g| g.candidates.reverse()),
            ("candidates[2].point", |g| g.candidates[2].point[1] *= 1.0 + 1e-15),
            ("candidates[1].values", |g| g.candidates[1].values.clear()),
            ("candidates[1].repaired", |g| g.candidates[1].repaired.push("gain".into())),
            ("candidates[1].settings", |g| g.candidates[1].settings ^= 1),
            ("candidates[0].errors", |g| g.candidates[0].errors.truncate(1)),
            ("candidates[0].fitness", |g| g.candidates[0].errors[0].frobenius = 1.5),
            ("candidates[0].fitness", |g| g.candidates[0].fitness = -1e300),
        ];
        for (field, change) in changes {
            let mut found = written(&search(0.5));
            change(&mut found);
            assert_eq!(difference(&found, &drawn, &fitness).as_deref(), Some(field));
        }
    }
}
