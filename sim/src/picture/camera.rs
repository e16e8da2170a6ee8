//! Where a picture is taken from.

use std::array::from_fn;

use crate::scene::Scene;

/// Azimuth of the eye as seen from the scene's middle: from south-south-west, radians.
pub const YAW_RAD: f64 = -2.05;
/// How high it stands there, radians above the horizon.
pub const PITCH_RAD: f64 = 0.62;

/// Half the angle from the lower edge of a picture to the upper one, as a tangent: 40 degrees in
/// all, so that uprights stay nearly upright.
const HALF_FIELD: f64 = 0.364;

/// The box that has to be seen may reach so far beyond the picture: its corners are mostly empty.
const CLOSER: f64 = 0.9;

/// Smallest and largest corner of what a picture or a page shows first, metres: the area where
/// viewpoints lie, as far as the mesh reaches there, and as high as the mesh.
#[must_use]
pub fn shown_box(scene: &Scene) -> ([f32; 3], [f32; 3]) {
    let (bottom, top) = scene.mesh.bounds().unwrap_or(([0.0; 3], [0.0; 3]));
    let (low, high) = scene.area;
    let low = [low[0].max(bottom[0]), low[1].max(bottom[1]), bottom[2]];
    let high = [high[0].min(top[0]), high[1].min(top[1]), top[2]];
    // An area beside the mesh shows nothing: then all of it.
    if (0..2).any(|i| low[i] > high[i]) { (bottom, top) } else { (low, high) }
}

/// An eye, and what it sees of the world.
pub(super) struct Eye {
    /// Where it is, metres.
    pub(super) at: [f32; 3],
    /// Unit vectors: to the right, up, and away from what it looks at.
    right: [f64; 3],
    up: [f64; 3],
    back: [f64; 3],
    /// Width over height of the picture.
    aspect: f64,
    /// From the eye to the middle of what is shown, metres.
    pub(super) distance_m: f64,
}

impl Eye {
    /// So far from a box that it fills the picture.
    pub(super) fn beside((low, high): ([f32; 3], [f32; 3]), aspect: f64) -> Self {
        let (cy, sy) = (libm::cos(YAW_RAD), libm::sin(YAW_RAD));
        let (cp, sp) = (libm::cos(PITCH_RAD), libm::sin(PITCH_RAD));
        let (right, up, back) = ([-sy, cy, 0.0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]);
        let half: [f64; 3] = from_fn(|i| 0.5 * (f64::from(high[i]) - f64::from(low[i])));
        let needed = (0..8).map(|corner: usize| {
            let corner = from_fn(|i| if corner >> i & 1 == 1 { half[i] } else { -half[i] });
            let across = dot(corner, right).abs() / (HALF_FIELD * aspect);
            across.max(dot(corner, up).abs() / HALF_FIELD) + dot(corner, back)
        });
        let distance_m = (CLOSER * needed.fold(0.0, f64::max)).max(1.0);
        let middle: [f64; 3] = from_fn(|i| f64::midpoint(low[i].into(), high[i].into()));
        let at = from_fn(|i| (middle[i] + distance_m * back[i]) as f32);
        Self { at, right, up, back, aspect, distance_m }
    }

    /// Through a place of the picture: shares of its width from the left, of its height from the
    /// top.
    pub(super) fn direction(&self, [x, y]: [f64; 2]) -> [f32; 3] {
        let across = HALF_FIELD * self.aspect * (2.0 * x - 1.0);
        let upward = HALF_FIELD * (1.0 - 2.0 * y);
        let way = from_fn(|i| across * self.right[i] + upward * self.up[i] - self.back[i]);
        let length = dot(way, way).sqrt();
        way.map(|part| (part / length) as f32)
    }

    /// To what lies so far to the right of the eye, above it in the world, and behind it.
    pub(super) fn towards(&self, [right, above, behind]: [f64; 3]) -> [f32; 3] {
        let mut way: [f64; 3] = from_fn(|i| right * self.right[i] + behind * self.back[i]);
        way[2] += above;
        let length = dot(way, way).sqrt();
        way.map(|part| (part / length) as f32)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn the_middle_of_the_picture_is_the_middle_of_the_box_and_all_of_it_is_in_front() {
        let (low, high) = ([-30.0, 10.0, -1.0], [50.0, 60.0, 20.0]);
        let eye = Eye::beside((low, high), 1.6);
        let ahead = eye.direction([0.5, 0.5]);
        let middle: [f32; 3] =
            from_fn(|i| eye.at[i] + ahead[i] * eye.distance_m as f32 - 0.5 * (low[i] + high[i]));
        assert!(middle.iter().all(|part| part.abs() < 1e-3), "{middle:?}");
        assert!(eye.at[2] > high[2], "above");
        assert!(dot([0, 1, 2].map(|i| f64::from(eye.at[i])), eye.back) > 0.0);
    }

    #[test]
    fn what_is_shown_is_the_area_as_far_as_the_mesh_reaches() {
        let mesh = Mesh {
            vertices: vec![[-10.0, -10.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 5.0]],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
        };
        let scene = |area| Scene::new("three points", mesh.clone(), area);
        let inside = shown_box(&scene(([-4.0, -40.0], [4.0, 40.0])));
        assert_eq!(inside, ([-4.0, -10.0, 0.0], [4.0, 10.0, 5.0]));
        let beside = shown_box(&scene(([20.0, 20.0], [30.0, 30.0])));
        assert_eq!(beside, ([-10.0, -10.0, 0.0], [10.0, 10.0, 5.0]));
    }
}
