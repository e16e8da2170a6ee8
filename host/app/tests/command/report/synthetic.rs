//! A report as a run would give it: made up, seeded, the same on every machine that has the same
//! `libm`.

use std::cmp::Ordering;
use std::path::PathBuf;

use echoloop_closed_loop::config::{DataConfig, RunConfig};
use echoloop_closed_loop::cost::{CostKind, ScanCost};
use echoloop_closed_loop::evaluation::compare::Comparison;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, FrontPoint, Mark};
use echoloop_closed_loop::parameters::{Scale, Values};
use echoloop_closed_loop::run_folder::journal::{CandidateRecord, Generation};
use echoloop_closed_loop::run_folder::provenance::{About, Session};
use echoloop_closed_loop::run_folder::run::{AxisRecord, Background, RunResult};
use echoloop_closed_loop::search::Finalist;
use echoloop_closed_loop::search::{Place, Stage};
use echoloop_clouds::Cloud;
use echoloop_random::Generator;
use echoloop_report::finished_runs::FinishedRun;
use echoloop_report::{
    Bar, EvaluationRow, EvaluationTable, Importance, Report, RowKind, Slice, SlicePoint,
};
use nalgebra::Point3;

const GENERATIONS: u32 = 30;

fn normal(generator: &mut Generator) -> f64 {
    generator.normals(1)[0]
}

pub(crate) fn report(seed: u64) -> Report {
    let mut rng = Generator::new(seed, 0);
    let axes = axes();
    let (default, tuned) = (values(2), values(3));
    let generations = generations(&mut rng, &axes, [&default, &tuned]);
    let table = table();
    let importance = importance(&axes, &tuned);
    let names: Vec<String> = axes.iter().map(|axis| axis.name.clone()).collect();
    let background = Background {
        triangles: 516_048,
        beams: "160 × 40 beams".into(),
        places: (0..20).map(|i| format!("town {}", i % 3 + 1)).collect(),
        stages: vec![Stage {
            name: "joint".into(),
            place: Place::default(),
            axes: Vec::new(),
            generations: GENERATIONS,
            population: 12,
            pairs: 10,
            sigma: 0.0,
        }],
        axes,
        correlations: correlations(&mut rng, names.len()),
        correlated: names,
        covariance_learned: 0.56,
    };
    let run = run(&mut rng, table.data, default, tuned);
    Report { run, background, generations, table, importance, clouds: clouds(&mut rng) }
}

fn run(rng: &mut Generator, data: DataConfig, default: Values, tuned: Values) -> FinishedRun {
    let config = RunConfig { data, seed: 20_260_417, ..RunConfig::default() };
    let config_text = toml::to_string(&config).expect("TOML");
    let [before, after] = pair_errors(rng);
    let summary = |errors, energy_j| {
        let cost = Some(ScanCost { energy_j, ..ScanCost::UNKNOWN });
        Summary { cost, ..Summary::from_errors(errors, &data) }
    };
    let start =
        Finalist { origin: "start".into(), values: default.clone(), fitness: 5.8, pairs: 10 };
    let session = Session {
        begun: "2026-11-22T17:00:00Z".into(),
        version: "0.1.0".into(),
        build: Some("995dc9bbdf1939fa".into()),
        command: "echoloop tune".into(),
    };
    FinishedRun {
        path: PathBuf::from("run"),
        config: toml::from_str(&config_text).expect("TOML"),
        config_text,
        about: About { sessions: vec![session], ..About::default() },
        result: RunResult {
            format: 1,
            protocol: "joint".into(),
            method: "fgr".into(),
            scene: "unstructured".into(),
            seed: config.seed,
            generations: GENERATIONS as usize,
            registrations: 3600,
            origin: "joint, mean".into(),
            default,
            tuned,
            finalists: vec![start],
            check: None,
            plain_summary: None,
            default_summary: summary(before, 4.61e-3),
            tuned_summary: summary(after, 0.92e-3),
            comparison: SAME,
            front: Some(front()),
            background: None,
        },
    }
}

const SAME: Comparison = Comparison { difference: 0.0, interval: [-1e-4, 1e-4], reference: 0.004 };

