//! The world around the sensor: scenes, ray casting, the scanner.
//!
//! ```
//! use echoloop_sim::raycast::Raycaster;
//! use echoloop_sim::scanner::{self, BeamOptics};
//! use echoloop_sim::scene::{MATERIALS, Mesh, Surface};
//! use nalgebra::Isometry3;
//!
//! // A wall of brick, 10 m ahead; metres, x forward, y left, z up.
//! let wall = Mesh {
//!     vertices: vec![[10.0, -9.0, -9.0], [10.0, 9.0, -9.0], [10.0, 0.0, 9.0]],
//!     triangles: vec![[0, 1, 2]],
//!     materials: vec![Surface::Brick.index()],
//! };
//! let caster = Raycaster::from_mesh(&wall);
//! let (pose, ahead) = (Isometry3::identity(), [[1.0, 0.0, 0.0]]);
//! let response = scanner::scan(&caster, MATERIALS, &pose, &ahead, &BeamOptics::default());
//! assert!((response.of(0)[0].range_m - 10.0).abs() < 1e-3);
//! ```
//!
//! 1. [`scene::generate`] generates a place, [`import::load_scene`] reads one: triangles with
//!    materials.
//! 2. [`viewpoint::sample_pairs`] finds pairs of poses in it that a surveyor could scan from.
//! 3. [`scanner::scan`] traces every beam from a pose. The returns depend on the place,
//!    and not on the settings of the sensor.
//! 4. [`picture::draw`] draws a picture of a scene.

pub mod ideal;
pub mod import;
pub mod mirror;
pub mod other_lidar;
pub mod picture;
pub mod raycast;
pub mod roads;
pub mod scanner;
pub mod scene;
pub mod stray_light;
mod vector;
pub mod viewpoint;
