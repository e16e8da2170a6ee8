//! Shading of rays: sun, sky, shadows and haze.

use std::array::from_fn;

use super::camera::Camera;
use super::colour::colour;
use crate::raycast::{Hit, Raycaster};
use crate::scene::{Mesh, Scene};
use crate::vector::{cross, dot, mix, sub};

/// Red, green and blue in linear light.
pub(super) type Linear = [f32; 3];

/// Light of the sun on a surface facing it, of the sky on one facing up, of the ground on one
/// facing down; about 1 in all on a level lawn.
const SUN: Linear = [0.78, 0.74, 0.66];
const SKY: Linear = [0.36, 0.40, 0.46];
const GROUND: Linear = [0.19, 0.18, 0.16];

/// Colours of the sky at the horizon and at the zenith, linear.
const HORIZON: Linear = [0.78, 0.84, 0.90];
const ZENITH: Linear = [0.40, 0.58, 0.82];

/// Share of its colour that a surface at the distance of the subject loses to haze.
const HAZE: f32 = 0.04;

/// Shades the rays of a camera in a scene.
pub(super) struct Shader<'a> {
    mesh: &'a Mesh,
    caster: &'a Raycaster,
    /// Colours of the materials.
    colours: Vec<Linear>,
    from: [f32; 3],
    distance_m: f32,
    /// Direction to the sun, unit.
    sun: [f32; 3],
}

impl<'a> Shader<'a> {
    pub(super) fn new(scene: &'a Scene, caster: &'a Raycaster, camera: &Camera) -> Self {
        let linear = |code: u8| decoded(f32::from(code) / 255.0);
        Self {
            mesh: &scene.mesh,
            caster,
            colours: scene.materials.iter().map(|m| colour(m.name).map(linear)).collect(),
            from: camera.at,
            distance_m: camera.distance_m as f32,
            // From behind the left shoulder, so that the three faces of a box differ.
            sun: camera.towards([-0.85, 0.95, 0.35]),
        }
    }

    /// Light along each of some rays from the camera.
    pub(super) fn along(&self, directions: &[[f32; 3]]) -> Vec<Linear> {
        let hits = self.caster.cast_beam(self.from, directions);
        let light = |(hit, &direction): (Option<Hit>, &[f32; 3])| match hit {
            Some(hit) => self.of_surface(&hit, direction),
            None => sky(direction),
        };
        hits.into_iter().zip(directions).map(light).collect()
    }

    fn of_surface(&self, hit: &Hit, direction: [f32; 3]) -> Linear {
        let normal = facing(self.mesh.corners(hit.triangle as usize), direction);
        let towards_sun = dot(normal, self.sun).max(0.0);
        // Start off the surface, by more than f32 rounds, so that it casts no shadow on itself.
        let off_m = 1e-3 + 1e-5 * hit.range_m;
        let at = from_fn(|i| self.from[i] + hit.range_m * direction[i] + off_m * normal[i]);
        let is_lit = towards_sun > 0.0 && self.caster.cast(at, self.sun).is_none();
        let (sun, up) = (if is_lit { towards_sun } else { 0.0 }, 0.5 + 0.5 * normal[2]);
        let own = self.colours[usize::from(hit.material)];
        let seen: Linear =
            from_fn(|i| own[i] * (sun * SUN[i] + up * SKY[i] + (1.0 - up) * GROUND[i]));
        let haze = (HAZE * hit.range_m / self.distance_m).min(1.0);
        mix(seen, HORIZON, haze)
    }
}

/// Unit normal of a triangle on the side a ray comes from; up for a triangle without area.
fn facing([a, b, c]: [[f32; 3]; 3], direction: [f32; 3]) -> [f32; 3] {
    let normal = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    if length == 0.0 {
        return [0.0, 0.0, 1.0];
    }
    let side = if dot(normal, direction) > 0.0 { -1.0 } else { 1.0 };
    normal.map(|part| side * part / length)
}

/// Colour of the sky: `HORIZON`'s from 30° below the horizon, `ZENITH`'s from 30° above it.
fn sky(direction: [f32; 3]) -> Linear {
    let height = (0.5 + direction[2]).clamp(0.0, 1.0);
    mix(HORIZON, ZENITH, height)
}

/// Mean of some colours.
pub(super) fn mean(colours: &[Linear]) -> Linear {
    let share = 1.0 / colours.len().max(1) as f32;
    from_fn(|i| share * colours.iter().map(|colour| colour[i]).sum::<f32>())
}

/// Linear light of an sRGB level, both as fractions of 1 (IEC 61966-2-1).
fn decoded(level: f32) -> f32 {
    if level <= 0.04045 { level / 12.92 } else { libm::powf((level + 0.055) / 1.055, 2.4) }
}

/// sRGB codes of linear light, clipped at white.
pub(super) fn encoded(light: Linear) -> [u8; 3] {
    light.map(|light| {
        let light = light.clamp(0.0, 1.0);
        let level = match light <= 0.003_130_8 {
            true => 12.92 * light,
            false => 1.055 * libm::powf(light, 1.0 / 2.4) - 0.055,
        };
        (255.0 * level).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_srgb_comes_back_from_linear_light() {
        for code in 0..=255_u8 {
            let light = decoded(f32::from(code) / 255.0);
            assert_eq!(encoded([light; 3]), [code; 3]);
        }
    }

    #[test]
    fn a_normal_faces_the_camera_for_either_winding() {
        let (a, b, c) = ([0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
        let down = [0.6, 0.0, -0.8];
        assert_eq!(facing([a, b, c], down), [0.0, 0.0, 1.0]);
        assert_eq!(facing([a, c, b], down), [0.0, 0.0, 1.0]);
        assert_eq!(facing([a, b, c], [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0]);
        assert_eq!(facing([a, a, c], down), [0.0, 0.0, 1.0], "a line has no side");
    }
}