/// Importance that falls from parameter to parameter, and slices of the first.
fn importance(axes: &[AxisRecord], tuned: &Values) -> Importance {
    let bars = axes.iter().zip(0..).map(|(axis, rank)| {
        let value = 0.4 * libm::pow(0.6, f64::from(rank));
        let share = Estimate { value, interval: [value - 0.06, value + 0.06] };
        Bar { name: axis.name.clone(), share }
    });
    let slices = axes.iter().take(4).map(|axis| {
        let (range, chosen) = (axis.max - axis.min, tuned[&axis.name]);
        let point = |i: u32| {
            let at = axis.min + range * f64::from(i) / 20.0;
            let far = (at - chosen) / range;
            let ratio = libm::exp(2.0 * far * far);
            SlicePoint { at, ratio, band: [0.9 * ratio, 1.1 * ratio] }
        };
        let points: Vec<SlicePoint> = (0..21).map(point).collect();
        let dots = points.iter().map(|point| [point.at, 1.1 * point.ratio]).collect();
        Slice { axis: axis.clone(), points, dots, chosen }
    });
    Importance {
        verdict: "A response surface predicts 61 % of the variation.".into(),
        bars: bars.collect(),
        slices: slices.collect(),
        chosen: vec![
            "1 of 12 parameters was chosen outside the search’s last band.".into(),
            "voxel = 0.47 m is above the band of 0.3 to 0.4 m".into(),
        ],
    }
}

/// Errors that fall with the energy spent, as far as they can.
fn front() -> Front {
    let mark = |energy_j: f64| {
        let error = 0.004 + 2e-6 / energy_j.sqrt();
        Mark {
            error,
            interval: [0.8 * error, 1.3 * error],
            recall_pct: 100.0,
            median_translation_m: 0.5 * error,
            cost: ScanCost { energy_j, ..ScanCost::UNKNOWN },
        }
    };
    let point = |i: u32| FrontPoint {
        values: Values::new(),
        mark: mark(1e-7 * libm::pow(1.5, f64::from(i))),
        comparison: SAME,
    };
    Front {
        cost: CostKind::Energy,
        pairs: 20,
        default: mark(4.6e-3),
        tuned: mark(1e-3),
        points: (0..24).map(point).collect(),
    }
}

fn figures<T>(of: [T; 5]) -> Figures<T> {
    let [recall_pct, mean_translation_m, mean_rotation_deg, median_translation_m, last] = of;
    let median_rotation_deg = last;
    Figures {
        recall_pct,
        mean_translation_m,
        mean_rotation_deg,
        median_translation_m,
        median_rotation_deg,
    }
}

fn table() -> EvaluationTable {
    let around = |value: f64| Estimate { value, interval: [0.8 * value, 1.15 * value] };
    // One figure got better, one worse; the others did not change significantly.
    let gain = [(50.0, true), (-0.03, false), (1.1, true), (-0.03, false), (-2.0, false)];
    let gain = gain.map(|(value, is_shown)| Difference { estimate: around(value), is_shown });
    let row = |label: &str, kind, pairs, of: [f64; 5]| EvaluationRow {
        label: label.into(),
        kind,
        pairs,
        figures: figures(of.map(around)),
        gain: (kind == RowKind::Tuned).then(|| figures(gain)),
    };
    let nan = f64::NAN;
    EvaluationTable {
        rows: vec![
            row("Default", RowKind::Default, 20, [25.0, 0.634, 2.61, 3.182, 14.31]),
            row("Tuned, joint", RowKind::Tuned, 20, [75.0, 0.417, 1.48, 0.47, 1.92]),
            row("Tuned, LiDAR only", RowKind::Tuned, 20, [30.0, 0.66, 2.5, 2.904, 12.7]),
            row("Tuned, registration only", RowKind::Tuned, 20, [55.0, 0.489, 1.77, 0.886, 3.4]),
            row("Paper, default", RowKind::Reference, 100, [18.1, 0.67, 2.64, nan, nan]),
            row("Paper, joint", RowKind::Reference, 100, [60.0, 0.71, 1.71, nan, nan]),
        ],
        data: DataConfig {
            success_translation_m: 1.0,
            success_rotation_deg: 5.0,
            ..DataConfig::default()
        },
    }
}

