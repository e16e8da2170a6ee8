//! Rosette of two prisms, which does not repeat from scan to scan.

use core::f32::consts::{PI, TAU};
use core::{f64, fmt};

/// Rosette: two prisms turn against each other, and each bends the beam by its angle. After Liu,
/// Wang, Zhang (Livox), "Low-Cost Retina-Like Robotic Lidars Based on Incommensurable Scanning",
/// IEEE/ASME Trans. Mechatronics 27, 2022.
///
/// ```text
/// k = scan · beams + beam + ½        φᵢ = 2π · rotorᵢ/60 · k/rate
/// v = Σ bendᵢ · (cos φᵢ, sin φᵢ)     the beam leaves at |v| from x, towards v in y and z
/// ```
///
/// The curve goes on from scan to scan. It is exact to first order in the bends: rays are not
/// traced through the glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rosette {
    /// Number of beams of a scan.
    pub beams: u32,
    /// Number of beams a second, along the curve.
    pub rate_hz: u32,
    /// Speed of each prism, rpm; counter-clockwise seen from behind is positive.
    pub rotors_rpm: [i32; 2],
    /// Angle that each prism bends the beam by, 0.01°.
    pub bends_cdeg: [u16; 2],
}

impl Rosette {
    /// Livox Mid-40: 38.4° across, prisms at 7294 and −4664 rpm, 100,000 beams a second, scans of
    /// 0.1 s. Its curve closes after 30 s, 300 scans.
    pub const MID_40: Self =
        Self { beams: 10_000, rate_hz: 100_000, rotors_rpm: [7294, -4664], bends_cdeg: [960, 960] };

    /// Turns of a prism up to a beam, modulo 1, exact: numerator and denominator.
    ///
    /// `rpm · (2 · (scan · beams + beam) + 1) / (120 · rate)`.
    pub fn turn(&self, rotor_rpm: i32, scan: u32, beam: u32) -> [i64; 2] {
        let whole = i64::from(self.rate_hz.max(1)).saturating_mul(120);
        let before = i64::from(scan).saturating_mul(self.beams.into());
        // Saturates after 2⁶³ half beams, which no program reaches.
        let halves = before.saturating_add(beam.into()).saturating_mul(2).saturating_add(1);
        let halves = halves.checked_rem_euclid(whole).unwrap_or(0);
        let turns = halves.saturating_mul(rotor_rpm.into());
        [turns.checked_rem_euclid(whole).unwrap_or(0), whole]
    }

    /// Unit vector of a beam of a scan. In f32, within 10⁻⁶ of the exact one.
    pub fn direction(&self, scan: u32, beam: u32) -> [f32; 3] {
        let [first, second] = self.rotors_rpm.map(|rpm| self.turn(rpm, scan, beam));
        let [a, b] = self.bends_cdeg.map(|bend| f32::from(bend) * (PI / 18_000.0));
        let ([a_y, a_z], [b_y, b_z]) = (arm(a, first), arm(b, second));
        let [y, z] = [a_y + b_y, a_z + b_z];
        let off = libm::sqrtf(y * y + z * z);
        // sin(off)/off, which rounds to 1 in f32 below this.
        let side = if off > 1e-4 { libm::sinf(off) / off } else { 1.0 };
        [libm::cosf(off), y * side, z * side]
    }

    /// Unit vector of a beam of a scan, by its definition.
    pub fn exact_direction(&self, scan: u32, beam: u32) -> [f64; 3] {
        let k = f64::from(scan) * f64::from(self.beams) + f64::from(beam) + 0.5;
        let seconds = k / f64::from(self.rate_hz);
        let arm = |rpm: i32, bend_cdeg: u16| {
            let (sin, cos) = libm::sincos(f64::consts::TAU * (f64::from(rpm) / 60.0 * seconds));
            [cos, sin].map(|part| part * (f64::from(bend_cdeg) * (f64::consts::PI / 18_000.0)))
        };
        let ([first, second], [a, b]) = (self.rotors_rpm, self.bends_cdeg);
        let ([a_y, a_z], [b_y, b_z]) = (arm(first, a), arm(second, b));
        let [y, z] = [a_y + b_y, a_z + b_z];
        let off = libm::sqrt(y * y + z * z);
        let side = if off > 1e-9 { libm::sin(off) / off } else { 1.0 };
        [libm::cos(off), y * side, z * side]
    }

    /// Time that the beams of a scan take, s.
    pub fn duration_s(&self) -> f64 {
        f64::from(self.beams) / f64::from(self.rate_hz.max(1))
    }
}

impl fmt::Display for Rosette {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { beams, rate_hz, rotors_rpm: [a, b], bends_cdeg: [c, d] } = self;
        write!(f, "{beams} of a rosette ({rate_hz} Hz, {a} and {b} rpm, {c} and {d} × 0.01°)")
    }
}

fn arm(bend_rad: f32, [part, whole]: [i64; 2]) -> [f32; 2] {
    let (sin, cos) = libm::sincosf(TAU * (part as f32 / whole as f32));
    [cos * bend_rad, sin * bend_rad]
}
