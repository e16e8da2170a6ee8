//! Order of the search stages.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::config::TuneConfig;
use crate::config::preset::{Sampler, Strategy};
use crate::parameters::Space;

/// One search of a run: some axes, from the start or from the winner so far. Results keep its name
/// and sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Name in the journal, different from those of the other stages.
    pub name: Cow<'static, str>,
    /// Place in its line of stages. A stage from the start begins a line, so that a protocol part
    /// searched beside the other draws, and finds, the same as by itself.
    #[serde(skip)]
    pub place: Place,
    /// Indices of the axes that it moves; the others keep their values.
    #[serde(skip)]
    pub axes: Vec<usize>,
    /// Number of generations.
    pub generations: u32,
    /// Candidates per generation.
    pub population: usize,
    /// Training pairs per generation.
    pub pairs: usize,
    /// Initial step size in the unit cube.
    #[serde(skip)]
    pub sigma: f64,
}

/// Place of a stage in a line of stages, each of which continues from the one before. Seeds of
/// random draws follow from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Stages before it.
    pub searches: u32,
    /// Generations of the stages before it.
    pub generations: u32,
}

impl Place {
    /// Place of the stages that continue from these, which stand here side by side.
    fn after_all(self, stages: &[Stage]) -> Self {
        let longest = stages.iter().map(|stage| stage.generations).max().unwrap_or_default();
        Self { searches: self.searches + 1, generations: self.generations + longest }
    }
}

impl Stage {
    /// True when the stage begins at the start of the run.
    pub fn is_from_the_start(&self) -> bool {
        self.place.searches == 0
    }

    /// Point of the whole cube with this stage's coordinates, and those of `base` elsewhere.
    pub fn expanded(&self, coordinates: &[f64], base: &[f64]) -> Vec<f64> {
        let mut point = base.to_vec();
        for (&axis, &coordinate) in self.axes.iter().zip(coordinates) {
            point[axis] = coordinate;
        }
        point
    }

    /// Coordinates of this stage's axes in a point of the whole cube.
    pub fn own(&self, point: &[f64]) -> Vec<f64> {
        self.axes.iter().map(|&axis| point[axis]).collect()
    }

    /// Registrations of the stage.
    pub fn registrations(&self) -> usize {
        self.generations as usize * self.population * self.pairs
    }
}

/// Shares of a search's registrations, where their number is given: of each half, of registration
/// and the sensor again, each beside the other's winner, of registration a third time, and of both.
/// Registration's are cheap, as all its candidates share their scans, and its third search, of the
/// sensor as it will be, is the one that has to converge: that takes some forty generations.
const SHARES: [f64; 6] = [0.14, 0.14, 0.18, 0.1, 0.3, 0.14];

/// Initial step size of a stage that goes on from a winner, as a share of the configured one.
const LATER: f64 = 0.5;

/// Stages of a run on `train_pairs` training pairs, in their order. Those at one place are searched
/// side by side.
pub fn stages(config: &TuneConfig, space: &Space, train_pairs: usize) -> Vec<Stage> {
    let plan = Plan { config, space, train_pairs };
    let (lidar, registration) = (space.lidar_axes(), space.registration_axes());
    let all: Vec<usize> = (0..space.axes().len()).collect();
    let is_joint = !lidar.is_empty() && !registration.is_empty();
    let (generations, last) = (config.generations, config.last_generations());
    let is_staged = config.strategy == Strategy::Fast && config.sampler == Sampler::CmaEs;
    if all.is_empty() {
        return Vec::new();
    }
    if is_staged && is_joint {
        let [each, few] = [(2 * generations).div_ceil(3), generations.div_ceil(3)];
        let first = Place::default();
        let halves = [
            plan.stage("lidar", lidar.clone(), (each, SHARES[0]), first),
            plan.stage("registration", registration.clone(), (each, SHARES[1]), first),
        ];
        let second = first.after_all(&halves);
        let again = [
            plan.stage("registration again", registration.clone(), (few, SHARES[2]), second),
            plan.stage("lidar again", lidar, (few, SHARES[3]), second),
        ];
        let third = second.after_all(&again);
        let finer = [plan.stage("registration last", registration, (few, SHARES[4]), third)];
        let both =
            [plan.stage("joint", all, (last.div_ceil(3), SHARES[5]), third.after_all(&finer))];
        return halves.into_iter().chain(again).chain(finer).chain(both).collect();
    }
    let [name, again] = match (lidar.is_empty(), registration.is_empty()) {
        (false, true) => ["lidar", "lidar again"],
        (true, false) => ["registration", "registration again"],
        _ => ["joint", "joint again"],
    };
    // A half begins anew at its winner, as it does beside the other.
    if is_staged && config.registrations > 0 {
        let first = plan.stage(name, all.clone(), (last, 0.5), Place::default());
        let second = Place::default().after_all(std::slice::from_ref(&first));
        return vec![first, plan.stage(again, all, (last, 0.5), second)];
    }
    vec![plan.stage(name, all, (last, 1.0), Place::default())]
}

struct Plan<'a> {
    config: &'a TuneConfig,
    space: &'a Space,
    train_pairs: usize,
}

impl Plan<'_> {
    /// A stage that moves `axes`, of so many generations, or of its share of the registrations.
    fn stage(
        &self,
        name: &'static str,
        axes: Vec<usize>,
        (generations, share): (u32, f64),
        place: Place,
    ) -> Stage {
        let config = self.config;
        let scans_are_shared =
            axes.iter().all(|axis| self.space.registration_axes().contains(axis));
        let pairs = match config.pairs_per_generation {
            0 => self.train_pairs,
            some if scans_are_shared && config.strategy == Strategy::Fast => 2 * some,
            some => some,
        };
        let (pairs, population) = (pairs.min(self.train_pairs), self.population(axes.len()));
        let generations = match config.registrations {
            0 => generations,
            all => ((share * all as f64 / (population * pairs) as f64).round() as u32).max(1),
        };
        // What goes on from a winner looks near it.
        let sigma = if place.searches == 0 { config.sigma } else { LATER * config.sigma };
        Stage { name: name.into(), place, generations, population, pairs, sigma, axes }
    }

    /// λ as configured; by default the number of axes (Sec. 4.2).
    fn population(&self, axes: usize) -> usize {
        match self.config.population {
            0 => axes.max(2),
            population => population,
        }
    }
}
