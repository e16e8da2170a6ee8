//! `[detector]`: the program that finds the echoes.

use echoloop_parameters::section;
use serde::{Deserialize, Serialize};

use echoloop_sensors::sensor::Detector;

section! {
    /// Program that finds the echoes.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [detector]")]
    pub struct DetectorConfig in "detector" {
        kind: Detector, "", Detector::BOUNDS,
            "`firmware`: the sensor's program, in integers. `ideal`: maximum likelihood in \
             floating point, as no sensor could, to hold the program to; in process alone.";
    }
}
