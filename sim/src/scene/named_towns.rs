//! Nine named towns, three of each kind of scene, some on CARLA's roads.
//!
//! CARLA publishes the road networks of its towns as files, and the buildings only as assets of its
//! simulator. So the surroundings are generated here: a name stands for the same bytes on every
//! machine.

use std::fmt;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::landscape::{self, Landscape};
use super::town::{self, Dressing};
use super::{Placement, Scene, SceneKind};
use crate::roads::{NetworkStyle, RoadNetwork, RoadsError, draw_network, load_network};

/// Largest side of a town on roads, metres: one scan sees 120 m.
const MAX_SIDE_M: f64 = 2500.0;

/// Largest distance from its origin, metres: as for an imported place.
const MAX_REACH_M: f64 = 5000.0;

/// Distance between the places of sensors on roads, metres.
const ROAD_STEP_M: f64 = 1.0;

/// Source of CARLA's files.
const ORIGIN: &str = "github.com/BerkeleyLearnVerify/Scenic, folder assets/maps/CARLA";

/// A named town.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Town {
    /// CARLA's small town.
    Town01,
    /// CARLA's downtown.
    Town10Hd,
    /// An irregular grid of streets, generated.
    OldTown,
    /// CARLA's village among fields.
    Town07,
    /// Curved lanes with dead ends, generated.
    GardenSuburb,
    /// Lanes without sidewalks on a slope, generated.
    Hillside,
    /// Woods on hills.
    ForestHills,
    /// A dry bed between rocks.
    RockyValley,
    /// Beach, reeds, trees.
    LakeShore,
}

/// Source of a town.
enum TownSource {
    /// Road network in a file of CARLA's.
    Carla(&'static str),
    Generated(NetworkStyle, u64),
    Landscape(Landscape, u64),
}

/// Name, environment and source of each town, in the order of [`Town`].
const TOWNS: [(&str, SceneKind, TownSource); 9] = [
    ("town01", SceneKind::Structured, TownSource::Carla("Town01.xodr")),
    ("town10hd", SceneKind::Structured, TownSource::Carla("Town10HD.xodr")),
    ("old-town", SceneKind::Structured, TownSource::Generated(NetworkStyle::Grid, 1)),
    ("town07", SceneKind::SemiStructured, TownSource::Carla("Town07.xodr")),
    ("garden-suburb", SceneKind::SemiStructured, TownSource::Generated(NetworkStyle::Suburb, 1)),
    ("hillside", SceneKind::SemiStructured, TownSource::Generated(NetworkStyle::Hillside, 1)),
    ("forest-hills", SceneKind::Unstructured, TownSource::Landscape(Landscape::Forest, 1)),
    ("rocky-valley", SceneKind::Unstructured, TownSource::Landscape(Landscape::Valley, 1)),
    ("lake-shore", SceneKind::Unstructured, TownSource::Landscape(Landscape::Lake, 1)),
];

impl Town {
    /// All nine: three structured, three semi-structured, three unstructured.
    pub const ALL: [Self; 9] = [
        Self::Town01,
        Self::Town10Hd,
        Self::OldTown,
        Self::Town07,
        Self::GardenSuburb,
        Self::Hillside,
        Self::ForestHills,
        Self::RockyValley,
        Self::LakeShore,
    ];

    /// Town by its name on the command line.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|town| town.name() == name)
    }

    /// Name on the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        TOWNS[self as usize].0
    }

    /// Environment of the paper that it belongs to.
    #[must_use]
    pub const fn kind(self) -> SceneKind {
        TOWNS[self as usize].1
    }

    /// The three towns of a kind.
    #[must_use]
    pub fn of_kind(kind: SceneKind) -> [Self; 3] {
        let first = 3 * kind as usize;
        [0, 1, 2].map(|k| Self::ALL[first + k])
    }

    const fn source(self) -> &'static TownSource {
        &TOWNS[self as usize].2
    }

    /// File of its roads below the folder `ECHOLOOP_DATA`, for the towns of CARLA only.
    #[must_use]
    pub fn file(self, data: Option<&Path>) -> Option<PathBuf> {
        match self.source() {
            TownSource::Carla(name) => data.map(|data| data.join("carla_xodr").join(name)),
            _ => None,
        }
    }

    /// Text of its roads as OpenDRIVE, for generated networks only.
    #[must_use]
    pub fn drawn(self) -> Option<String> {
        match self.source() {
            TownSource::Generated(style, seed) => Some(draw_network(*style, *seed)),
            _ => None,
        }
    }
}

