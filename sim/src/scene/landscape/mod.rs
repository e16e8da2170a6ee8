//! Landscapes: a forest on hills, a rocky valley, the shore of a lake.

mod forest;
mod lake;
mod planting;
mod valley;

use super::mesh::Mesh;
use super::parts::Builder;
use echoloop_random::Generator;
use planting::{HALF_M, Planting};

/// Kind of a landscape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Landscape {
    /// Woods and clearings on hills, a track through them.
    Forest,
    /// A gravel bed between steep, stepped slopes; boulders, few trees.
    Valley,
    /// A lake with a beach, reeds and trees along it.
    Lake,
}

/// Distance of viewpoints from the edge, metres.
const RIM_M: f64 = 16.0;

/// Builds a landscape; returns its mesh and the box of viewpoints.
pub(crate) fn build(landscape: Landscape, seed: u64) -> (Mesh, ([f32; 2], [f32; 2])) {
    let mut rng = Generator::new(seed, 60 + landscape as u64);
    let mut b = Builder::default();
    let mut planting = Planting::new(seed);
    let reach = HALF_M - RIM_M;
    let (low, mut high) = ([-reach; 2], [reach; 2]);
    match landscape {
        Landscape::Forest => forest::build(&mut b, &mut planting, seed, &mut rng),
        Landscape::Valley => valley::build(&mut b, &mut planting, seed, &mut rng),
        // No viewpoint lies on the water.
        Landscape::Lake => high[0] = lake::build(&mut b, &mut planting, seed, &mut rng),
    }
    (b.mesh, (low.map(|x| x as f32), high.map(|x| x as f32)))
}

#[cfg(test)]
mod tests {
    use super::super::material::Surface;
    use super::*;

    const ALL: [Landscape; 3] = [Landscape::Forest, Landscape::Valley, Landscape::Lake];

    #[test]
    fn landscapes_are_sound_and_differ_in_their_surfaces() {
        for landscape in ALL {
            let (mesh, _) = build(landscape, 1);
            mesh.check(super::super::MATERIALS.len(), 500.0).expect("sound");
            let count = mesh.triangles.len();
            assert!((300_000..2_000_000).contains(&count), "{landscape:?}: {count}");
            let area = |surface: Surface| {
                let of = |t: &usize| mesh.materials[*t] == surface.index();
                (0..count).filter(of).map(|t| mesh.area_m2(t)).sum::<f64>()
            };
            let [water, gravel, litter] =
                [Surface::Water, Surface::Gravel, Surface::Litter].map(area);
            match landscape {
                Landscape::Forest => assert!(litter > 20_000.0 && water == 0.0, "{litter}"),
                Landscape::Valley => assert!(gravel > 3_000.0 && litter == 0.0, "{gravel}"),
                Landscape::Lake => assert!(water > 10_000.0, "{water}"),
            }
        }
    }

    #[test]
    fn a_seed_gives_one_landscape_and_another_seed_another() {
        assert_eq!(build(Landscape::Valley, 2), build(Landscape::Valley, 2));
        assert_ne!(build(Landscape::Valley, 2).0, build(Landscape::Valley, 3).0);
    }
}
