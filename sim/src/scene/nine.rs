//! Nine towns under stable names: three kinds of country, three of each, CARLA's roads among them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use thiserror::Error;

use super::landscape::{self, Landscape};
use super::town::{self, Dress};
use super::{Placement, Scene, SceneKind};
use crate::roads::{NetworkStyle, RoadFault, RoadNetwork, RoadsError, draw_network, load_network};

/// A town on roads is no wider than this, metres: one scan sees 120 m.
const MOST_SIDE_M: f64 = 2500.0;

/// It reaches no farther from its origin, metres: as far as an imported place.
const MOST_REACH_M: f64 = 5000.0;

/// From place to place where a sensor may drive, metres.
const ROAD_STEP_M: f64 = 1.0;

/// Where CARLA's files come from.
const ORIGIN: &str = "github.com/BerkeleyLearnVerify/Scenic, folder assets/maps/CARLA";

/// The towns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Town {
    /// CARLA's small town.
    Town01,
    /// CARLA's downtown.
    Town10Hd,
    /// An irregular grid of streets, ours.
    OldTown,
    /// CARLA's village among fields.
    Town07,
    /// Curved lanes with dead ends, ours.
    GardenSuburb,
    /// Lanes without sidewalks on a slope, ours.
    Hillside,
    /// Woods on hills.
    ForestHills,
    /// A dry bed between rocks.
    RockyValley,
    /// Beach, reeds, trees.
    LakeShore,
}

/// What a town stands on.
enum Base {
    /// A file of CARLA's.
    Carla(&'static str),
    Ours(NetworkStyle, u64),
    Land(Landscape, u64),
}

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

    /// The name on the command line and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Town01 => "town01",
            Self::Town10Hd => "town10hd",
            Self::OldTown => "old-town",
            Self::Town07 => "town07",
            Self::GardenSuburb => "garden-suburb",
            Self::Hillside => "hillside",
            Self::ForestHills => "forest-hills",
            Self::RockyValley => "rocky-valley",
            Self::LakeShore => "lake-shore",
        }
    }

    /// Which of the paper's environments it is.
    #[must_use]
    pub const fn kind(self) -> SceneKind {
        match self {
            Self::Town01 | Self::Town10Hd | Self::OldTown => SceneKind::Structured,
            Self::Town07 | Self::GardenSuburb | Self::Hillside => SceneKind::SemiStructured,
            Self::ForestHills | Self::RockyValley | Self::LakeShore => SceneKind::Unstructured,
        }
    }

    /// The three of a kind.
    #[must_use]
    pub fn of_kind(kind: SceneKind) -> [Self; 3] {
        let first = 3 * kind as usize;
        [0, 1, 2].map(|k| Self::ALL[first + k])
    }

    const fn base(self) -> Base {
        match self {
            Self::Town01 => Base::Carla("Town01.xodr"),
            Self::Town10Hd => Base::Carla("Town10HD.xodr"),
            Self::OldTown => Base::Ours(NetworkStyle::Grid, 1),
            Self::Town07 => Base::Carla("Town07.xodr"),
            Self::GardenSuburb => Base::Ours(NetworkStyle::Suburb, 1),
            Self::Hillside => Base::Ours(NetworkStyle::Hillside, 1),
            Self::ForestHills => Base::Land(Landscape::Forest, 1),
            Self::RockyValley => Base::Land(Landscape::Valley, 1),
            Self::LakeShore => Base::Land(Landscape::Lake, 1),
        }
    }

    /// The file it stands on: of CARLA's towns alone, below the folder that `ECHOLOOP_DATA` names.
    #[must_use]
    pub fn file(self, data: Option<&Path>) -> Option<PathBuf> {
        match self.base() {
            Base::Carla(name) => data.map(|data| data.join("carla_xodr").join(name)),
            _ => None,
        }
    }

    /// The text of its roads as OpenDRIVE, of ours alone.
    #[must_use]
    pub fn drawn(self) -> Option<String> {
        match self.base() {
            Base::Ours(style, seed) => Some(draw_network(style, seed)),
            _ => None,
        }
    }
}

impl fmt::Display for Town {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Town {
    type Err = UnknownTown;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|town| town.name() == name).ok_or(UnknownTown)
    }
}

/// Not the name of a [`Town`].
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error(
    "expected town01, town10hd, old-town, town07, garden-suburb, hillside, forest-hills, \
     rocky-valley or lake-shore"
)]
pub struct UnknownTown;

/// Why there is no town.
#[derive(Debug, Error)]
pub enum TownError {
    /// It stands on a file that is not there.
    #[error(
        "{town} stands on CARLA's roads, and {} is not there: ECHOLOOP_DATA names the folder in \
         which carla_xodr/{file} lies; it is from {ORIGIN}, or give any road network: --scene \
         FILE.xodr",
        found.as_ref().map_or_else(|| file.to_string(), |path| path.display().to_string())
    )]
    NoFile {
        /// The town.
        town: Town,
        /// The file's name.
        file: &'static str,
        /// Where it was looked for; none where no folder is known.
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
        /// What is wrong with it.
        fault: RoadFault,
    },
    /// Unstructured country has no roads.
    #[error("a road network is dressed as structured or semi-structured, not as unstructured")]
    Dress,
}