impl fmt::Display for Town {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Reason why a town cannot be built.
#[derive(Debug, Error)]
pub enum TownError {
    /// The file of its roads is missing.
    #[error(
        "{town} needs CARLA's roads, and {} is missing: set ECHOLOOP_DATA to the folder with \
         carla_xodr/{file} (from {ORIGIN}), or use any road network: --scene FILE.xodr",
        found.as_ref().map_or_else(|| file.to_string(), |path| path.display().to_string())
    )]
    NoFile {
        /// The town.
        town: Town,
        /// The file's name.
        file: &'static str,
        /// Path that was tried; `None` where no folder is known.
        found: Option<PathBuf>,
    },
    /// The road network cannot be read.
    #[error(transparent)]
    Roads(#[from] RoadsError),
    /// The road network is larger than a town, or lies too far away.
    #[error("no town is built on {}: {fault}", path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// The fault.
        fault: String,
    },
    /// Unstructured scenes have no roads.
    #[error("a road network is dressed as structured or semi-structured, not as unstructured")]
    Dress,
}

/// Builds a named town; `data` is the folder of CARLA's files, from `ECHOLOOP_DATA`.
///
/// # Errors
///
/// [`TownError`], for the towns of CARLA only.
pub fn build_town(town: Town, data: Option<&Path>) -> Result<Scene, TownError> {
    let name = town.name().to_owned();
    let of_roads = |network: &RoadNetwork| build_on_roads(name.clone(), network, town.kind(), 1);
    match town.source() {
        TownSource::Landscape(landscape, seed) => {
            let (mesh, area) = landscape::build(*landscape, *seed);
            Ok(Scene::new(name, mesh, area))
        }
        TownSource::Generated(style, seed) => {
            let network = RoadNetwork::parse(&name, &draw_network(*style, *seed));
            of_roads(
                &network
                    .map_err(|fault| RoadsError::Malformed { path: town.name().into(), fault })?,
            )
        }
        TownSource::Carla(file) => {
            let found = town.file(data);
            let path = found.clone().filter(|path| path.is_file());
            let path = path.ok_or(TownError::NoFile { town, file, found })?;
            of_roads(&load_bounded(&path)?)
        }
    }
}

/// Builds a town on the roads of an OpenDRIVE file, dressed as structured or semi-structured.
///
/// # Errors
///
/// [`TownError`].
pub fn load_town(path: &Path, dressing: SceneKind, seed: u64) -> Result<Scene, TownError> {
    let network = load_bounded(path)?;
    build_on_roads(network.name.clone(), &network, dressing, seed)
}

/// Loads a network within the limits of a town.
fn load_bounded(path: &Path) -> Result<RoadNetwork, TownError> {
    let network = load_network(path)?;
    let (low, high) = network.bounds();
    let side_m = (0..2).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let fault = match (network.check_reach(MAX_REACH_M), side_m <= MAX_SIDE_M) {
        (Ok(()), true) => return Ok(network),
        (Err(fault), _) => fault,
        (_, false) => {
            format!("it is {side_m:.0} m wide, more than {MAX_SIDE_M:.0} m: cut out a part of it")
        }
    };
    Err(TownError::Unfit { path: path.into(), fault })
}

