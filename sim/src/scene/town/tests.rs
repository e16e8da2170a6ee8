use super::*;
use crate::raycast::Raycaster;
use crate::roads::{LaneKind, NetworkStyle, draw_network, load_network};
use crate::scene::material::Surface;
use crate::scene::mover::Placement;
use crate::scene::parts::{Frame, Point};
use cover_raster::{Cover, CoverRaster};

fn ours(style: NetworkStyle, seed: u64) -> RoadNetwork {
    RoadNetwork::parse("ours", &draw_network(style, seed)).expect("a network of ours")
}

/// Networks with their dressing; those of CARLA where its files are present.
fn towns() -> Vec<(RoadNetwork, Dressing)> {
    let mut towns = vec![
        (ours(NetworkStyle::Grid, 1), Dressing::Quarter),
        (ours(NetworkStyle::Suburb, 1), Dressing::Suburb),
        (ours(NetworkStyle::Hillside, 1), Dressing::Suburb),
    ];
    if let Some(folder) = echoloop_needs::data_folder("towns on CARLA's roads") {
        let load = |name: &str| load_network(&folder.join("carla_xodr").join(name)).expect(name);
        towns.push((load("Town01.xodr"), Dressing::Quarter));
        towns.push((load("Town07.xodr"), Dressing::Suburb));
    }
    towns
}

fn middle(corners: [[f32; 3]; 3]) -> Point {
    std::array::from_fn(|i| corners.iter().map(|c| f64::from(c[i])).sum::<f64>() / 3.0)
}

const HOUSE: [Surface; 6] = [
    Surface::Plaster,
    Surface::Brick,
    Surface::RoofTile,
    Surface::DarkTile,
    Surface::Stone,
    Surface::Wood,
];

#[test]
fn towns_are_sound_and_no_house_stands_on_a_road() {
    for (network, dressing) in towns() {
        let name = network.name.clone();
        let start = std::time::Instant::now();
        let mesh = build(&network, dressing, 1).mesh;
        let count = mesh.triangles.len();
        eprintln!("{name} {dressing:?}: {count} triangles, {:.1} s", start.elapsed().as_secs_f64());
        mesh.check(crate::scene::MATERIALS.len(), 1500.0).expect("sound");
        assert!((400_000..2_000_000).contains(&count), "{name}: {count}");
        let raster = CoverRaster::new(&network);
        let mut parts = 0;
        for t in 0..count {
            let [x, y, z] = middle(mesh.corners(t));
            let is_house = HOUSE.iter().any(|s| s.index() == mesh.materials[t]);
            let cover = raster.cover([x, y]);
            // Kerbs are also stone, but low.
            let up = raster.level([x, y]).map_or(0.0, |level| z - level);
            parts += usize::from(is_house && cover == Cover::Open);
            let on_road = matches!(cover, Cover::Driven | Cover::Paved);
            assert!(!(is_house && on_road && up > 0.5), "{name}: a house at {x}, {y}");
        }
        assert!(parts > 100_000, "{name}: {parts} faces of houses");
    }
}

#[test]
fn ground_meets_roads_and_never_shows_through_them() {
    for (network, dressing) in towns() {
        let (mut b, layout) = (Builder::default(), TownLayout::new(&network, dressing, 1));
        surface::build(&mut b, &network, &layout.raster);
        layout.ground.build(&mut b, |at| layout.surface(at));
        let mesh = b.mesh;
        let caster = Raycaster::from_mesh(&mesh);
        let down = |[x, y, z]: Point| {
            let hit = caster.cast([x, y, z + 0.6].map(|v| v as f32), [0.0, 0.0, -1.0])?;
            Some((z + 0.6 - f64::from(hit.range_m), mesh.materials[hit.triangle as usize]))
        };
        let (mut seen, mut off, mut beside) = (0, 0, 0);
        for lane in network.lanes.iter().filter(|lane| lane.kind == LaneKind::Driving) {
            for [left, right] in &lane.ribs {
                let at = crate::vector::mix(*left, *right, 0.5);
                let (height, material) = down(at).expect("a road");
                // Overlapping roads in crossings of Town07 differ by up to half a metre in height.
                let is_off = (height - at[2]).abs() > 0.05;
                assert!(!is_off || network.name != "ours", "{height} at {at:?}");
                off += usize::from(is_off);
                assert_ne!(material, Surface::Grass.index(), "{}: {at:?}", network.name);
                seen += 1;
            }
        }
        for front in &layout.edges {
            for k in 1..(front.length_m() / 3.0) as usize {
                let edge = front.frame(3.0 * k as f64);
                let ([x, y, _], [_, _, road]) = (edge.at([0.0, 0.7, 0.0]), edge.at([0.0; 3]));
                if layout.raster.cover([x, y]) == Cover::Open {
                    let (height, _) = down([x, y, road]).expect("ground beside a road");
                    assert!(
                        (height - road).abs() < 0.35,
                        "{}: {height}, road {road}",
                        network.name
                    );
                    beside += 1;
                }
            }
        }
        assert!(seen > 200 && beside > 200, "{}: {seen}, {beside}", network.name);
        assert!(50 * off < seen, "{}: {off} of {seen}", network.name);
    }
}

