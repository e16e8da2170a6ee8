//! Camera of a picture: its position, directions and field of view.

use std::array::from_fn;

use crate::scene::Scene;
use crate::vector::dot;

/// Azimuth of the camera from the middle of the scene, radians: south-south-west.
pub const YAW_RAD: f64 = -2.05;
/// Elevation of the camera from the middle of the scene, radians.
pub const PITCH_RAD: f64 = 0.62;

/// Tangent of half the vertical field of view: 40° in all, so that verticals stay nearly vertical.
const HALF_FIELD_TAN: f64 = 0.364;

/// Camera distance as a fraction of the distance that shows the whole box: its corners are mostly
/// empty.
const DISTANCE_FACTOR: f64 = 0.9;

/// Corners of the box that pictures and pages show first, metres: the area of the viewpoints,
/// clipped to the mesh, over the height of the mesh.
#[must_use]
pub fn view_box(scene: &Scene) -> ([f32; 3], [f32; 3]) {
    let (bottom, top) = scene.mesh.bounds().unwrap_or(([0.0; 3], [0.0; 3]));
    let (low, high) = scene.area;
    let low = [low[0].max(bottom[0]), low[1].max(bottom[1]), bottom[2]];
    let high = [high[0].min(top[0]), high[1].min(top[1]), top[2]];
    // An area beside the mesh would show nothing, so the whole mesh is shown.
    if (0..2).any(|i| low[i] > high[i]) { (bottom, top) } else { (low, high) }
}

/// Position and orientation of a camera.
pub(super) struct Camera {
    /// Position, metres.
    pub(super) at: [f32; 3],
    /// Unit vectors: right, up, and away from the subject.
    right: [f64; 3],
    up: [f64; 3],
    back: [f64; 3],
    /// Width over height of the picture.
    aspect: f64,
    /// Distance from the middle of the box, metres.
    pub(super) distance_m: f64,
}

impl Camera {
    /// Camera at the distance at which a box fills the picture.
    pub(super) fn beside((low, high): ([f32; 3], [f32; 3]), aspect: f64) -> Self {
        let (cy, sy) = (libm::cos(YAW_RAD), libm::sin(YAW_RAD));
        let (cp, sp) = (libm::cos(PITCH_RAD), libm::sin(PITCH_RAD));
        let (right, up, back) = ([-sy, cy, 0.0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]);
        let half: [f64; 3] = from_fn(|i| 0.5 * (f64::from(high[i]) - f64::from(low[i])));
        let needed = (0..8).map(|corner: usize| {
            let corner = from_fn(|i| if corner >> i & 1 == 1 { half[i] } else { -half[i] });
            let across = dot(corner, right).abs() / (HALF_FIELD_TAN * aspect);
            across.max(dot(corner, up).abs() / HALF_FIELD_TAN) + dot(corner, back)
        });
        let distance_m = (DISTANCE_FACTOR * needed.fold(0.0, f64::max)).max(1.0);
        let middle: [f64; 3] = from_fn(|i| f64::midpoint(low[i].into(), high[i].into()));
        let at = from_fn(|i| (middle[i] + distance_m * back[i]) as f32);
        Self { at, right, up, back, aspect, distance_m }
    }

    /// Direction through a point of the picture: fractions of its width from the left, of its
    /// height from the top.
    pub(super) fn direction(&self, [x, y]: [f64; 2]) -> [f32; 3] {
        let across = HALF_FIELD_TAN * self.aspect * (2.0 * x - 1.0);
        let upward = HALF_FIELD_TAN * (1.0 - 2.0 * y);
        let way = from_fn(|i| across * self.right[i] + upward * self.up[i] - self.back[i]);
        let length = dot(way, way).sqrt();
        way.map(|part| (part / length) as f32)
    }

    /// Direction to a point given relative to the camera: to its right, vertically above, behind.
    pub(super) fn towards(&self, [right, above, behind]: [f64; 3]) -> [f32; 3] {
        let mut way: [f64; 3] = from_fn(|i| right * self.right[i] + behind * self.back[i]);
        way[2] += above;
        let length = dot(way, way).sqrt();
        way.map(|part| (part / length) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn the_middle_of_the_picture_is_the_middle_of_the_box_and_all_of_it_is_in_front() {
        let (low, high) = ([-30.0, 10.0, -1.0], [50.0, 60.0, 20.0]);
        let camera = Camera::beside((low, high), 1.6);
        let ahead = camera.direction([0.5, 0.5]);
        let middle: [f32; 3] = from_fn(|i| {
            camera.at[i] + ahead[i] * camera.distance_m as f32 - 0.5 * (low[i] + high[i])
        });
        assert!(middle.iter().all(|part| part.abs() < 1e-3), "{middle:?}");
        assert!(camera.at[2] > high[2], "above");
        assert!(dot([0, 1, 2].map(|i| f64::from(camera.at[i])), camera.back) > 0.0);
    }

    #[test]
    fn the_view_box_is_the_area_clipped_to_the_mesh() {
        let mesh = Mesh {
            vertices: vec![[-10.0, -10.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 5.0]],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
        };
        let scene = |area| Scene::new("three points", mesh.clone(), area);
        let inside = view_box(&scene(([-4.0, -40.0], [4.0, 40.0])));
        assert_eq!(inside, ([-4.0, -10.0, 0.0], [4.0, 10.0, 5.0]));
        let beside = view_box(&scene(([20.0, 20.0], [30.0, 30.0])));
        assert_eq!(beside, ([-10.0, -10.0, 0.0], [10.0, 10.0, 5.0]));
    }
}
