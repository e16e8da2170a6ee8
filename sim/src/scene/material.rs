//! Reflectance of surfaces at 905 nm.
//!
//! Diffuse reflectances are medians of measured samples: KLUM (Ilehag et al. 2019, facades and
//! roofs), SLUM (LUMA, Kotthaus et al. 2014), earthlib 1.1 (plants, soils, roads). A row without a
//! trustworthy source says so.

/// Reflectance of a surface: Lambert's law, with a mirror lobe for smooth ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Name, lower case.
    pub name: &'static str,
    /// Diffuse (hemispherical) reflectance at 905 nm, fraction; above 1 only for a retro-reflector.
    pub reflectance_905nm: f32,
    /// Fresnel reflectance at normal incidence of the smooth top coat, fraction; 0 = none.
    pub specular_f0: f32,
    /// Width α of the GGX lobe of that coat, (0, 1]; ignored without a coat.
    pub roughness: f32,
}

impl Material {
    const fn matt(name: &'static str, reflectance_905nm: f32) -> Self {
        Self { name, reflectance_905nm, specular_f0: 0.0, roughness: 1.0 }
    }

    const fn coated(self, specular_f0: f32, roughness: f32) -> Self {
        Self { specular_f0, roughness, ..self }
    }

    /// ρ of `ρ cosθ / π` for light that returns to its source.
    ///
    /// ```text
    /// ρ(θ) = ρ_d + π · F0 · D(θ) · G(θ) / (4 cos²θ),   D = α² / (π (cos²θ (α² − 1) + 1)²)
    /// ```
    ///
    /// The half vector is the view vector, so Fresnel stays at F0 and only the GGX lobe `D` and its
    /// shadowing `G` (separable Smith) depend on the angle (Walter et al. 2007).
    #[must_use]
    pub fn backscatter(&self, cos_incidence: f32) -> f32 {
        if self.specular_f0 <= 0.0 || cos_incidence <= 1e-3 {
            return self.reflectance_905nm;
        }
        let (a2, c2) = (self.roughness * self.roughness, cos_incidence * cos_incidence);
        let lobe = c2 * (a2 - 1.0) + 1.0;
        let smith = 2.0 / (1.0 + (1.0 + a2 * (1.0 / c2 - 1.0)).sqrt());
        let pi_d = a2 / (lobe * lobe);
        self.reflectance_905nm + self.specular_f0 * pi_d * smith * smith / (4.0 * c2)
    }
}

macro_rules! surfaces {
    ($($variant:ident = $material:expr;)*) => {
        /// Rows of [`MATERIALS`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        #[allow(missing_docs, reason = "named by the table below")]
        pub enum Surface { $($variant,)* }

        /// Every surface once; a mesh's material index is `Surface as u8`.
        pub const MATERIALS: &[Material] = &[$($material,)*];
    };
}

// Each row states low / median / high of its samples, or the source of its single value.
surfaces! {
    Asphalt = Material::matt("asphalt", 0.168);                    // .073 / .168 / .305
    // earthlib sidewalk, median of 60
    Paving = Material::matt("paving", 0.314);
    Concrete = Material::matt("concrete", 0.320);                  // .104 / .320 / .855
    Brick = Material::matt("brick", 0.450);                        // KLUM red brick facade
    Plaster = Material::matt("plaster", 0.643);                    // .399 / .643 / .757
    // KLUM weathered sandstone facade
    Stone = Material::matt("stone", 0.252);
    RoofTile = Material::matt("roof tile", 0.376);                 // KLUM red matte ceramic roof
    DarkTile = Material::matt("dark tile", 0.084);                 // KLUM dark matte ceramic roof
    Metal = Material::matt("metal", 0.210).coated(0.3, 0.4);       // .056 / .210 / .653; coat ours
    Wood = Material::matt("wood", 0.433);                          // .129 / .433 / .854
    // No trustworthy value: dust and two faces, ours
    Glass = Material::matt("glass", 0.05).coated(0.08, 0.05);
    Soil = Material::matt("soil", 0.364);                          // earthlib, median of 4185
    Gravel = Material::matt("gravel", 0.221);                      // earthlib bare gravel
    Rock = Material::matt("rock", 0.268);                          // KLUM grey conglomerate
    // earthlib canopy, median of 2000
    Grass = Material::matt("grass", 0.445);
    // Single leaf .42–.51; its transmission is not traced
    Leaf = Material::matt("leaf", 0.460);
    Bark = Material::matt("bark", 0.370);                          // earthlib, median of 33
    // No trustworthy value: painted metal, clear coat, ours
    CarPaint = Material::matt("car paint", 0.30).coated(0.04, 0.1);
    // No trustworthy value: black car, ours
    DarkPaint = Material::matt("dark paint", 0.06).coated(0.04, 0.1);
    Rubber = Material::matt("rubber", 0.05);                       // ours
    // ours: the upper end of the range the sensor must handle
    RetroSign = Material::matt("retro-reflective sign", 50.0);
    // Imported faces without a surface
    Unknown = Material::matt("unknown", 0.30);
    // Files of meshes contain the index of a row: new rows are added below.
    // earthlib paint, median of 76
    RoadPaint = Material::matt("road paint", 0.314);               // .137 / .314 / .513
    // earthlib litter, median of 35
    Litter = Material::matt("forest litter", 0.252);               // .187 / .252 / .511
    Sand = Material::matt("sand", 0.300);                          // earthlib, median of 39
    // Absorbs 7 /m at 905 nm; F0 of n = 1.328 (Hale and Querry 1973); ripples ours
    Water = Material::matt("water", 0.005).coated(0.02, 0.12);
}

