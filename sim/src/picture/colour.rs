//! Colours of materials.

/// Colour of a material in pictures and pages, sRGB: close to its appearance, and distinct from the
/// others.
///
/// A name outside the table gets a colour derived from the name.
#[must_use]
pub fn colour(material: &str) -> [u8; 3] {
    let listed = COLOURS.iter().find(|(name, _)| *name == material);
    listed.map_or_else(|| colour_from_name(material), |(_, colour)| *colour)
}

#[rustfmt::skip]
const COLOURS: [(&str, [u8; 3]); 26] = [
    ("asphalt", [92, 97, 105]),
    ("paving", [168, 163, 153]),
    ("concrete", [196, 196, 192]),
    ("brick", [188, 120, 94]),
    ("plaster", [238, 223, 192]),
    ("stone", [160, 142, 118]),
    ("roof tile", [164, 72, 56]),
    ("dark tile", [70, 68, 88]),
    ("metal", [132, 150, 168]),
    ("wood", [174, 130, 82]),
    ("glass", [112, 182, 216]),
    ("soil", [128, 104, 80]),
    ("gravel", [188, 174, 142]),
    ("rock", [122, 118, 110]),
    ("grass", [136, 168, 98]),
    ("leaf", [66, 122, 62]),
    ("bark", [98, 70, 50]),
    ("car paint", [62, 104, 184]),
    ("dark paint", [44, 48, 78]),
    ("rubber", [30, 30, 30]),
    ("retro-reflective sign", [255, 208, 40]),
    ("unknown", [190, 166, 206]),
    ("road paint", [250, 250, 246]),
    ("forest litter", [150, 106, 70]),
    ("sand", [224, 198, 140]),
    ("water", [48, 106, 140]),
];

/// Colour from the name alone. Channels lie between 70 and 229: neither black nor white.
fn colour_from_name(name: &str) -> [u8; 3] {
    // FNV-1a with a final mix: the hashes of similar names differ only in their lowest bits.
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mixed = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    [40, 24, 8].map(|shift| 70 + (mixed >> shift & 0xff) as u8 % 160)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MATERIALS;

    #[test]
    fn no_two_materials_look_alike() {
        for (i, one) in MATERIALS.iter().enumerate() {
            for other in &MATERIALS[..i] {
                let (a, b) = (colour(one.name), colour(other.name));
                let apart: i32 =
                    a.iter().zip(b).map(|(x, y)| (i32::from(*x) - i32::from(y)).pow(2)).sum();
                assert!(apart > 20 * 20, "{} and {}: {a:?}, {b:?}", one.name, other.name);
            }
        }
    }

    #[test]
    fn a_name_outside_the_table_has_a_colour_of_its_own() {
        assert_eq!(colour("moss"), colour("moss"));
        assert_ne!(colour("moss"), colour("mosses"));
        assert!(colour("moss").iter().all(|channel| (70..230).contains(channel)));
    }
}
