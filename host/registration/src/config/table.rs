//! Every setting of registration, one row each.
//!
//! A row makes a field of each configuration that has the setting, its default, its check, its
//! name for [`super::MethodConfig::get`] and [`super::MethodConfig::set`], a flag of `echoloop
//! register`, a key of files, an axis of a search, and a line of docs/settings.md. To add a
//! setting, add a row, and use the field where the method needs it.

use std::f64::consts::FRAC_PI_2;

use echoloop_parameters::{Bounds, Value};

use super::convention::Convention;
use super::error::ConfigError;
use super::method::Method;
use super::mode::FgrMode;
use super::setting::{
    Bound, Owner, PLAIN, Setting, SettingField, Use, between, linear, log, ours, searched, whole,
};

/// Length above zero, up to the one at which `f32` still resolves a decimetre.
const LENGTH: Bound =
    Bound::of(Bounds::above(0.0, 1e6).called("a length above 0 m, at most 1e6 m"));

/// Tolerance below which a run ends; 0 turns the test off.
const TOLERANCE: Bound = Bound::of(Bounds::at_least(0.0));

/// Number of neighbours of a normal. Some tens are usual; more only cost time.
const NEIGHBOURS: Bound = between(3.0, 1000.0);

/// Number of neighbours in features: at most 500, because those of all points are kept at once,
/// 0.4 GB for 100,000 points.
const FEATURE_NEIGHBOURS: Bound = between(3.0, 500.0);

/// φ_v from 5 cm to 1 m; 1 to 10 cm in Sec. 3.3, 5 cm in Open3D's example. A test compares this and
/// the other starts of the paper's ranges with the `open3d` of the configurations.
const VOXEL: Use = searched("φ_v", log(0.05, 1.0), linear(0.01, 0.1), 0.05);

/// Share of the information: two walls and a floor give each direction a third.
const BELOW_A_THIRD: Bound =
    Bound::of(Bounds::between(0.0, (1.0_f64 / 3.0).next_down()).called("0 or more, below 1/3"));

/// Number of steps, one or more.
const SOME: Bound = Bound::of(Bounds::at_least(1.0));

/// φ_rad2 is not below φ_rad1 (Sec. 3.3).
const FEATURE_RADIUS: Bound =
    LENGTH.not_below("normal_radius_m", "normal_radius_m or more (Sec. 3.3)");

/// The first distance is not below the last.
const FIRST_DISTANCE: Bound = Bound::of(Bounds::between(f64::MIN, 1e6).called(FIRST_WORDS))
    .not_below("max_pair_distance_m", FIRST_WORDS);

/// 0.5 m, about the distance of neighbours, to 10 m, with which [`crate::suggest()`] begins in a
/// cloud of 40 m radius.
const FALLING_DISTANCE: Use = ours(log(0.5, 10.0));

/// Normals have no sign here, so two of them are at most π/2 apart.
const NORMAL_ANGLE: Bound = Bound::of(Bounds::above(0.0, FRAC_PI_2).called("above 0, at most π/2"));

/// Width of a kernel, in standard deviations.
const WIDTH: Bound = Bound::of(Bounds::above(0.0, f64::INFINITY));

const FIRST_WORDS: &str = "max_pair_distance_m or more, at most 1e6 m";

/// φ_rad1: two voxels in Open3D's example.
const NORMAL_RADIUS: Use = searched("φ_rad1", log(0.1, 3.0), linear(0.01, 0.1), 0.1);

/// φ_rad1 of a local method, where φ_knn bounds most neighbourhoods before the radius does.
const LOCAL_NORMAL_RADIUS: Use = searched("φ_rad1", log(0.1, 8.0), linear(0.01, 0.1), 0.1);

/// φ_knn of a local method.
const NEIGHBOUR_COUNT: Use = searched("φ_knn", whole(10.0, 100.0), whole(10.0, 100.0), 30.0);

/// φ_d of a local method. Open3D has no default for ICP, so the search starts in the middle of the
/// paper's range.
const LOCAL_DISTANCE: Use = searched("φ_d", log(0.05, 3.0), linear(0.1, 2.0), 1.0);

/// φ_d of a global method: half a voxel in Open3D's example, so the search starts at the minimum.
const GLOBAL_DISTANCE: Use = searched("φ_d", log(0.05, 3.0), linear(0.1, 2.0), 0.1);

/// The setting of that name or former name.
pub fn setting(name: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| setting.key == name || setting.former == Some(name))
}

