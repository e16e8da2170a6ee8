//! Still pictures of a scene by ray casting: no graphics card, no browser, the same bytes on every
//! machine.
//!
//! Colours are those of [`colour`], not measurements; the strength of echoes at 905 nm is
//! [`crate::scene::Material::backscatter`].

mod camera;
mod colour;
mod shading;

use rayon::prelude::*;

use crate::raycast::Raycaster;
use crate::scene::Scene;

use camera::Camera;
pub use camera::{PITCH_RAD, YAW_RAD, view_box};
pub use colour::colour;
use shading::{Shader, encoded, mean};

/// Pixels whose rays are cast as one packet: close rays are cast faster.
const PACKET_PIXELS: usize = 4;

/// Positions of the four rays within a pixel, fractions of its side. In this rotated grid no two
/// rays share a row or a column, so nearly horizontal or vertical edges get four steps.
const SAMPLES: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

/// Pixels of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Row by row from the top, left to right: red, green, blue in sRGB.
    pub pixels: Vec<[u8; 3]>,
}

/// Draws the box of [`view_box`] from above and beside, four rays a pixel, with sun, sky and
/// shadows.
#[must_use]
pub fn draw(scene: &Scene, caster: &Raycaster, [width, height]: [usize; 2]) -> Picture {
    let camera = Camera::beside(view_box(scene), width.max(1) as f64 / height.max(1) as f64);
    let shader = Shader::new(scene, caster, &camera);
    let row = |row: usize| {
        let across: Vec<usize> = (0..width).collect();
        let pixels = across.chunks(PACKET_PIXELS).flat_map(|together| {
            let directions = directions(&camera, together, row, [width, height]);
            let colours = shader.along(&directions);
            colours.chunks(SAMPLES.len()).map(|rays| encoded(mean(rays))).collect::<Vec<_>>()
        });
        pixels.collect::<Vec<_>>()
    };
    let pixels = (0..height).into_par_iter().flat_map_iter(row).collect();
    Picture { width, height, pixels }
}

/// Directions of the rays of some pixels of a row, four each.
fn directions(camera: &Camera, columns: &[usize], row: usize, size: [usize; 2]) -> Vec<[f32; 3]> {
    let of = |column: usize| {
        SAMPLES.map(|[x, y]| {
            let share = |at: usize, within: f64, of: usize| (at as f64 + within) / of as f64;
            camera.direction([share(column, x, size[0]), share(row, y, size[1])])
        })
    };
    columns.iter().flat_map(|&column| of(column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mesh, Surface};

    /// A lawn 40 m wide with a brick cube of 8 m in its middle.
    fn lawn() -> Scene {
        let mut mesh = Mesh::default();
        let mut quad = |corners: [[f32; 3]; 4], surface: Surface| {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(corners);
            mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| first + i)));
            mesh.materials.extend([surface.index(); 2]);
        };
        let level = |h: f32, z: f32| [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]];
        quad(level(20.0, 0.0), Surface::Grass);
        quad(level(4.0, 8.0), Surface::Brick);
        for [ax, ay, bx, by] in [[-1, -1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [-1, 1, -1, -1]] {
            let [ax, ay, bx, by] = [ax, ay, bx, by].map(|side: i8| 4.0 * f32::from(side));
            quad([[ax, ay, 0.0], [bx, by, 0.0], [bx, by, 8.0], [ax, ay, 8.0]], Surface::Brick);
        }
        let area = ([-20.0; 2], [20.0; 2]);
        Scene::new("lawn", mesh, area)
    }

    fn drawn(size: [usize; 2]) -> Picture {
        let scene = lawn();
        draw(&scene, &Raycaster::new(&scene), size)
    }

    /// Largest of red, green and blue.
    fn hue([r, g, b]: [u8; 3]) -> char {
        match (r.max(b) < g, r > b) {
            (true, _) => 'g',
            (false, true) => 'r',
            (false, false) => 'b',
        }
    }

    #[test]
    fn a_brick_cube_on_a_lawn_is_red_on_green_below_a_blue_sky() {
        let Picture { width, height, pixels } = drawn([120, 75]);
        let at = |x: f64, y: f64| {
            hue(pixels[(y * height as f64) as usize * width + (x * width as f64) as usize])
        };
        assert_eq!([at(0.5, 0.45), at(0.5, 0.8), at(0.02, 0.02)], ['r', 'g', 'b']);
        let count = |of: char| pixels.iter().filter(|&&pixel| hue(pixel) == of).count();
        let share = count('g') as f64 / pixels.len() as f64;
        assert!((0.2..0.7).contains(&share), "{share} of the picture is lawn");
    }

    #[test]
    fn the_three_visible_faces_of_the_cube_differ_in_shade_and_it_casts_a_shadow() {
        let pixels = drawn([240, 150]).pixels;
        let shades_of = |of: char| {
            let mut seen = std::collections::BTreeMap::new();
            pixels
                .iter()
                .filter(|&&p| hue(p) == of)
                .for_each(|&p| *seen.entry(p).or_insert(0) += 1);
            // Haze shades a face by distance: shades within 12 of each other count as one.
            let mut shades: Vec<u8> = Vec::new();
            for (pixel, count) in seen {
                let level = pixel.into_iter().max().unwrap_or_default();
                if count > 3 && shades.iter().all(|shade| shade.abs_diff(level) > 12) {
                    shades.push(level);
                }
            }
            shades.len()
        };
        assert!(shades_of('r') >= 3, "{} shades of brick", shades_of('r'));
        assert!(shades_of('g') >= 2, "{} shades of lawn", shades_of('g'));
    }

    #[test]
    fn a_picture_is_the_same_bytes_on_one_thread_and_on_three() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| drawn([64, 40]))
        };
        assert!(on(1) == on(3));
    }

    #[test]
    fn a_picture_of_no_pixels_is_empty_and_one_pixel_is_the_cube() {
        assert_eq!(drawn([0, 10]).pixels, Vec::<[u8; 3]>::new());
        assert_eq!(drawn([1, 1]).pixels.len(), 1);
    }
}