fn build_on_roads(
    name: String,
    network: &RoadNetwork,
    kind: SceneKind,
    seed: u64,
) -> Result<Scene, TownError> {
    let dressing = match kind {
        SceneKind::Structured => Dressing::Quarter,
        SceneKind::SemiStructured => Dressing::Suburb,
        SceneKind::Unstructured => return Err(TownError::Dress),
    };
    let town::BuiltTown { mesh, area, movers } = town::build(network, dressing, seed);
    let driven = network.waypoints(ROAD_STEP_M).into_iter();
    let roads = driven.map(|way| Placement { at: way.at, heading_rad: way.heading_rad }).collect();
    Ok(Scene { roads, movers, ..Scene::new(name, mesh, area) })
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::super::mesh::fingerprint;
    use super::*;
    use crate::raycast::Raycaster;
    use crate::viewpoint::{PairPlan, Split, sample_pairs};

    #[test]
    fn there_are_three_towns_of_each_kind_and_names_are_read_as_written() {
        for kind in SceneKind::ALL {
            assert_eq!(Town::ALL.into_iter().filter(|town| town.kind() == kind).count(), 3);
            assert_eq!(Town::of_kind(kind).map(Town::kind), [kind; 3]);
        }
        for town in Town::ALL {
            assert_eq!(Town::named(&town.to_string()), Some(town));
            assert_eq!(SceneKind::named(town.name()), None);
        }
        assert_eq!(Town::named("town1"), None);
    }

    #[test]
    fn a_missing_file_of_carla_is_named_with_its_source() {
        let message = build_town(Town::Town07, None).expect_err("no folder").to_string();
        assert!(
            message.contains("ECHOLOOP_DATA") && message.contains("carla_xodr/Town07.xodr"),
            "{message}"
        );
        let empty = tempfile::tempdir().expect("a folder");
        let message =
            build_town(Town::Town01, Some(empty.path())).expect_err("no file").to_string();
        assert!(message.contains("carla_xodr/Town01.xodr is missing"), "{message}");
    }

    #[test]
    fn a_network_larger_than_a_town_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("roads.xodr");
        let message = |[x, length]: [&str; 2]| {
            let text = r#"<OpenDRIVE><road id="7" length="LONG"><planView>
<geometry s="0" x="WEST" y="0" hdg="0" length="LONG"><line/></geometry></planView><lanes>
<laneSection s="0"><right><lane id="-1" type="driving"><width sOffset="0" a="3"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;
            std::fs::write(&path, text.replace("WEST", x).replace("LONG", length)).expect("text");
            assert!(load_network(&path).is_ok(), "{x} {length}");
            let town = load_town(&path, SceneKind::Structured, 1);
            town.map(|scene| scene.name).map_err(|error| error.to_string())
        };
        assert_eq!(message(["-100", "200"]), Ok("roads".to_owned()));
        for (place, what) in [
            (["6000", "200"], "road 7 reaches 6200 m from the origin, more than 5000 m"),
            (["-1300", "2600"], "it is 2600 m wide, more than 2500 m"),
        ] {
            let message = message(place).expect_err(what);
            assert!(message.contains("no town is built on") && message.contains(what), "{message}");
        }
    }

    fn pairs_are_found(town: Town, data: Option<&Path>, [train, test]: [usize; 2]) {
        let start = Instant::now();
        let scene = build_town(town, data).unwrap_or_else(|error| panic!("{error}"));
        let built = start.elapsed();
        let caster = Raycaster::new(&scene);
        let start = Instant::now();
        for (count, split) in [(train, Split::Train), (test, Split::Test)] {
            let plan = PairPlan { count, split, ..PairPlan::default() };
            let pairs = sample_pairs(&scene, &caster, &plan).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(pairs.len(), count, "{town}");
        }
        let (low, high) = scene.area;
        eprintln!(
            "| `{town}` | {} | {:.0} m × {:.0} m | {:.1} s | {:.1} s |",
            scene.mesh.triangles.len(),
            high[0] - low[0],
            high[1] - low[1],
            built.as_secs_f64(),
            start.elapsed().as_secs_f64()
        );
    }

    #[test]
    fn a_town_of_each_kind_has_viewpoints_for_pairs() {
        for town in [Town::OldTown, Town::GardenSuburb, Town::RockyValley] {
            pairs_are_found(town, None, [3, 8]);
        }
    }

    #[test]
    #[ignore = "the table of benches/record/data.md: minutes without optimisation"]
    fn all_nine_have_viewpoints_for_ten_and_a_hundred_pairs() {
        let data = echoloop_needs::data_folder("three of the nine towns");
        for town in Town::ALL {
            if data.is_some() || !matches!(town.source(), TownSource::Carla(_)) {
                pairs_are_found(town, data.as_deref(), [10, 100]);
            }
        }
    }

    #[test]
    fn generated_towns_are_the_pinned_bytes() {
        let towns = [Town::OldTown, Town::Hillside, Town::ForestHills, Town::LakeShore];
        let found = towns.map(|town| fingerprint(&build_town(town, None).expect("ours").mesh));
        let pinned = [
            16_970_146_060_443_705_267,
            14_421_337_472_787_107_411,
            2_345_407_353_754_977_446,
            15_651_798_679_853_142_343,
        ];
        assert_eq!(found, pinned);
    }
}