/// Builds one of the nine; `data` is the folder of CARLA's files, which `ECHOLOOP_DATA` names.
///
/// # Errors
///
/// [`TownError`], of CARLA's towns alone.
pub fn build_town(town: Town, data: Option<&Path>) -> Result<Scene, TownError> {
    let name = town.name().to_owned();
    let of_roads = |network: &RoadNetwork| dressed(name.clone(), network, town.kind(), 1);
    match town.base() {
        Base::Land(landscape, seed) => {
            let (mesh, area) = landscape::build(landscape, seed);
            Ok(Scene::new(name, mesh, area))
        }
        Base::Ours(..) => of_roads(&ours(town, &town.drawn().unwrap_or_default())?),
        Base::Carla(file) => {
            let found = town.file(data);
            let path = found.clone().filter(|path| path.is_file());
            let path = path.ok_or(TownError::NoFile { town, file, found })?;
            of_roads(&load_fit(&path)?)
        }
    }
}

/// Builds a town on the roads of an OpenDRIVE file, dressed as structured or semi-structured.
///
/// # Errors
///
/// [`TownError`].
pub fn load_town(path: &Path, dress: SceneKind, seed: u64) -> Result<Scene, TownError> {
    let network = load_fit(path)?;
    dressed(network.name.clone(), &network, dress, seed)
}

/// A network that a town can be built on.
fn load_fit(path: &Path) -> Result<RoadNetwork, TownError> {
    let network = load_network(path)?;
    let (low, high) = network.bounds();
    let side_m = (0..2).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let fault = match (network.check_reach(MOST_REACH_M), side_m <= MOST_SIDE_M) {
        (Ok(()), true) => return Ok(network),
        (Err(fault), _) => fault,
        (_, false) => RoadFault::Format(format!(
            "it is {side_m:.0} m wide, more than {MOST_SIDE_M:.0} m: cut out a part of it"
        )),
    };
    Err(TownError::Unfit { path: path.into(), fault })
}

fn ours(town: Town, text: &str) -> Result<RoadNetwork, RoadsError> {
    RoadNetwork::parse(town.name(), text)
        .map_err(|fault| RoadsError::Malformed { path: town.name().into(), fault })
}

fn dressed(
    name: String,
    network: &RoadNetwork,
    kind: SceneKind,
    seed: u64,
) -> Result<Scene, TownError> {
    let dress = match kind {
        SceneKind::Structured => Dress::Quarter,
        SceneKind::SemiStructured => Dress::Suburb,
        SceneKind::Unstructured => return Err(TownError::Dress),
    };
    let town::Built { mesh, area, movers } = town::build(network, dress, seed);
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
            assert_eq!(town.to_string().parse(), Ok(town));
            assert!(town.name().parse::<SceneKind>().is_err());
        }
        assert_eq!("town1".parse::<Town>(), Err(UnknownTown));
    }

    #[test]
    fn a_town_of_carlas_without_its_file_says_which_and_where_from() {
        let said = build_town(Town::Town07, None).expect_err("no folder").to_string();
        assert!(
            said.contains("ECHOLOOP_DATA") && said.contains("carla_xodr/Town07.xodr"),
            "{said}"
        );
        let empty = tempfile::tempdir().expect("a folder");
        let said = build_town(Town::Town01, Some(empty.path())).expect_err("no file").to_string();
        assert!(said.contains("carla_xodr/Town01.xodr is not there"), "{said}");
    }

    #[test]
    fn a_town_is_built_on_no_more_than_a_town() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("roads.xodr");
        let said = |[x, length]: [&str; 2]| {
            let text = r#"<OpenDRIVE><road id="7" length="LONG"><planView>
<geometry s="0" x="WEST" y="0" hdg="0" length="LONG"><line/></geometry></planView><lanes>
<laneSection s="0"><right><lane id="-1" type="driving"><width sOffset="0" a="3"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;
            std::fs::write(&path, text.replace("WEST", x).replace("LONG", length)).expect("text");
            assert!(load_network(&path).is_ok(), "{x} {length}");
            let town = load_town(&path, SceneKind::Structured, 1);
            town.map(|scene| scene.name).map_err(|error| error.to_string())
        };
        assert_eq!(said(["-100", "200"]), Ok("roads".to_owned()));
        for (place, what) in [
            (["6000", "200"], "road 7 reaches 6200 m from the origin, more than 5000 m"),
            (["-1300", "2600"], "it is 2600 m wide, more than 2500 m"),
        ] {
            let said = said(place).expect_err(what);
            assert!(said.contains("no town is built on") && said.contains(what), "{said}");
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
    fn a_town_of_each_kind_has_places_for_pairs() {
        for town in [Town::OldTown, Town::GardenSuburb, Town::RockyValley] {
            pairs_are_found(town, None, [3, 8]);
        }
    }

    #[test]
    #[ignore = "the table of benches/record/data.md: minutes without optimisation"]
    fn all_nine_have_places_for_ten_and_a_hundred_pairs() {
        let data = echoloop_needs::data_folder("three of the nine towns");
        for town in Town::ALL {
            if data.is_some() || !matches!(town.base(), Base::Carla(_)) {
                pairs_are_found(town, data.as_deref(), [10, 100]);
            }
        }
    }

    #[test]
    fn towns_of_ours_are_the_bytes_that_are_pinned() {
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
