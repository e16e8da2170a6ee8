//! The keys that the sections declare: all but those of `[lidar]` and the settings of
//! `[registration]`, which have tables of their own.

use echoloop_frontend::{Receiver, Weather};
use echoloop_parameters::{Bounds, Kind, Parameter};

use super::registration::OWN_KEYS;
use super::tune::WARM_STARTS;
use super::{
    Budget, DataConfig, DetectorConfig, EmitterConfig, FrontConfig, Motion, ScannerConfig,
    SceneConfig, TuneConfig, Weights,
};

const RUN: &[Parameter] = &[Parameter {
    key: "seed",
    unit: "",
    kind: Kind::Whole,
    bounds: Bounds::SEED,
    help: "Decides every random choice.",
}];

/// Section with a key for each parameter of a search.
const AXES: Parameter = Parameter {
    key: "tune.axes",
    unit: "",
    kind: Kind::Text,
    bounds: Bounds::Words(
        "of a parameter, as lidar.power: fixed, free, or bounds as 1..100 or 1..100,log",
    ),
    help: "Which parameters are searched, and how far, where that is not as usual.",
};

const OF_PARAMETERS: &[Parameter] = &[AXES, WARM_STARTS];

/// The keys of the sections, in the order of the file.
pub fn keys() -> impl Iterator<Item = &'static Parameter> {
    let sections = [
        RUN,
        SceneConfig::KEYS,
        ScannerConfig::KEYS,
        EmitterConfig::KEYS,
        Budget::KEYS,
        DetectorConfig::KEYS,
        DataConfig::KEYS,
        OWN_KEYS,
        TuneConfig::KEYS,
        Weights::KEYS,
        OF_PARAMETERS,
        FrontConfig::KEYS,
        Receiver::KEYS,
        Weather::KEYS,
        Motion::KEYS,
    ];
    sections.into_iter().flatten()
}

/// The key of a section with that name.
pub fn key(name: &str) -> Option<&'static Parameter> {
    keys().find(|key| key.key == name)
}
