//! Towns on road networks: roads, the ground between them, houses along them, furniture and
//! traffic.

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
use layout::TownLayout;

pub(crate) use layout::Dressing;

/// Box of the viewpoints: smallest and largest (x, y), metres.
pub(crate) type Area = ([f32; 2], [f32; 2]);

/// Mesh of a town, and the vehicles that move in it.
#[derive(Debug, PartialEq)]
pub(crate) struct BuiltTown {
    pub(crate) mesh: Mesh,
    pub(crate) area: Area,
    pub(crate) movers: Vec<Mover>,
}

/// Builds a town: the same bytes for the same network, dressing and seed.
pub(crate) fn build(network: &RoadNetwork, dressing: Dressing, seed: u64) -> BuiltTown {
    let mut b = Builder::default();
    let mut rng = Generator::new(seed, 50 + dressing as u64);
    let mut layout = TownLayout::new(network, dressing, seed);
    surface::build(&mut b, network, &layout.raster);
    layout.ground.build(&mut b, |at| layout.surface(at));
    let plants = match dressing {
        Dressing::Quarter => quarter::build(&mut b, &mut layout, &mut rng),
        Dressing::Suburb => suburb::build(&mut b, &mut layout, &mut rng),
    };
    let movers = traffic::build(&mut b, &mut layout, network, &mut rng);
    layout.plant(&mut b, plants, &mut rng);
    let (low, high) = network.bounds();
    let area = (low.map(|x| x as f32), high.map(|x| x as f32));
    BuiltTown { mesh: b.mesh, area, movers }
}

#[cfg(test)]
mod tests;
