//! One run of the study.

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Held-out pairs of a run.
const TEST_PAIRS: &str = "data.test_pairs=100";

macro_rules! choice {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize,
        )]
        #[serde(rename_all = "kebab-case")]
        pub(crate) enum $name { $($(#[$variant_doc])* $variant),+ }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                let value = self.to_possible_value();
                f.write_str(value.as_ref().map_or("", |value| value.get_name()))
            }
        }
    };
}

choice! {
    /// How it is searched.
    Strategy {
        /// As by default.
        Fast,
        /// As by default, on one pair a generation where that takes three, in fewer generations and
        /// with a smaller race: less than a fifth of the paper's registrations.
        Short,
        /// The same in still fewer, which may begin at what `fast` tuned in each kind with seed 1.
        Warm,
        /// As in the paper.
        Paper,
        /// As by default, for the least energy at no more than 1.2 times the start's error.
        Thrift,
    }
}

choice! {
    /// What is tuned.
    Protocol { Lidar, Registration, Joint }
}

choice! {
    /// The method in the loop.
    Method { Icp, Gicp, Fgr, Mac }
}

choice! {
    /// The kind of country.
    Scene { Structured, SemiStructured, Unstructured }
}

choice! {
    /// The air, and the light that there is.
    Condition {
        /// As by default: nothing in the air.
        Clear,
        /// Visibility 100 m.
        Fog,
        /// 25 mm an hour.
        Rain,
        /// A tenth of the power at the start, and no more in the search.
        TenthEnergy,
    }
}

/// One run of the study.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Cell {
    pub(crate) strategy: Strategy,
    pub(crate) protocol: Protocol,
    pub(crate) method: Method,
    pub(crate) scene: Scene,
    pub(crate) condition: Condition,
    pub(crate) seed: u64,
}

impl Cell {
    /// What `echoloop tune` is told. The towns are those of the seed alone.
    pub(super) fn arguments(&self) -> Vec<String> {
        let Self { strategy, protocol, method, scene, condition, seed } = self;
        let first = 100 * seed + 1;
        let towns = format!("scene.towns=[{first},{},{}]", first + 1, first + 2);
        let mut arguments = strategy.arguments();
        arguments.extend([
            format!("--protocol={protocol}"),
            format!("--method={method}"),
            format!("--scene={scene}"),
            format!("--seed={seed}"),
        ]);
        let mut sets = vec![towns, TEST_PAIRS.to_owned()];
        sets.extend(condition.sets().iter().map(|&set| set.to_owned()));
        arguments.extend(sets.into_iter().flat_map(|set| ["--set".to_owned(), set]));
        arguments
    }
}

impl Strategy {
    fn arguments(self) -> Vec<String> {
        let short = |generations| {
            let few = ["--set=tune.pairs_per_generation=1", "--set=tune.shortlist=1"];
            // Held to as many as leave the whole below a fifth.
            let check = "--set=data.check_pairs=24";
            ["--strategy=fast", "--objective=error", generations, few[0], few[1], check]
        };
        // The lowest error is asked for, so that what is compared is what was searched for.
        let arguments: &[&str] = match self {
            Self::Fast => &["--strategy=fast", "--objective=error"],
            Self::Short => &short("--generations=16"),
            Self::Warm => &short("--generations=14"),
            Self::Paper => &["--strategy=paper", "--objective=error"],
            Self::Thrift => &["--strategy=fast", "--minimise=energy", "--at-most-error=1.2x"],
        };
        arguments.iter().map(|&argument| argument.to_owned()).collect()
    }
}

impl Condition {
    fn sets(self) -> &'static [&'static str] {
        match self {
            Self::Clear => &[],
            Self::Fog => &["weather.kind=fog", "weather.visibility_m=100"],
            Self::Rain => &["weather.kind=rain", "weather.rate_mm_h=25"],
            Self::TenthEnergy => &["lidar.power=7.5", "emitter.energy_limit_nj=37.5"],
        }
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { strategy, protocol, method, scene, condition, seed } = self;
        write!(f, "{strategy} {protocol} {method} {scene} {condition} seed {seed}")
    }
}
