//! Choices by name: their types read no other names than the keys say.

use echoloop_parameters::Value;

use crate::config::preset::{ErrorMean, LidarPreset, Objective, Preset, Protocol, Strategy};
use crate::cost::CostKind;

/// The costs of a scan.
pub(super) const COSTS: [&str; 4] = ["energy", "instructions", "bits", "seconds"];

impl Value for CostKind {}
impl Value for ErrorMean {}
impl Value for LidarPreset {}
impl Value for Objective {}
impl Value for Preset {}
impl Value for Protocol {}
impl Value for Strategy {}
