//! Order of the search stages.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::config::TuneConfig;
use crate::config::preset::Strategy;
use crate::parameters::Space;

/// One search of a run: some axes, from the start or from the winner so far. Results keep its name
/// and sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Name in the journal: `lidar alone`, `registration`, `lidar` or `joint`.
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
    /// Place of the stage that continues from this one.
    fn after(self, generations: u32) -> Self {
        Self { searches: self.searches + 1, generations: self.generations + generations }
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

/// Stages of a run on `train_pairs` training pairs.
pub fn stages(config: &TuneConfig, space: &Space, train_pairs: usize) -> Vec<Stage> {
    let plan = Plan { config, space, train_pairs };
    let (lidar, registration) = (space.lidar_axes(), space.registration_axes());
    let all: Vec<usize> = (0..space.axes().len()).collect();
    let is_joint = !lidar.is_empty() && !registration.is_empty();
    let (generations, last) = (config.generations, config.last_generations());
    match config.strategy {
        _ if all.is_empty() => Vec::new(),
        Strategy::Fast if is_joint => {
            let first = Place::default();
            let second = first.after(generations);
            let third = second.after(generations.div_ceil(2));
            vec![
                plan.stage("lidar alone", lidar.clone(), generations, first),
                plan.stage("registration", registration, generations, first),
                plan.stage("lidar", lidar, generations.div_ceil(2), second),
                plan.stage("joint", all, last.div_ceil(2), third),
            ]
        }
        _ => {
            let name = match (lidar.is_empty(), registration.is_empty()) {
                (false, true) => "lidar",
                (true, false) => "registration",
                _ => "joint",
            };
            vec![plan.stage(name, all, last, Place::default())]
        }
    }
}

struct Plan<'a> {
    config: &'a TuneConfig,
    space: &'a Space,
    train_pairs: usize,
}

impl Plan<'_> {
    /// A stage that moves `axes`.
    fn stage(&self, name: &'static str, axes: Vec<usize>, generations: u32, place: Place) -> Stage {
        let config = self.config;
        let scans_are_shared =
            axes.iter().all(|axis| self.space.registration_axes().contains(axis));
        let pairs = match config.pairs_per_generation {
            0 => self.train_pairs,
            some if scans_are_shared && config.strategy == Strategy::Fast => 2 * some,
            some => some,
        };
        Stage {
            name: name.into(),
            place,
            generations,
            population: self.population(axes.len()),
            pairs: pairs.min(self.train_pairs),
            sigma: config.sigma,
            axes,
        }
    }

    /// λ as configured; by default the number of axes (Sec. 4.2).
    fn population(&self, axes: usize) -> usize {
        match self.config.population {
            0 => axes.max(2),
            population => population,
        }
    }
}