impl Surface {
    /// Index of its row in [`MATERIALS`].
    #[must_use]
    pub const fn index(self) -> u8 {
        self as u8
    }

    /// Surface suggested by a free-form name, as in MTL files: "Wall_Brick.001" is brick.
    #[must_use]
    pub fn from_loose_name(name: &str) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        let hit = |(words, _): &&(&[&str], Self)| words.iter().any(|w| name.contains(w));
        LOOSE_NAMES.iter().find(hit).map(|(_, surface)| *surface)
    }
}

/// Words of free-form names. The first match wins, so specific words come before general ones.
const LOOSE_NAMES: &[(&[&str], Surface)] = &[
    (&["retro", "sign"], Surface::RetroSign),
    (&["marking", "road_paint", "roadpaint", "roadline"], Surface::RoadPaint),
    (&["water"], Surface::Water),
    (&["glass", "window", "windshield"], Surface::Glass),
    (&["rooftile", "roof_tile", "roof"], Surface::RoofTile),
    (&["asphalt", "road", "tarmac"], Surface::Asphalt),
    (&["sidewalk", "paving", "pavement", "curb", "kerb"], Surface::Paving),
    (&["concrete", "cement"], Surface::Concrete),
    (&["brick"], Surface::Brick),
    (&["plaster", "stucco", "wall", "facade"], Surface::Plaster),
    (&["bark", "trunk", "branch"], Surface::Bark),
    (&["leaf", "leaves", "foliage", "needle", "bush", "hedge"], Surface::Leaf),
    (&["grass", "lawn", "vegetation"], Surface::Grass),
    (&["wood", "door", "fence", "timber"], Surface::Wood),
    (&["gravel"], Surface::Gravel),
    (&["litter"], Surface::Litter),
    (&["rock", "stone"], Surface::Rock),
    (&["sand"], Surface::Sand),
    (&["soil", "dirt", "earth", "terrain", "ground"], Surface::Soil),
    (&["tire", "tyre", "wheel", "rubber"], Surface::Rubber),
    (&["car", "paint", "body"], Surface::CarPaint),
    (&["metal", "steel", "iron", "alumin", "pole"], Surface::Metal),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_surface_names_its_own_row() {
        assert_eq!(MATERIALS[usize::from(Surface::Asphalt.index())].name, "asphalt");
        assert_eq!(MATERIALS[usize::from(Surface::Bark.index())].name, "bark");
        assert_eq!(MATERIALS[usize::from(Surface::Unknown.index())].name, "unknown");
        assert_eq!(MATERIALS.len(), usize::from(Surface::Water.index()) + 1);
    }

    #[test]
    fn a_matt_surface_sends_back_the_same_at_every_angle() {
        let plaster = MATERIALS[usize::from(Surface::Plaster.index())];
        assert_eq!(plaster.backscatter(1.0), 0.643);
        assert_eq!(plaster.backscatter(0.1), 0.643);
    }

    #[test]
    fn glass_flashes_only_when_it_faces_the_sensor() {
        let glass = MATERIALS[usize::from(Surface::Glass.index())];
        assert!(glass.backscatter(1.0) > 5.0);
        assert!(glass.backscatter(0.9) < 0.06);
    }

    #[test]
    fn a_retro_reflector_sends_fifty_times_white_at_every_angle() {
        let sign = MATERIALS[usize::from(Surface::RetroSign.index())];
        for cos_incidence in [1.0, 0.7, 0.2] {
            assert_eq!(sign.backscatter(cos_incidence), 50.0);
        }
    }

    #[test]
    fn a_rougher_coat_flashes_less_and_over_a_wider_angle() {
        let coat = |roughness| Material::matt("coat", 0.1).coated(0.3, roughness);
        let (smooth, rough) = (coat(0.1), coat(0.4));
        // F0 / (4 α²) over the diffuse part, square to it: D = 1 / (π α²), G = 1.
        for (coat, flash) in [(smooth, 7.5), (rough, 0.46875)] {
            assert!((coat.backscatter(1.0) - 0.1 - flash).abs() < 1e-4, "{coat:?}");
        }
        assert!(smooth.backscatter(0.9) < rough.backscatter(0.9));
    }

    #[test]
    fn loose_names_find_their_surface() {
        assert_eq!(Surface::from_loose_name("Wall_Brick.001"), Some(Surface::Brick));
        assert_eq!(Surface::from_loose_name("Oak-LEAVES"), Some(Surface::Leaf));
        assert_eq!(Surface::from_loose_name("Material.007"), None);
    }
}
