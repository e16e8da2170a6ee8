//! Light that comes over a mirror: a pane of glass, or a wet street.

use crate::raycast::{Hit, Raycaster};
use crate::scanner::backscattered;
use crate::scene::{Material, Surface};

/// Greatest width of the lobe of a mirror: through a rougher surface no image is seen.
const SMOOTH: f32 = 0.1;

/// Fresnel reflectance of water at normal incidence, ((n − 1)/(n + 1))² of n = 1.33.
const WATER_F0: f32 = 0.02;

/// Share of the light from below that the surface of water reflects back: 1 − (1 − 0.066)/n², with
/// 0.066 the reflectance for diffuse light from above.
const BACK_DOWN: f32 = 0.472;

impl Material {
    /// True of a surface that shows an image.
    pub(crate) fn is_mirror(&self) -> bool {
        self.specular_f0 > 0.0 && self.roughness <= SMOOTH
    }

    /// Share of the light that a mirror passes on: F = F0 + (1 − F0)(1 − cosθ)⁵ (Schlick 1994).
    pub fn mirrored(&self, cos_incidence: f32) -> f32 {
        self.specular_f0 + (1.0 - self.specular_f0) * (1.0 - cos_incidence).powi(5)
    }

    /// The same surface under a film of water, which is smooth: darker, since light that is
    /// scattered within it is reflected back down and has another chance to be absorbed.
    ///
    /// ```text
    /// a' = (1 − F0) a / (1 − p (1 − a))     a = 1 − ρ, absorptance; p: [`BACK_DOWN`]
    /// ```
    ///
    /// Lekner and Dorf, Applied Optics 27 (1988), after Ångström (1925).
    #[must_use]
    pub fn wet(self) -> Self {
        let absorbed = 1.0 - self.reflectance_905nm;
        let passed = 1.0 - WATER_F0;
        let absorbed = passed * absorbed / (1.0 - BACK_DOWN * (1.0 - absorbed));
        Self {
            reflectance_905nm: (passed - absorbed).max(0.0),
            specular_f0: WATER_F0,
            roughness: 0.05,
            ..self
        }
    }
}

/// Wets what streets are made of.
pub fn wet_streets(materials: &mut [Material]) {
    for surface in [Surface::Asphalt, Surface::Paving] {
        if let Some(material) = materials.get_mut(usize::from(surface.index())) {
            *material = material.wet();
        }
    }
}

/// Range and strength (per m² at the sensor) of what a sub-ray sees in a mirror that it hits: the
/// image lies behind the mirror.
///
/// ```text
/// R = R₁ + R₂                            to the mirror, and on to the surface
/// s = F(θ₁)² ρ cosθ₂ / (π R²)            there and back over the mirror
/// ```
pub(crate) fn image(
    caster: &Raycaster,
    materials: &[Material],
    (origin, ray): ([f32; 3], [f32; 3]),
    hit: &Hit,
) -> Option<(f32, f32)> {
    let mirror = materials.get(usize::from(hit.material)).filter(|m| m.is_mirror())?;
    let (from, way) = caster.mirrored(origin, ray)?;
    let seen = caster.cast(from, way)?;
    let range_m = hit.range_m + seen.range_m;
    let material = materials.get(usize::from(seen.material))?;
    let passed = mirror.mirrored(hit.cos_incidence).powi(2);
    Some((range_m, passed * backscattered(material, seen.cos_incidence, range_m)))
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use nalgebra::Isometry3;

    use super::*;
    use crate::scanner::{BeamOptics, scan};
    use crate::scene::{MATERIALS, Mesh};

    /// A square of ± 4 m about a point, between two directions.
    fn square(mesh: &mut Mesh, at: [f32; 3], sides: [[f32; 3]; 2], surface: Surface) {
        let n = mesh.vertices.len() as u32;
        for (a, b) in [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)] {
            mesh.vertices.push([0, 1, 2].map(|i| at[i] + a * sides[0][i] + b * sides[1][i]));
        }
        mesh.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        mesh.materials.extend([surface.index(); 2]);
    }

    const ACROSS: f32 = std::f32::consts::FRAC_1_SQRT_2;

    /// A pane ten metres ahead, turned by 45°, and a wall six metres beside it.
    fn pane(surface: Surface) -> Raycaster {
        let mut mesh = Mesh::default();
        let up = [0.0, 0.0, 1.0];
        square(&mut mesh, [10.0, 0.0, 0.0], [[ACROSS, ACROSS, 0.0], up], surface);
        square(&mut mesh, [10.0, 6.0, 0.0], [[1.0, 0.0, 0.0], up], Surface::Plaster);
        Raycaster::from_mesh(&mesh)
    }

    fn look(caster: &Raycaster, mirrors: bool) -> Vec<(f32, f32)> {
        let optics = BeamOptics { mirrors, divergence_mrad: [0.1; 2], ..BeamOptics::default() };
        let pose = Isometry3::identity();
        let seen = scan(caster, MATERIALS, &pose, &[[1.0, 0.0, 0.0]], &optics);
        seen.of(0).iter().map(|of| (of.range_m, of.strength_per_m2)).collect()
    }

    #[test]
    fn a_wall_is_seen_in_a_pane_behind_it_and_over_the_way_there() {
        let [_, (range_m, strength)] = look(&pane(Surface::Glass), true)[..] else {
            panic!("the pane and an image")
        };
        // F of glass at 45°, twice; the wall faces the light.
        let fresnel = 0.08 + 0.92 * (1.0 - ACROSS).powi(5);
        let expected = fresnel * fresnel * 0.643 / PI / 256.0;
        assert!((range_m - 16.0).abs() < 0.01, "{range_m} m");
        assert!((strength / expected - 1.0).abs() < 0.01, "{strength} for {expected}");
    }

    #[test]
    fn without_mirrors_and_in_rough_surfaces_there_is_no_image() {
        assert_eq!(look(&pane(Surface::Glass), false).len(), 1);
        assert_eq!(look(&pane(Surface::Metal), true).len(), 1);
        assert_eq!(look(&pane(Surface::Plaster), true).len(), 1);
    }

    #[test]
    fn a_wet_street_is_darker_and_a_mirror_at_grazing_incidence() {
        let dry = MATERIALS[usize::from(Surface::Asphalt.index())];
        let wet = dry.wet();
        let share = wet.reflectance_905nm / dry.reflectance_905nm;
        assert!((0.5..0.65).contains(&share), "{share}");
        assert!(!dry.is_mirror() && wet.is_mirror());
        assert!(wet.mirrored(1.0) < 0.021 && wet.mirrored(0.1) > 0.55);
    }
}
