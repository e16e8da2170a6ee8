//! Houses and trees of towns and suburbs with random proportions.

use super::house::{House, Roof};
use super::plants::{Broadleaf, conifer};
use super::{Builder, Point, Surface};
use echoloop_random::Generator;

/// Terraced house.
pub(crate) fn town_house(width_m: f64, depth_m: f64, rng: &mut Generator) -> House {
    let pitch = rng.range(0.5, 0.9);
    House {
        width_m,
        depth_m,
        floors: 2 + rng.index(4),
        floor_m: rng.range(2.9, 3.5),
        bay_m: rng.range(2.2, 3.2),
        roof: if rng.chance(0.6) { Roof::Gable(pitch) } else { Roof::Flat },
        wall: rng.pick(&[
            Surface::Plaster,
            Surface::Plaster,
            Surface::Brick,
            Surface::Stone,
            Surface::Concrete,
        ]),
        roof_surface: rng.pick(&[Surface::RoofTile, Surface::RoofTile, Surface::DarkTile]),
        open: [true, rng.chance(0.3), true, rng.chance(0.3)],
        balconies: rng.chance(0.35),
        shop: rng.chance(0.35),
    }
}

/// Shed behind a house.
pub(crate) fn shed(rng: &mut Generator) -> House {
    House {
        width_m: rng.range(3.0, 4.5),
        depth_m: rng.range(2.4, 3.2),
        floors: 1,
        floor_m: 2.4,
        bay_m: 3.0,
        roof: Roof::Gable(rng.range(0.3, 0.6)),
        wall: rng.pick(&[Surface::Wood, Surface::Concrete]),
        roof_surface: Surface::DarkTile,
        open: [true, false, false, true],
        balconies: false,
        shop: false,
    }
}

/// Detached house on a plot of a given width, metres.
pub(crate) fn cottage(plot_width: f64, rng: &mut Generator) -> House {
    let pitch = rng.range(0.55, 1.0);
    House {
        width_m: rng.range(8.5, plot_width - 8.0),
        depth_m: rng.range(7.0, 9.5),
        floors: 1 + rng.index(2),
        floor_m: rng.range(2.6, 2.9),
        bay_m: rng.range(2.4, 3.4),
        roof: if rng.chance(0.7) { Roof::Gable(pitch) } else { Roof::Hip(0.8 * pitch) },
        wall: rng.pick(&[Surface::Plaster, Surface::Brick, Surface::Plaster, Surface::Wood]),
        roof_surface: rng.pick(&[Surface::RoofTile, Surface::DarkTile]),
        open: [true; 4],
        balconies: false,
        shop: false,
    }
}

/// Garage beside a house.
pub(crate) fn garage(rng: &mut Generator) -> House {
    House {
        width_m: 3.6,
        depth_m: 5.5,
        floors: 1,
        floor_m: 2.5,
        bay_m: 3.6,
        roof: if rng.chance(0.5) { Roof::Flat } else { Roof::Gable(0.5) },
        wall: Surface::Concrete,
        roof_surface: Surface::RoofTile,
        open: [true, false, false, false],
        balconies: false,
        shop: false,
    }
}

/// Street tree.
pub(crate) fn street_tree(b: &mut Builder, foot: Point, rng: &mut Generator) {
    let height_m = rng.range(6.0, 10.0);
    let tree = Broadleaf {
        height_m,
        clear_m: rng.range(2.3, 3.2),
        spread_m: 0.33 * height_m,
        leaves: 450 + (45.0 * height_m) as usize,
    };
    tree.build(b, foot, rng);
}

/// Garden tree.
pub(crate) fn garden_tree(b: &mut Builder, foot: Point, rng: &mut Generator) {
    if rng.chance(0.25) {
        return conifer(b, foot, rng.range(4.0, 8.0), rng);
    }
    let height_m = rng.range(4.0, 8.0);
    let leaves = 360 + (48.0 * height_m) as usize;
    Broadleaf { height_m, clear_m: rng.range(1.0, 1.8), spread_m: 0.35 * height_m, leaves }
        .build(b, foot, rng);
}