#[test]
fn a_town_has_lights_paint_and_vehicles_on_its_roads() {
    let network = ours(NetworkStyle::Grid, 2);
    let mesh = build(&network, Dressing::Quarter, 2).mesh;
    let raster = CoverRaster::new(&network);
    let on = |surface: Surface, cover: Cover| {
        let of = |t: &usize| mesh.materials[*t] == surface.index();
        let there = |t: &usize| {
            let [x, y, _] = middle(mesh.corners(*t));
            raster.cover([x, y]) == cover
        };
        (0..mesh.triangles.len()).filter(of).filter(there).count()
    };
    assert!(on(Surface::RoadPaint, Cover::Driven) > 500);
    assert!(on(Surface::Rubber, Cover::Driven) > 64 * 4 * 5, "vehicles on their way");
    assert!(on(Surface::Rubber, Cover::Paved) > 64 * 4 * 10, "parked vehicles");
    assert!(on(Surface::DarkPaint, Cover::Raised) > 12 * 10, "traffic lights");
}

/// Five points along the ground below a vehicle.
fn below(at: Placement) -> [Point; 5] {
    let frame = Frame::new(at.at, at.heading_rad);
    [-2.0, -1.0, 0.0, 1.0, 2.0].map(|x| frame.at([x, 0.0, 0.0]))
}

#[test]
fn vehicles_move_along_roads_and_do_not_collide() {
    for (network, dressing) in towns() {
        let (name, town, raster) =
            (&network.name, build(&network, dressing, 1), CoverRaster::new(&network));
        let on_road = |[x, y, _]: &Point| {
            matches!(raster.cover([*x, *y]), Cover::Driven | Cover::Paved | Cover::Infill)
        };
        assert!(town.movers.len() > 20, "{name}: {}", town.movers.len());
        for seconds in [0.5, 1.0, 2.5] {
            let now = town.movers.iter().filter_map(|mover| mover.after(seconds));
            let now: Vec<[Point; 5]> = now.map(below).collect();
            let off = now.as_flattened().iter().filter(|at| !on_road(at)).count();
            assert!(50 * off < 5 * now.len(), "{name}: {off} of {} off the road", 5 * now.len());
            for (k, one) in now.iter().enumerate() {
                let others = now[..k].as_flattened();
                let nearest =
                    one.iter().flat_map(|a| others.iter().map(|b| cover_raster::flat(*a, *b)));
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                assert!(nearest > 1.8, "{name}: {nearest} m apart after {seconds} s");
            }
        }
        let far = |mover: &&Mover| {
            let to = mover.after(0.5).expect("a place").at;
            cover_raster::flat(mover.way[0].at, to) > 2.0
        };
        let far = town.movers.iter().filter(far).count();
        assert!(10 * far > 9 * town.movers.len(), "{name}: {far} of {}", town.movers.len());
    }
}

#[test]
fn one_seed_gives_one_town() {
    let network = ours(NetworkStyle::Suburb, 3);
    let once = build(&network, Dressing::Suburb, 3);
    assert_eq!(build(&ours(NetworkStyle::Suburb, 3), Dressing::Suburb, 3), once);
    assert_ne!(build(&network, Dressing::Suburb, 4).mesh, once.mesh);
}