/// Declares a configuration: its own fields, then a field for each setting, with all defaults, and
/// the look-up of settings by name. The field after `in` is a part that has settings too.
macro_rules! configuration {
    (
        $(#[$about:meta])*
        $name:ident($owner:expr) $(in $part:ident)?
        [$($(#[$own_doc:meta])* $own:ident: $own_type:ty = $own_default:expr),*]
        [$({ $key:ident: $type:ty = $default:expr, $help:literal, $more:literal })*]
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            $($(#[$own_doc])* pub $own: $own_type,)*
            $(
                #[doc = $help]
                #[doc = concat!("Default: `", stringify!($default), "`.")]
                #[doc = ""]
                #[doc = $more]
                pub $key: $type,
            )*
        }

        impl $name {
            /// The defaults, for outdoor scans some tens of metres wide. [`crate::Suggestions`]
            /// fit them to the clouds at hand.
            pub fn outdoor() -> Self {
                Self { $($own: $own_default,)* $($key: $default,)* }
            }

            /// Checks each setting against its bounds ([`Setting::bounds`]).
            ///
            /// # Errors
            ///
            /// [`ConfigError`] names the first field out of bounds, and its bound.
            pub fn check(&self) -> Result<(), ConfigError> {
                let get = |key: &str| {
                    let mut copy = *self;
                    copy.slot(key).and_then(|slot| slot.get())
                };
                let used = |setting: &'static Setting| Some((setting, setting.used_by($owner)?));
                let mut settings = SETTINGS.iter().filter_map(used);
                settings.try_for_each(|(setting, of)| setting.check(&of, get))
            }

            /// The field of the setting of that name.
            pub(super) fn slot(&mut self, key: &str) -> Option<&mut dyn SettingField> {
                match key {
                    $(stringify!($key) => Some(&mut self.$key),)*
                    $(_ => self.$part.slot(key),)?
                    #[allow(unreachable_patterns, reason = "where a part keeps the others")]
                    _ => None,
                }
            }
        }
    };
}

/// A row: name, type, unit, bound, and former name; one line of help; further documentation of the
/// field; in braces the configurations that have it, each with its default and its use there.
macro_rules! settings {
    ($(
        $key:ident: $type:ty, $unit:literal, $bound:expr $(, formerly $former:literal)?,
        $help:literal, $more:literal => {
            $(icp $icp:expr, $icp_use:expr;)?
            $(gicp $gicp:expr, $gicp_use:expr;)?
            $(features $features:expr, $features_use:expr;)?
            $(fgr $fgr:expr, $fgr_use:expr;)?
            $(mac $mac:expr, $mac_use:expr;)?
            $(auto $auto:expr, $auto_use:expr;)?
        }
    )+) => {
        /// Every setting, in the order of its use.
        pub const SETTINGS: &[Setting] = &[$(Setting {
            key: stringify!($key),
            path: concat!("registration.", stringify!($key)),
            former: [$(Some($former),)? None][0],
            kind: <$type as Value>::KIND,
            unit: $unit,
            help: $help,
            bound: $bound,
            uses: &[
                $((Owner::Method(Method::Icp), $icp_use),)?
                $((Owner::Method(Method::Gicp), $gicp_use),)?
                $((Owner::Features, $features_use),)?
                $((Owner::Method(Method::Fgr), $fgr_use),)?
                $((Owner::Method(Method::Mac), $mac_use),)?
                $((Owner::Method(Method::Auto), $auto_use),)?
            ],
        }),+];

        configuration! {
            /// Settings of [`crate::Icp`]. Lengths in metres, angles in radians.
            ///
            /// The defaults are for scans of a street or a field from near each other: a motion of
            /// some 2 m and 10°. Pairs may be 5 m apart at first. Normals come from the nearest 20
            /// points, however far up to 3 m: rings of a scan lie far apart. The tolerances are far
            /// below the error of such scans (small_gicp stops at 1 mm and 1.7 mrad).
            IcpConfig(Owner::Method(Method::Icp)) []
            [$($({ $key: $type = $icp, $help, $more })?)+]
        }

        configuration! {
            /// Settings of [`crate::Gicp`]. Lengths in metres, angles in radians.
            ///
            /// The defaults are those of [`IcpConfig`]; fitness and RMSE do not end a run.
            GicpConfig(Owner::Method(Method::Gicp)) []
            [$($({ $key: $type = $gicp, $help, $more })?)+]
        }

        configuration! {
            /// Settings of FPFH features: the first half of Θ_reg (Sec. 3.3). Lengths in metres.
            FeatureConfig(Owner::Features)
            [
                /// Origin of the voxel grid and direction of the normals.
                convention: Convention = Convention::Sensor
            ]
            [$($({ $key: $type = $features, $help, $more })?)+]
        }

        configuration! {
            /// Settings of [`crate::Fgr`]. Lengths in metres.
            FgrConfig(Owner::Method(Method::Fgr)) in features
            [
                /// Settings for thinning and describing the points.
                features: FeatureConfig = FeatureConfig::outdoor(),
                /// The method as published, or as Open3D runs it.
                mode: FgrMode = FgrMode::Annealed,
                /// Seed of the tuple test's draws: `open3d` draws triples, `annealed` the matches
                /// with which all are compared.
                seed: u64 = 0
            ]
            [$($({ $key: $type = $fgr, $help, $more })?)+]
        }

        configuration! {
            /// Settings of [`crate::Mac`]. Lengths in metres.
            MacConfig(Owner::Method(Method::Mac)) in features
            [
                /// Settings for thinning and describing the points.
                features: FeatureConfig = FeatureConfig::outdoor()
            ]
            [$($({ $key: $type = $mac, $help, $more })?)+]
        }

        configuration! {
            /// Settings of [`crate::Auto`]. Lengths in metres.
            AutoConfig(Owner::Method(Method::Auto)) []
            [$($({ $key: $type = $auto, $help, $more })?)+]
        }
    };
}

settings! {
    voxel_m: f64, "m", LENGTH,
        "Edge of the voxels that thin both clouds, m. Lengths left out follow it.",
        "" =>
    {
        icp 0.2, VOXEL;
        gicp 0.2, VOXEL;
        features 0.5, VOXEL;
        auto 0.8, ours(log(0.2, 2.0));
    }
    normal_radius_m: f64, "m", LENGTH,
        "Radius of the neighbourhood of a normal, m.",
        "" =>
    {
        icp 3.0, LOCAL_NORMAL_RADIUS;
        gicp 3.0, LOCAL_NORMAL_RADIUS;
        features 1.5, NORMAL_RADIUS;
    }
    normal_neighbours: usize, "", NEIGHBOURS,
        "Largest number of neighbours of a normal.",
        "" =>
    {
        icp 20, NEIGHBOUR_COUNT;
        gicp 20, NEIGHBOUR_COUNT;
        features 30, PLAIN.bounded(FEATURE_NEIGHBOURS);
    }
    feature_radius_m: f64, "m", FEATURE_RADIUS,
        "Radius of the neighbourhood of a feature, m.",
        "" =>
    {
        features 3.5, searched("φ_rad2", log(0.1, 8.0), linear(0.01, 1.0), 0.25);
    }
    feature_neighbours: usize, "", FEATURE_NEIGHBOURS,
        "Largest number of neighbours of a feature.",
        "" =>
    {
        features 100, searched("φ_knn", whole(10.0, 100.0), whole(10.0, 100.0), 100.0);
    }
    max_pair_distance_m: f64, "m", LENGTH,
        "Largest distance between the points of a pair, m.",
        "Of a global method, the distance within which a match agrees with the motion in the end: \
         δ of FGR; the inlier threshold of MAC and the τ of its scores." =>
    {
        icp 0.5, LOCAL_DISTANCE;
        gicp 0.5, LOCAL_DISTANCE;
        fgr 0.5, GLOBAL_DISTANCE;
        mac 1.0, GLOBAL_DISTANCE;
    }
    first_pair_distance_m: Option<f64>, "m", FIRST_DISTANCE,
        "Largest distance of the first pairs, m; it then shrinks to that of the last.",
        "Coarse to fine: the distance shrinks by 0.7 an iteration to `max_pair_distance_m`. \
         Absent: plain ICP, as in the paper and in Open3D." =>
    {
        icp Some(5.0), FALLING_DISTANCE;
        gicp Some(5.0), FALLING_DISTANCE;
    }
    kernel_width: Option<f64>, "", WIDTH,
        "Residual at which a pair weighs a quarter, in standard deviations of all residuals.",
        "Geman and McClure's weights, once pairs are `max_pair_distance_m` apart at most; the \
         standard deviation is that of the run's own residuals. Absent: least squares, as in the \
         paper and in Open3D." =>
    {
        icp Some(2.0), ours(log(1.0, 10.0));
        gicp Some(2.0), ours(log(1.0, 10.0));
    }
    max_normal_angle_rad: Option<f64>, "rad", NORMAL_ANGLE,
        "Largest angle between the normals of a pair, rad.",
        "It separates the two sides of a wall, and a trunk from the ground. ICP then takes the \
         distance of a pair along the mean of both normals (Rusinkiewicz, \"A symmetric objective \
         function for ICP\", 2019, without his half turns). Absent: the target's normals alone, as \
         in the paper and in Open3D; in generalised ICP, every pair." =>
    {
        icp Some(0.8), ours(linear(0.1, 1.5));
        gicp Some(0.8), ours(linear(0.1, 1.5));
    }
    length_tolerance_m: f64, "m", LENGTH, formerly "max_stretch_m",
        "Largest difference of two compatible matches' distances in source and target, m.",
        "The published code asks on KITTI that `1 - (d / τ)²` be above 0.9: a third of τ." =>
    {
        mac 0.316, searched("", log(0.02, 1.0), linear(0.01, 0.2), 0.03);
    }
    max_iterations: usize, "", SOME,
        "Largest number of iterations.",
        "In MAC, steps of the final refinement: 0 leaves the motion of the best clique." =>
    {
        icp 50, searched("φ_icp", whole(8.0, 128.0), whole(8.0, 128.0), 30.0);
        gicp 50, searched("φ_icp", whole(8.0, 128.0), whole(8.0, 128.0), 30.0);
        fgr 256, searched("φ_fgr", whole(8.0, 512.0), whole(8.0, 128.0), 64.0)
            .bounded(between(1.0, 100000.0));
        mac 20, PLAIN.bounded(Bound::of(Bounds::between(f64::MIN, 1e5).called("at most 100000")));
    }
    translation_tolerance_m: f64, "m", TOLERANCE, formerly "still_m",
        "Length of a step, m, below which the run ends if its turn is within its tolerance too.",
        "" =>
    {
        icp 5e-4, PLAIN;
        gicp 5e-4, PLAIN;
    }
    rotation_tolerance_rad: f64, "rad", TOLERANCE, formerly "still_rad",
        "Turn of a step, rad, below which the run ends if its length is within its tolerance too.",
        "" =>
    {
        icp 1e-4, PLAIN;
        gicp 1e-4, PLAIN;
    }
    fitness_tolerance: f64, "", TOLERANCE, formerly "still_fraction",
        "Change of the share of paired points below which the run ends if that of their RMSE is \
         within its tolerance too.",
        "" =>
    {
        icp 1e-6, PLAIN;
    }
    rmse_tolerance_m: f64, "m", TOLERANCE, formerly "still_rmse_m",
        "Change of the pairs' RMSE, m, below which the run ends if that of their share is within \
         its tolerance too.",
        "" =>
    {
        icp 1e-6, PLAIN;
    }
    degeneracy_threshold: f64, "", BELOW_A_THIRD, formerly "least_information",
        "Share of the information below which a direction counts as unobservable.",
        "See [`crate::Observability`]. Real streets have 0.04 to 0.12; a walled yard seen by 540 \
         points has 2e-3, and is still registered to 2 cm." =>
    {
        icp 1e-3, PLAIN;
        gicp 1e-3, PLAIN;
    }
    max_candidates: usize, "", between(1.0, 1000.0),
        "Largest number of motions of each scale that are scored on the points of both clouds.",
        "" =>
    {
        auto 10, PLAIN;
    }
    max_refined: usize, "", between(1.0, 1000.0),
        "Largest number of the best scored motions that are refined with ICP.",
        "" =>
    {
        auto 8, PLAIN;
    }
    max_tuples: usize, "", between(1.0, 1000000.0),
        "Largest number of triples of matches that the tuple test keeps.",
        "Three times as many matches pass. (`annealed` keeps 1024 matches at most.)" =>
    {
        fgr 1000, PLAIN;
    }
    max_matches: usize, "", between(3.0, 20000.0),
        "Largest number of matches; more are thinned.",
        "The graph takes `n²/8` bytes and `n²/2` tests." =>
    {
        mac 10_000, PLAIN;
    }
    least_clique: usize, "", between(3.0, 20000.0),
        "Smallest number of matches of a clique that proposes a motion.",
        "" =>
    {
        mac 3, PLAIN;
    }
    max_cliques: usize, "", between(1.0, 100000000.0),
        "Number of cliques at which the search for them ends.",
        "" =>
    {
        mac 1_000_000, PLAIN;
    }
}
