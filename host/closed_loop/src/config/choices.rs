//! Choices by name as values of flags.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use echoloop_parameters::Value;

use crate::config::preset::{
    ErrorMean, LidarPreset, Objective, Preset, Protocol, Sampler, Strategy,
};
use crate::cost::CostKind;
use crate::prepared::PairSet;

/// The costs of a scan.
pub(super) const COSTS: [&str; 4] = ["energy", "instructions", "bits", "seconds"];

impl Value for CostKind {}

macro_rules! flag_values {
    ($($choice:ty),*) => {$(
        impl ValueEnum for $choice {
            fn value_variants<'a>() -> &'a [Self] {
                &Self::ALL
            }

            fn to_possible_value(&self) -> Option<PossibleValue> {
                Some(PossibleValue::new(self.name()).help(self.summary()))
            }
        }
    )*};
}

flag_values!(ErrorMean, LidarPreset, Objective, PairSet, Preset, Protocol, Sampler, Strategy);
