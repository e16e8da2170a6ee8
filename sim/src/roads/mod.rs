//! Road networks: OpenDRIVE files, as CARLA and its editors write them, become lanes.
//!
//! 1. [`load_network`] reads a file, [`parse_network`] its bytes, into a [`RoadNetwork`].
//! 2. [`RoadNetwork::lanes`] has the surface of every lane, [`RoadNetwork::waypoints`] places at
//!    equal distances along the driving lanes, [`RoadNetwork::topology`] the links between lanes.
//! 3. [`draw_network`] generates a network from a seed as OpenDRIVE text, which the same reader and
//!    CARLA read.
//!
//! Coordinates are OpenDRIVE's: metres, z up, right-handed. CARLA's are left-handed: there y is
//! negative, and an angle about z too.
//!
//! The crate `xodr` reads lanes, links, signs and objects. It gives no headings, so they are
//! computed here from the records of the file, and it does not write OpenDRIVE, so the text is
//! written here. Its sines are the platform's: the last of the 24 bits of a point may differ
//! between machines, and points are therefore rounded to a quarter of a millimetre. A point within
//! that last bit of a rounding boundary may still differ.

mod continuity;
mod fault;
mod network;
mod opendrive_records;
mod opendrive_writer;
mod profile;
mod street_plan;
mod waypoint;

pub use fault::RoadsError;
pub use network::{Lane, LaneKind, Prop, RoadNetwork, Sign, SignKind, load_network, parse_network};
pub use opendrive_writer::draw_network;
pub use street_plan::NetworkStyle;
pub use waypoint::Waypoint;

#[cfg(test)]
mod tests;
