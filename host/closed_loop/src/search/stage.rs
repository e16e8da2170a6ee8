//! What is searched after what.

use crate::config::TuneConfig;
use crate::config::preset::Strategy;
use crate::parameters::Space;

/// One search of a run: some of the axes, from the start or from where the one before it ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Its name in the journal: `lidar alone`, `registration`, `lidar` or `joint`.
    pub name: &'static str,
    /// Its place in its line. Those that begin at the start begin a line: so a half searched
    /// beside the other draws, and finds, what it would by itself.
    pub place: Place,
    /// The axes it moves, by number; the others stay where they are.
    pub axes: Vec<usize>,
    /// Generations.
    pub generations: u32,
    /// Candidates a generation.
    pub population: usize,
    /// Training pairs a generation sees.
    pub pairs: usize,
    /// Start of the step size, in the unit cube.
    pub sigma: f64,
}

/// Where a search stands in a line of searches, each of which goes on from the one before: what is
/// drawn at random hangs on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Searches before it.
    pub searches: u32,
    /// Their generations.
    pub generations: u32,
}

impl Place {
    /// The place of the search that goes on from one here.
    fn after(self, generations: u32) -> Self {
        Self { searches: self.searches + 1, generations: self.generations + generations }
    }
}

impl Stage {
    /// Whether it begins where the run does.
    pub fn is_from_the_start(&self) -> bool {
        self.place.searches == 0
    }

    /// A point of the whole cube: this stage's coordinates, at `base` in all others.
    pub fn expanded(&self, coordinates: &[f64], base: &[f64]) -> Vec<f64> {
        let mut point = base.to_vec();
        for (&axis, &coordinate) in self.axes.iter().zip(coordinates) {
            point[axis] = coordinate;
        }
        point
    }

    /// This stage's coordinates of a point of the whole cube.
    pub fn own(&self, point: &[f64]) -> Vec<f64> {
        self.axes.iter().map(|&axis| point[axis]).collect()
    }

    /// Registrations it takes.
    pub fn registrations(&self) -> usize {
        self.generations as usize * self.population * self.pairs
    }
}

/// The searches of a run on so many training pairs.
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
    /// A stage of some of the axes.
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
            name,
            place,
            generations,
            population: self.population(axes.len()),
            pairs: pairs.min(self.train_pairs),
            sigma: config.sigma,
            axes,
        }
    }

    /// λ as configured; else as many as there are axes (Sec. 4.2).
    fn population(&self, axes: usize) -> usize {
        match self.config.population {
            0 => axes.max(2),
            population => population,
        }
    }
}
