//! Plan of the table, and the values that it alone lists.

use std::sync::LazyLock;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use echoloop_campaign::{Cell, Choice, Plan};
use echoloop_closed_loop::config::preset::Preset;
use serde::{Deserialize, Serialize};

/// Plan of the table.
pub(super) static PLAN: LazyLock<Plan> = LazyLock::new(|| Plan::read(include_str!("plan.toml")));

/// Axes whose values are listed by the plan alone.
const AXES: [&str; 4] = ["ablation", "by_hand", "method", "scene"];

/// A value of one of these axes: its index in the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Value<const AXIS: usize>(pub(super) usize);

/// The one thing that is switched in a cell of the second table.
pub type Ablation = Value<0>;
/// A case tuned by hand.
pub type ByHand = Value<1>;
/// A method of the table.
pub type TableMethod = Value<2>;
/// A kind of country.
pub type Scene = Value<3>;

impl<const AXIS: usize> Value<AXIS> {
    /// As many values as an axis may have.
    const ALL: &'static [Self] = &{
        let mut all = [Self(0); 32];
        let mut index = 0;
        while index < all.len() {
            all[index] = Self(index);
            index += 1;
        }
        all
    };

    /// The value of a name.
    pub fn named(name: &str) -> Option<Self> {
        PLAN.names(AXES[AXIS]).position(|value| value == name).map(Self)
    }

    /// Name in the table.
    pub fn title(self) -> &'static str {
        self.choice().title()
    }

    /// What the plan has of it.
    pub fn choice(self) -> &'static Choice {
        &PLAN.values(AXES[AXIS])[self.0]
    }
}

impl ByHand {
    /// Method of all cases: ICP, the plan's first.
    pub const METHOD: TableMethod = Value(0);

    /// Settings of the case with some ranges, over the defaults.
    pub(super) fn settings(self, ranges: Preset) -> Vec<String> {
        let (case, lengths) = (name_of(self), format!("lengths-{}", name_of(ranges)));
        PLAN.settings(&Cell::default().with("by_hand", &case).with(&lengths, &case))
    }
}

impl Scene {
    /// The next kind; after the last the first.
    pub fn next(self) -> Self {
        let all = Self::value_variants();
        all[(self.0 + 1) % all.len()]
    }
}

impl<const AXIS: usize> ValueEnum for Value<AXIS> {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL[..PLAN.values(AXES[AXIS]).len()]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(self.choice().possible())
    }
}

impl<const AXIS: usize> TryFrom<String> for Value<AXIS> {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::named(&name).ok_or_else(|| format!("no {} is named {name:?}", AXES[AXIS]))
    }
}

impl<const AXIS: usize> From<Value<AXIS>> for String {
    fn from(value: Value<AXIS>) -> Self {
        value.choice().name.clone()
    }
}

/// Name of a choice on the command line and in files.
pub fn name_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// The values, each once, in the order of their first occurrence.
pub(super) fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}
