//! Weather: the `[weather]` section, and the optical constants that follow from it.

use echoloop_parameters::{Bounds, Case, Range, Refused, choice, section};
use serde::{Deserialize, Serialize};

choice! {
    /// Kind of weather.
    pub enum Precipitation by default None {
        /// Clear air.
        None = "none",
        /// Droplets, always a continuous medium.
        Fog = "fog",
        /// Drops.
        Rain = "rain",
        /// Dry flakes.
        Snow = "snow",
        /// Wet flakes.
        WetSnow = "wet-snow",
    }
}

section! {
    /// The weather between the sensor and the scene. Off unless `kind` is given.
    ///
    /// It weakens every echo by `e^(−2αR)` and adds light of its own: a continuous return, and near
    /// the sensor, in rain and snow, single drops and flakes that look like small targets.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [weather]")]
    pub struct Weather in "weather" {
        kind: Precipitation, "", Precipitation::BOUNDS,
            "Kind of weather: `none`, `fog`, `rain`, `snow` (dry) or `wet-snow`.";
        visibility_m: f64, "m", Bounds::Cases(&[Case { when: FOG, range: Range::new(6.0, 998.0) }]),
            "MOR, meteorological optical range of fog, m: 6 to 998 are α 0.5 to 0.003 /m.";
        rate_mm_h: f64, "mm/h", Bounds::Cases(&[
            Case { when: RAIN, range: Range::new(0.1, 200.0) },
            Case { when: SNOW, range: Range::new(0.1, 50.0) },
        ]),
            "Rate of rain or snow, mm of water an hour.";
    }
}

const FOG: &str = "in fog";
const RAIN: &str = "in rain";
const SNOW: &str = "in snow";

impl Default for Weather {
    fn default() -> Self {
        Self { kind: Precipitation::None, visibility_m: 200.0, rate_mm_h: 10.0 }
    }
}

/// Optical constants of the weather.
///
/// | | α, 1/m | number density n, 1/m³ | α/β, sr |
/// |---|---|---|---|
/// | fog | ln 20 / MOR | – | 65.1, so that β = 0.046 / MOR |
/// | rain | 1.076·R^0.67 dB/km | 1951·R^0.21 | 18.8 |
/// | snow, dry | (5.42e-5·λ + 5.4958776)·R^1.38 dB/km | 1092·R^−0.49 | 25 |
/// | snow, wet | (1.023e-4·λ + 3.7855466)·R^0.72 dB/km | 1092·R^−0.49 | 25 |
///
/// λ in nm, R in mm/h. Sources: fog, Rasshofer, Spies and Spies 2011 (β) and Koschmieder (5 %
/// contrast); extinction of rain and snow, Rec. ITU-R P.1814 (rain after Carbonneau and Wisely
/// 1998); numbers from exponential sizes, N0/Λ of Marshall and Palmer 1948 (8000, 4.1·R^−0.21 /mm)
/// and Sekhon and Srivastava 1970 (2500·R^−0.94, 2.29·R^−0.45 /mm); α/β of water, O'Connor et al.
/// 2004, measured for droplets and used for rain as well; α/β of ice, our choice, in the middle of
/// the 20–30 reported for cirrus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// α, extinction, 1/m.
    pub extinction_per_m: f64,
    /// β, backscatter, 1/(m·sr).
    pub backscatter_per_m_sr: f64,
    /// n, density of drops or flakes that are met one by one near the sensor, 1/m³; 0 in fog.
    pub particles_per_m3: f64,
}

impl Air {
    /// Clear air.
    pub const CLEAR: Self =
        Self { extinction_per_m: 0.0, backscatter_per_m_sr: 0.0, particles_per_m3: 0.0 };

    /// Lidar ratio α/β, sr.
    pub fn lidar_ratio_sr(&self) -> f64 {
        self.extinction_per_m / self.backscatter_per_m_sr
    }
}

/// Extinction of 1 dB/km, 1/m.
const PER_M_OF_DB_PER_KM: f64 = std::f64::consts::LN_10 / 1e4;
/// α/β of water drops, sr.
const WATER_SR: f64 = 18.8;
/// α/β of flakes, sr.
const ICE_SR: f64 = 25.0;

