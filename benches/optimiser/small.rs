//! Problems like the closed loop's: few evaluations, 16 parameters of all kinds, noise.

use echoloop_cmaes::{CmaEs, CmaEsConfig, ConfigError, Constants, Coordinate};
use echoloop_random::Generator;

/// Number of real parameters, and numbers of values of whole ones and choices.
const REALS: usize = 10;
const WHOLE: [usize; 3] = [4, 16, 91];
const NAMES: [usize; 3] = [2, 3, 4];

/// Generations after which the mean is evaluated.
const GENERATIONS: [u64; 3] = [10, 20, 30];

/// Treatment of the parameters that are not real.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arm {
    pub(crate) name: &'static str,
    /// True for whole numbers with margin, false for reals rounded by the function.
    pub(crate) whole: bool,
    pub(crate) choices: Choices,
    pub(crate) constants: Constants,
}

/// Treatment of choices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Choices {
    /// As real numbers, rounded by the function.
    Rounded,
    /// As whole numbers.
    Whole,
    /// As choices.
    Names,
}

/// Arms of the comparison, the plain one first.
pub(crate) const ARMS: [Arm; 4] = {
    use Choices::{Names, Rounded, Whole};
    const fn arm(name: &'static str, whole: bool, choices: Choices) -> Arm {
        Arm { name, whole, choices, constants: Constants::Tutorial }
    }
    [
        arm("all rounded", false, Rounded),
        Arm {
            constants: Constants::Pycma,
            ..arm("all rounded, pycma's constants", false, Rounded)
        },
        arm("whole numbers and choices by margin", true, Whole),
        arm("whole numbers by margin, choices by name", true, Names),
    ]
};

/// A problem: a bowl around an optimum that depends on the names chosen.
pub(crate) struct Problem {
    start: Vec<f64>,
    optimum: Vec<f64>,
    weights: Vec<f64>,
    /// Cost of each name, the real parameter whose optimum it moves, and the distance.
    names: Vec<Vec<(f64, usize, f64)>>,
}

impl Problem {
    /// `right` is the probability that a choice starts at its right name.
    pub(crate) fn new(seed: u64, right: f64) -> Self {
        let mut draw = Generator::new(seed, 0x5ea1);
        let ordered = REALS + WHOLE.len();
        let start: Vec<f64> = (0..ordered).map(|_| draw.range(0.25, 0.75)).collect();
        let moved = start.iter().map(|s| (s + draw.spread(0.4)).clamp(0.02, 0.98)).collect();
        let weights = (0..ordered).map(|_| libm::exp(draw.spread(3.0))).collect();
        let mut choice_starts = Vec::new();
        let names = NAMES.map(|count| {
            let best = draw.index(count);
            let other = (best + 1 + draw.index(count - 1)) % count;
            let start = if draw.chance(right) { best } else { other };
            choice_starts.push((start as f64 + 0.5) / count as f64);
            let cost = |name: usize, draw: &mut Generator| {
                let loss = libm::exp(draw.spread(2.3)) * 0.3;
                if name == best { 0.0 } else { loss }
            };
            (0..count).map(|k| (cost(k, &mut draw), draw.index(REALS), draw.spread(0.15))).collect()
        });
        Self {
            start: [start, choice_starts].concat(),
            optimum: moved,
            weights,
            names: names.to_vec(),
        }
    }

    /// Loss at a point without noise, 0 at the optimum.
    pub(crate) fn loss(&self, point: &[f64]) -> f64 {
        let (ordered, chosen) = point.split_at(self.optimum.len());
        let mut optimum = self.optimum.clone();
        let mut loss = 0.0;
        for (u, names) in chosen.iter().zip(&self.names) {
            let (cost, moved, by) = names[cell(*u, names.len())];
            loss += cost;
            optimum[moved] += by;
        }
        for (i, u) in ordered.iter().enumerate() {
            let count = i.checked_sub(REALS).map(|i| WHOLE[i]);
            let nearest = |v: f64| count.map_or(v, |n| (cell(v, n) as f64 + 0.5) / n as f64);
            let off = nearest(*u) - nearest(optimum[i].clamp(0.0, 1.0));
            loss += self.weights[i] * off * off;
        }
        loss
    }

    fn config(&self, arm: Arm, seed: u64) -> CmaEsConfig {
        let mut config = CmaEsConfig::unit_cube(self.start.clone(), 0.2, seed);
        let whole = WHOLE.map(|n| if arm.whole { Coordinate::Whole(n) } else { Coordinate::Real });
        let choices = NAMES.map(|n| match arm.choices {
            Choices::Rounded => Coordinate::Real,
            Choices::Whole => Coordinate::Whole(n),
            Choices::Names => Coordinate::Choice(n),
        });
        config.coordinates = [[Coordinate::Real; REALS].as_slice(), &whole, &choices].concat();
        config.lambda = Some(16);
        config.constants = arm.constants;
        config
    }

    /// Loss of the mean after each of [`GENERATIONS`] of 16 candidates. The search is told
    /// ln(0.03 + loss) with normal noise.
    pub(crate) fn search(&self, arm: Arm, seed: u64, noise: f64) -> Result<Vec<f64>, ConfigError> {
        let mut search = CmaEs::new(self.config(arm, seed))?;
        let mut chance = Generator::new(seed, 0x0153);
        let mut losses = Vec::new();
        for until in GENERATIONS {
            while search.generation() < until {
                let candidates = search.ask();
                let values: Vec<f64> = candidates
                    .iter()
                    .zip(chance.normals(candidates.len()))
                    .map(|(c, z)| libm::log(0.03 + self.loss(&c.phenotype)) + noise * z)
                    .collect();
                let _ = search.tell(&values);
            }
            losses.push(self.loss(search.mean()));
        }
        Ok(losses)
    }
}

/// Index of the cell, of `count` equal ones of 0 to 1, that holds a coordinate.
fn cell(u: f64, count: usize) -> usize {
    ((u * count as f64) as usize).min(count - 1)
}
