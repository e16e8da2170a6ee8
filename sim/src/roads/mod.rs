//! Road networks: OpenDRIVE files, as CARLA and its editors write them, become lanes.
//!
//! 1. [`load_network`] reads a file, [`parse_network`] its bytes, into a [`RoadNetwork`].
//! 2. [`RoadNetwork::lanes`] has the surface of every lane, [`RoadNetwork::waypoints`] places every
//!    so many metres, [`RoadNetwork::topology`] which lane leads into which.
//!
//! 3. [`draw_network`] draws a network of ours from a seed, as OpenDRIVE text: it is read back by
//!    the same reader, and by CARLA.
//!
//! Coordinates are OpenDRIVE's: metres, z up, right-handed. CARLA's are left-handed: there y is
//! negative, and an angle about z too.
//!
//! The crate `xodr` reads lanes, links, signs and objects. It gives points of 32 bits and no
//! headings, so headings come from the file's own records, exactly. Its sines are the platform's: a
//! point may differ in the last of its 24 bits between machines, and is therefore rounded to a
//! quarter of a millimetre. What lies within a last bit of a half step would still differ.

mod continuity;
mod fault;
mod network;
mod opendrive_records;
mod opendrive_writer;
mod profile;
mod street_plan;
mod waypoint;

pub use fault::{RoadFault, RoadsError};
pub use network::{Lane, LaneKind, Prop, RoadNetwork, Sign, SignKind, load_network, parse_network};
pub use opendrive_writer::draw_network;
pub use street_plan::NetworkStyle;
pub use waypoint::Waypoint;

#[cfg(test)]
mod tests;