impl Weather {
    /// Optical constants at a wavelength.
    pub fn air(&self, wavelength_nm: f64) -> Air {
        let rate = self.rate_mm_h;
        let power = |scale: f64, exponent: f64| scale * libm::pow(rate, exponent);
        let flakes = || power(2_500.0 / 2.29, 0.45 - 0.94);
        let (db_per_km, particles_per_m3, ratio_sr) = match self.kind {
            Precipitation::None => return Air::CLEAR,
            Precipitation::Fog => return fog(self.visibility_m),
            Precipitation::Rain => (power(1.076, 0.67), power(8_000.0 / 4.1, 0.21), WATER_SR),
            Precipitation::Snow => {
                (power(5.42e-5 * wavelength_nm + 5.495_877_6, 1.38), flakes(), ICE_SR)
            }
            Precipitation::WetSnow => {
                (power(1.023e-4 * wavelength_nm + 3.785_546_6, 0.72), flakes(), ICE_SR)
            }
        };
        let extinction_per_m = db_per_km * PER_M_OF_DB_PER_KM;
        Air {
            extinction_per_m,
            backscatter_per_m_sr: extinction_per_m / ratio_sr,
            particles_per_m3,
        }
    }

    /// Checks the keys that this kind of weather uses.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key that is out of bounds.
    pub fn check(&self) -> Result<(), Refused> {
        let [_, visibility, rate] = Self::KEYS else { return Ok(()) };
        match self.kind {
            Precipitation::None => Ok(()),
            Precipitation::Fog => visibility.check_in(FOG, self.visibility_m),
            Precipitation::Rain => rate.check_in(RAIN, self.rate_mm_h),
            Precipitation::Snow | Precipitation::WetSnow => rate.check_in(SNOW, self.rate_mm_h),
        }
    }
}

fn fog(visibility_m: f64) -> Air {
    Air {
        extinction_per_m: libm::log(20.0) / visibility_m,
        backscatter_per_m_sr: 0.046 / visibility_m,
        particles_per_m3: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air(kind: Precipitation, value: f64) -> Air {
        Weather { kind, visibility_m: value, rate_mm_h: value }.air(905.0)
    }

    #[test]
    fn fog_dims_to_five_percent_over_its_visibility() {
        for visibility_m in [6.0, 50.0, 200.0, 998.0] {
            let fog = air(Precipitation::Fog, visibility_m);
            assert!(((-fog.extinction_per_m * visibility_m).exp() - 0.05).abs() < 1e-12);
            assert!((0.003..=0.5).contains(&fog.extinction_per_m), "{fog:?}");
            assert!((fog.lidar_ratio_sr() - 65.1).abs() < 0.1);
        }
    }

    #[test]
    fn rain_and_snow_dim_as_the_recommendation_says() {
        // Computed by hand from the table, dB/km.
        for (kind, rate, db_per_km) in [
            (Precipitation::Rain, 10.0, 5.033),
            (Precipitation::Rain, 50.0, 14.80),
            (Precipitation::Snow, 1.0, 5.545),
            (Precipitation::Snow, 5.0, 51.11),
            (Precipitation::WetSnow, 5.0, 12.36),
        ] {
            let got = air(kind, rate).extinction_per_m * 1e4 / std::f64::consts::LN_10;
            assert!((got / db_per_km - 1.0).abs() < 2e-3, "{kind:?} {rate}: {got}");
        }
    }

    #[test]
    fn mean_drops_have_the_size_of_raindrops() {
        // The mean extinction cross-section is twice the mean shadow.
        for rate in [1.0, 10.0, 50.0] {
            let rain = air(Precipitation::Rain, rate);
            let shadow_m2 = rain.extinction_per_m / rain.particles_per_m3 / 2.0;
            let diameter_mm = 1e3 * (4.0 * shadow_m2 / std::f64::consts::PI).sqrt();
            assert!((0.2..1.5).contains(&diameter_mm), "{rate} mm/h: {diameter_mm} mm");
        }
    }

    #[test]
    fn a_value_out_of_bounds_is_refused_only_in_weather_that_uses_it() {
        let refusal = |weather: Weather| weather.check().map_err(|fault| fault.to_string());
        let fog = Weather { kind: Precipitation::Fog, visibility_m: 1.0, rate_mm_h: -1.0 };
        assert_eq!(refusal(fog), Err("weather.visibility_m = 1 must be 6 to 998 in fog".into()));
        let rain = Weather { kind: Precipitation::Rain, ..fog };
        assert_eq!(refusal(rain), Err("weather.rate_mm_h = -1 must be 0.1 to 200 in rain".into()));
        let snow = Weather { kind: Precipitation::WetSnow, rate_mm_h: 50.1, ..fog };
        assert_eq!(refusal(snow), Err("weather.rate_mm_h = 50.1 must be 0.1 to 50 in snow".into()));
        assert!(refusal(Weather { rate_mm_h: f64::NAN, ..rain }).is_err());
        assert_eq!(refusal(Weather { kind: Precipitation::None, ..fog }), Ok(()));
        assert_eq!(refusal(Weather::default()), Ok(()));
    }
}
