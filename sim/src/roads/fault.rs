//! Reasons why a file is not a road network.

use std::path::PathBuf;

use thiserror::Error;

/// Fault of a road network, found before its file is named.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RoadFault {
    /// The file does not follow OpenDRIVE: the fault and its place.
    #[error("{0}")]
    Format(String),
    /// A road cannot be built.
    #[error("road {road}: {what}")]
    Road {
        /// The road's id.
        road: String,
        /// The fault, and what was expected.
        what: String,
    },
    /// The file has no road.
    #[error("it has no road")]
    NoRoads,
    /// The roads are longer than those of any place.
    #[error("it has {found_km:.0} km of road, more than {most_km:.0} km: cut out a part of it")]
    TooLong {
        /// Length of all its roads, km.
        found_km: f64,
        /// The limit, km.
        most_km: f64,
    },
    /// The network reaches farther than a place may.
    #[error(
        "road {road} reaches {reach_m:.0} m from the origin, more than {most_m:.0} m: is its \
         origin near?"
    )]
    TooFar {
        /// The road's id.
        road: String,
        /// Largest absolute coordinate, metres.
        reach_m: f64,
        /// The limit, metres.
        most_m: f64,
    },
}

impl RoadFault {
    pub(super) fn of(road: &str, what: impl Into<String>) -> Self {
        Self::Road { road: echoloop_files::one_line(road), what: what.into() }
    }
}

/// Reason why a file is not a road network.
#[derive(Debug, Error)]
pub enum RoadsError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is no road network that can be built.
    #[error("{} is not an OpenDRIVE road network: {fault}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault.
        fault: RoadFault,
    },
}