/// Names, units, bounds, default and tuned value of the parameters; true: logarithmic.
const PARAMETERS: [(&str, &str, [f64; 4], bool); 12] = [
    ("noise_floor", "codes", [20.0, 800.0, 200.0, 92.0], true),
    ("saturation", "codes", [2000.0, 4095.0, 3900.0, 3610.0], false),
    ("min_width", "ns", [1.0, 20.0, 4.0, 6.3], false),
    ("max_echoes", "", [1.0, 5.0, 3.0, 2.0], false),
    ("threshold_decay", "1/m", [0.0001, 0.1, 0.01, 0.0021], true),
    ("smoothing", "samples", [1.0, 15.0, 5.0, 7.0], false),
    ("voxel", "m", [0.05, 1.0, 0.05, 0.47], true),
    ("normal_radius", "m", [0.1, 3.0, 0.1, 1.42], true),
    ("feature_radius", "m", [0.1, 8.0, 0.25, 3.61], true),
    ("feature_neighbours", "", [10.0, 100.0, 30.0, 78.0], false),
    ("max_pair_distance", "m", [0.05, 3.0, 0.025, 0.71], true),
    ("iterations", "", [8.0, 128.0, 64.0, 128.0], false),
];

fn axes() -> Vec<AxisRecord> {
    let axis = |&(name, unit, [min, max, ..], log): &(&str, &str, [f64; 4], bool)| AxisRecord {
        name: name.into(),
        unit: unit.into(),
        scale: if log { Scale::Log } else { Scale::Linear },
        min,
        max,
    };
    PARAMETERS.iter().map(axis).collect()
}

/// The default values, or the tuned ones.
fn values(which: usize) -> Values {
    PARAMETERS.iter().map(|(name, _, values, _)| ((*name).to_owned(), values[which])).collect()
}

/// A search that goes from the default to the tuned values, each at its own pace.
fn generations(
    rng: &mut Generator,
    axes: &[AxisRecord],
    [default, tuned]: [&Values; 2],
) -> Vec<Generation> {
    let paces: Vec<[f64; 2]> =
        axes.iter().map(|_| [3.0 + 9.0 * rng.unit(), 0.25 + 0.6 * rng.unit()]).collect();
    let mut generation = |number: u32| {
        let t = f64::from(number);
        let level = 0.32 + 5.2 * libm::exp(-t / 7.0);
        let mut candidate = |_| CandidateRecord {
            point: Vec::new(),
            values: Values::new(),
            repaired: Vec::new(),
            settings: 0,
            errors: Vec::new(),
            fitness: level * (1.0 + 0.3 * normal(rng)).max(0.4),
            cost: None,
        };
        let candidates = (0..12).map(&mut candidate).collect();
        let mean = axes.iter().zip(&paces).map(|(record, [pace, _])| {
            let axis = record.axis();
            let cube =
                |values: &Values| axis.to_cube(values[&record.name].clamp(record.min, record.max));
            let (from, to) = (cube(default), cube(tuned));
            let mean = to + (from - to) * libm::exp(-t / pace) + 0.015 * normal(rng);
            mean.clamp(0.0, 1.0)
        });
        Generation {
            generation: number,
            stage: "joint".into(),
            pairs: vec![0, 1],
            mean: mean.collect(),
            deviations: paces.iter().map(|[_, keep]| 0.28 * libm::exp(-t / 30.0 / keep)).collect(),
            sigma: 0.3 * libm::exp(-t / 18.0) * (1.0 + 0.06 * normal(rng)),
            candidates,
        }
    };
    (0..GENERATIONS).map(&mut generation).collect()
}

fn correlations(rng: &mut Generator, n: usize) -> Vec<Vec<f64>> {
    let mut lower = |row: usize, column: usize| {
        let strong = (row, column) == (8, 7) || (row, column) == (7, 6);
        let r: f64 = if strong { 0.61 + 0.1 * rng.unit() } else { 0.16 * normal(rng) };
        r.clamp(-0.9, 0.9)
    };
    let rows: Vec<Vec<f64>> = (0..n).map(|row| (0..row).map(|c| lower(row, c)).collect()).collect();
    let entry = |row: usize, column: usize| match row.cmp(&column) {
        Ordering::Equal => 1.0,
        Ordering::Greater => rows[row][column],
        Ordering::Less => rows[column][row],
    };
    (0..n).map(|row| (0..n).map(|column| entry(row, column)).collect()).collect()
}

