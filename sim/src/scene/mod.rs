//! Scenes to scan: generated from a seed, or imported.

mod landscape;
mod material;
mod mesh;
mod mover;
mod named_towns;
mod parts;
mod semi_structured;
mod structured;
mod town;
mod unstructured;
pub(crate) mod value_noise;

use std::fmt;

pub use material::{MATERIALS, Material, Surface};
pub use mesh::{Mesh, MeshFault};
pub use mover::{Mover, Placement};
pub use named_towns::{Town, TownError, build_town, load_town};

/// Surfaces to scan, and the places of viewpoints among them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name in reports, as "structured-7".
    pub name: String,
    /// Its surfaces.
    pub mesh: Mesh,
    /// Materials by the mesh's indices.
    pub materials: Vec<Material>,
    /// Box of the viewpoints: smallest and largest (x, y), metres.
    pub area: ([f32; 2], [f32; 2]),
    /// Places on roads with the heading of the traffic: viewpoints lie there, or anywhere if there
    /// are none.
    pub roads: Vec<Placement>,
    /// Vehicles that move between the scans of a pair.
    pub movers: Vec<Mover>,
}

/// The three environments of the paper (Sec. 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SceneKind {
    /// Town streets: facades, kerbs, poles, parked cars, street trees.
    Structured,
    /// Suburb: detached houses, gardens, hedges, fences, trees.
    SemiStructured,
    /// Open country: rough terrain, trees, bushes, rocks, no walls.
    Unstructured,
}

impl SceneKind {
    /// All three, in the paper's order.
    pub const ALL: [Self; 3] = [Self::Structured, Self::SemiStructured, Self::Unstructured];

    /// Kind by its name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Name on the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Structured => "structured",
            Self::SemiStructured => "semi-structured",
            Self::Unstructured => "unstructured",
        }
    }
}

impl fmt::Display for SceneKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Generates the scene of a kind and a seed: the same bytes on every machine.
#[must_use]
pub fn generate(kind: SceneKind, seed: u64) -> Scene {
    let (mesh, half_m) = match kind {
        SceneKind::Structured => structured::generate(seed),
        SceneKind::SemiStructured => semi_structured::generate(seed),
        SceneKind::Unstructured => unstructured::generate(seed),
    };
    Scene::new(format!("{kind}-{seed}"), mesh, ([-half_m; 2], [half_m; 2]))
}

impl Scene {
    /// Scene with the materials of [`MATERIALS`], without roads and moving vehicles.
    #[must_use]
    pub fn new(name: impl Into<String>, mesh: Mesh, area: ([f32; 2], [f32; 2])) -> Self {
        let (name, materials) = (name.into(), MATERIALS.to_vec());
        Self { name, mesh, materials, area, roads: Vec::new(), movers: Vec::new() }
    }

    /// Surfaces some seconds later; `None` when nothing moves.
    #[must_use]
    pub fn mesh_after(&self, seconds: f64) -> Option<Mesh> {
        if self.movers.is_empty() || seconds <= 0.0 {
            return None;
        }
        let mut mesh = self.mesh.clone();
        self.movers.iter().for_each(|mover| mover.drive(&mut mesh, seconds));
        Some(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::mesh::fingerprint;
    use super::*;

    #[test]
    fn every_kind_has_detail_and_sound_triangles() {
        for kind in SceneKind::ALL {
            for seed in 0..6 {
                let scene = generate(kind, seed);
                let count = scene.mesh.triangles.len();
                assert!((200_000..600_000).contains(&count), "{}: {count}", scene.name);
                scene.mesh.check(scene.materials.len(), 500.0).expect(&scene.name);
            }
        }
    }

    #[test]
    fn degenerate_triangles_are_rare() {
        for kind in SceneKind::ALL {
            let mesh = generate(kind, 2).mesh;
            let flat = (0..mesh.triangles.len()).filter(|&t| mesh.area_m2(t) < 1e-9).count();
            assert!(flat * 200 < mesh.triangles.len(), "{kind}: {flat}");
        }
    }

    #[test]
    fn one_seed_gives_one_scene_and_another_seed_another() {
        for kind in SceneKind::ALL {
            assert_eq!(generate(kind, 5), generate(kind, 5));
            assert_ne!(generate(kind, 5).mesh, generate(kind, 6).mesh);
        }
    }

    #[test]
    fn scenes_are_the_same_bytes_on_every_machine_and_in_every_version() {
        let found = SceneKind::ALL.map(|kind| fingerprint(&generate(kind, 7).mesh));
        let pinned =
            [2_747_900_346_176_746_774, 2_749_714_668_916_916_956, 6_692_073_433_266_969_364];
        assert_eq!(found, pinned);
    }

    #[test]
    fn only_unstructured_scenes_have_no_walls() {
        let walls = [Surface::Plaster, Surface::Brick, Surface::Glass, Surface::Concrete]
            .map(Surface::index);
        for kind in SceneKind::ALL {
            let mesh = generate(kind, 3).mesh;
            let has_walls = mesh.materials.iter().any(|m| walls.contains(m));
            assert_eq!(has_walls, kind != SceneKind::Unstructured, "{kind}");
        }
    }

    #[test]
    fn kinds_are_read_as_they_are_written() {
        for kind in SceneKind::ALL {
            assert_eq!(SceneKind::named(&kind.to_string()), Some(kind));
        }
        assert_eq!(SceneKind::named("urban"), None);
    }

    #[test]
    fn the_vertices_of_a_vehicle_move_with_it_and_all_others_stay() {
        let at = |x: f64, y: f64, heading_rad| Placement { at: [x, y, 0.5], heading_rad };
        let quarter = std::f64::consts::FRAC_PI_2;
        let way = vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(2.0, 1.0, quarter)];
        let mover = Mover { vertices: 1..2, speed_m_s: 2.0, way };
        let vertices = vec![[7.0; 3], [1.0, 0.0, 1.0], [8.0; 3]];
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2]], materials: vec![0] };
        let area = ([0.0; 2], [1.0; 2]);
        let still = Scene::new("one", mesh, area);
        assert_eq!(still.mesh_after(9.0), None);
        let scene = Scene { movers: vec![mover], ..still };
        assert_eq!(scene.mesh_after(0.0), None);
        let later = scene.mesh_after(9.0).expect("it moved");
        assert_eq!((later.vertices[0], later.vertices[2]), ([7.0; 3], [8.0; 3]));
        // The vertex is 1 m ahead of the middle and 0.5 m above; the middle has moved to (2, 1).
        let off =
            [2.0, 2.0, 1.0].iter().zip(later.vertices[1]).map(|(a, b): (&f32, f32)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6, "{:?}", later.vertices[1]);
    }
}
