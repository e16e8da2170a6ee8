//! Towns on road networks: roads, the ground between them, houses along them, what stands and
//! drives there.

mod cover_raster;
mod ground;
mod layout;
mod quarter;
mod road_edge;
mod suburb;
mod surface;
mod traffic;

use super::Mover;
use super::mesh::Mesh;
use super::parts::Builder;
use crate::roads::RoadNetwork;
use echoloop_random::Generator;
use layout::Place;

pub(crate) use layout::Dress;

/// Viewpoints may lie where a place goes: smallest and largest (x, y), metres.
pub(crate) type Area = ([f32; 2], [f32; 2]);

/// A town that is built.
#[derive(Debug, PartialEq)]
pub(crate) struct Built {
    pub(crate) mesh: Mesh,
    pub(crate) area: Area,
    pub(crate) movers: Vec<Mover>,
}

/// Builds a town: the same bytes for the same network, dress and seed.
pub(crate) fn build(network: &RoadNetwork, dress: Dress, seed: u64) -> Built {
    let mut b = Builder::default();
    let mut rng = Generator::new(seed, 50 + dress as u64);
    let mut place = Place::new(network, dress, seed);
    surface::build(&mut b, network, &place.site);
    place.ground.build(&mut b, |at| place.surface(at));
    let plants = match dress {
        Dress::Quarter => quarter::build(&mut b, &mut place, &mut rng),
        Dress::Suburb => suburb::build(&mut b, &mut place, &mut rng),
    };
    let movers = traffic::build(&mut b, &mut place, network, &mut rng);
    place.plant(&mut b, plants, &mut rng);
    let (low, high) = network.bounds();
    let area = (low.map(|x| x as f32), high.map(|x| x as f32));
    Built { mesh: b.finish(), area, movers }
}

#[cfg(test)]
mod tests;