/// An error of a pair; NaN is unknown.
pub(crate) fn error(translation_m: f64, rotation_deg: f64) -> PairError {
    PairError {
        pair: 0,
        translation_m,
        rotation_deg,
        frobenius: translation_m,
        points: [12_000; 2],
        stop: "still".into(),
        iterations: 20,
    }
}

/// Errors of 20 pairs before and after tuning.
fn pair_errors(rng: &mut Generator) -> [Vec<PairError>; 2] {
    let drawn = |rng: &mut Generator, fails: bool| {
        let t: f64 = if fails { 1.2 + 5.0 * rng.unit() } else { 0.2 + 0.6 * rng.unit() };
        error(t, t * (2.0 + 4.0 * rng.unit()))
    };
    let pair = |pair: usize| {
        let (fails, still) = (!pair.is_multiple_of(4), pair % 4 == 1);
        let [before, after] = [fails, still || pair == 8].map(|fails| drawn(rng, fails));
        let before = if pair == 5 { error(f64::NAN, f64::NAN) } else { before };
        [before, after].map(|error| PairError { pair, ..error })
    };
    let (before, after) = (0..20).map(pair).map(|[before, after]| (before, after)).unzip();
    [before, after]
}

/// One scene seen from two places: before, the source lies wrong and noisy; after, it lies right.
fn clouds(rng: &mut Generator) -> [[Cloud; 2]; 2] {
    let moved = |cloud: Cloud, yaw: f32, [dx, dy]: [f32; 2]| {
        let (s, c) = yaw.sin_cos();
        let points = cloud.points.iter();
        let moved =
            points.map(|p| Point3::new(c * p.x - s * p.y + dx, s * p.x + c * p.y + dy, p.z));
        Cloud::new(moved.collect())
    };
    let source = scan(rng, [4.6, 1.9], 0.06);
    let before = [scan(rng, [0.0, 0.0], 0.06), moved(source, 0.21, [2.4, -2.2])];
    let after =
        [scan(rng, [0.0, 0.0], 0.02), moved(scan(rng, [4.6, 1.9], 0.02), 0.012, [0.2, 0.1])];
    [before, after]
}

/// 12,000 echoes of hills, trees and two huts, denser near the sensor.
fn scan(rng: &mut Generator, [sx, sy]: [f64; 2], noise: f64) -> Cloud {
    let mut points = Vec::new();
    let mut push = |rng: &mut Generator, p: [f64; 3]| {
        points.push(Point3::from(p.map(|c| (c + noise * normal(rng)) as f32)));
    };
    for _ in 0..7000 {
        let (range, angle) = (3.0 * 14f64.powf(rng.unit()), (rng.unit() - 0.5) * 3.1);
        let (x, y) = (sx + range * angle.cos(), sy + range * angle.sin());
        push(rng, [x, y, ground(x, y)]);
    }
    for _ in 0..3600 {
        let [x, y, height] = tree((rng.unit() * 26.0) as u64);
        let up = rng.unit();
        let crown = if up < 0.3 { 0.15 } else { 1.5 * (1.25 - up) };
        let angle = rng.unit() * std::f64::consts::TAU;
        let (dx, dy) = (crown * angle.cos(), crown * angle.sin());
        push(rng, [x + dx, y + dy, ground(x, y) + height * up]);
    }
    for i in 0..1400 {
        let (cx, cy) = if i % 2 == 0 { (14.0, -7.0) } else { (22.0, 9.0) };
        let along = (rng.unit() - 0.5) * 6.0;
        let (x, y) = if i % 3 == 0 { (cx + along, cy) } else { (cx - 3.0, cy + along) };
        let z = ground(cx, cy) + 3.2 * rng.unit();
        push(rng, [x, y, z]);
    }
    Cloud::new(points)
}

fn ground(x: f64, y: f64) -> f64 {
    -2.0 + 0.9 * (x * 0.13).sin() + 0.7 * (y * 0.17 + 1.0).cos() + 0.02 * x
}

fn tree(k: u64) -> [f64; 3] {
    let mut rng = Generator::new(k, 1);
    [4.0 + 32.0 * rng.unit(), (rng.unit() - 0.5) * 46.0, 3.0 + 5.0 * rng.unit()]
}
