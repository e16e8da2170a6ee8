//! What a report is made of. Values that are not finite mean "unknown" or "nothing found"
//! everywhere.

pub(crate) mod clouds;
pub(crate) mod convergence;
pub(crate) mod correlation;
pub(crate) mod cost;
pub(crate) mod evaluation;
pub(crate) mod front;
pub(crate) mod identity;
pub(crate) mod importance;
pub(crate) mod pairs;
pub(crate) mod trajectories;

use crate::error::ReportError;

/// Everything the page shows.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The page's heading.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// Name and value of what identifies the run: scene, seed, method, protocol, generations…
    pub facts: Vec<(String, String)>,
    /// Who made the run, when, how.
    pub identity: Identity,
    /// Default against tuned on the test pairs.
    pub table: EvaluationTable,
    /// What a scan costs.
    pub costs: Costs,
    /// Error against a cost.
    pub front: Front,
    /// Fitness and step size by generation.
    pub convergence: Convergence,
    /// One trace for each tuned parameter.
    pub parameters: Vec<ParameterTrace>,
    /// What mattered.
    pub importance: Importance,
    /// Correlations of the search distribution at the end.
    pub correlation: Option<Correlation>,
    /// Errors of each test pair, default against tuned.
    pub pair_errors: Vec<PairError>,
    /// One pair's clouds in their estimated poses.
    pub clouds: Option<PairClouds>,
    /// Remarks, a paragraph each.
    pub notes: Vec<String>,
}

/// What identifies a run besides its result.
#[derive(Clone, Debug, Default)]
pub struct Identity {
    /// Of each command that worked on it: when it began (UTC), the program's version, its build,
    /// and the command itself.
    pub sessions: Vec<[String; 4]>,
    /// The whole configuration, as a file has it.
    pub configuration: String,
}

/// How far an estimated pose is from the truth. Not finite when registration found nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseError {
    /// Length of the difference of translations.
    pub translation_m: f64,
    /// Angle of the difference of rotations.
    pub rotation_deg: f64,
}

impl Default for PoseError {
    /// Unknown.
    fn default() -> Self {
        Self { translation_m: f64::NAN, rotation_deg: f64::NAN }
    }
}

impl PoseError {
    /// Whether both parts are within `bound`. An unknown error is not, nor is any when the bound is
    /// unknown.
    #[must_use]
    pub fn is_within(&self, bound: &Self) -> bool {
        self.translation_m <= bound.translation_m && self.rotation_deg <= bound.rotation_deg
    }
}

/// Figures for each way to set the parameters, on the same test pairs.
#[derive(Clone, Debug, Default)]
pub struct EvaluationTable {
    /// The first [`RowKind::Default`] row is what others are compared with; the first
    /// [`RowKind::Tuned`] row is the headline's.
    pub rows: Vec<EvaluationRow>,
    /// A registration counts as a success when both errors are within this.
    pub success_within: PoseError,
}

impl EvaluationTable {
    fn first(&self, kind: RowKind) -> Option<&EvaluationRow> {
        self.rows.iter().find(|row| row.kind == kind)
    }

    /// The rows that the headline compares.
    pub(super) fn both(&self) -> Option<(&EvaluationRow, &EvaluationRow)> {
        self.first(RowKind::Default).zip(self.first(RowKind::Tuned))
    }
}

/// What a row of the table stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowKind {
    /// The parameters before tuning.
    #[default]
    Default,
    /// After tuning; differences from the default row are shown.
    Tuned,
    /// Figures from elsewhere, such as the paper's; shown without differences.
    Reference,
}

/// One row of the [`EvaluationTable`].
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluationRow {
    /// Name of the row, such as "tuned, joint".
    pub label: String,
    /// What the row stands for.
    pub kind: RowKind,
    /// Number of test pairs, if known.
    pub pairs: Option<usize>,
    /// Share of pairs that succeeded, 0 to 100.
    pub recall_pct: f64,
    /// Mean translation error over the successes.
    pub mean_translation_cm: f64,
    /// Mean rotation error over the successes.
    pub mean_rotation_deg: f64,
    /// Median translation error over all pairs.
    pub median_translation_cm: f64,
    /// Median rotation error over all pairs.
    pub median_rotation_deg: f64,
    /// The 95 % intervals of the five figures above, in their order.
    pub intervals: [[f64; 2]; 5],
    /// How the five differ from the default row's on the same pairs, if that is known.
    pub gain: Option<[Difference; 5]>,
}

/// A difference from the default row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// This row's figure less the default's.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Whether it is more than chance could do.
    pub is_shown: bool,
}

impl Default for EvaluationRow {
    /// A row about which nothing is known.
    fn default() -> Self {
        Self {
            label: String::new(),
            kind: RowKind::Default,
            pairs: None,
            recall_pct: f64::NAN,
            mean_translation_cm: f64::NAN,
            mean_rotation_deg: f64::NAN,
            median_translation_cm: f64::NAN,
            median_rotation_deg: f64::NAN,
            intervals: [[f64::NAN; 2]; 5],
            gain: None,
        }
    }
}

/// What a scan costs, in words: a column for each cost.
#[derive(Clone, Debug, Default)]
pub struct Costs {
    /// Names of the costs.
    pub heads: Vec<String>,
    /// Name of a row, and its cells.
    pub rows: Vec<(String, Vec<String>)>,
    /// What the difference comes to, a sentence.
    pub verdict: String,
}

/// A front of error against a cost.
#[derive(Clone, Debug, Default)]
pub struct Front {
    /// Name of the cost, as in a sentence.
    pub name: String,
    /// Title of its axis, with its unit.
    pub axis: String,
    /// What the front comes to, a sentence.
    pub verdict: String,
    /// The parameters before tuning.
    pub default: FrontDot,
    /// Those tuned for the error alone.
    pub tuned: FrontDot,
    /// The points, cheapest first.
    pub points: Vec<FrontDot>,
}

/// One set of parameters on a front's plot.
#[derive(Clone, Debug, Default)]
pub struct FrontDot {
    /// What it costs.
    pub cost: f64,
    /// The same in words.
    pub cost_text: String,
    /// Its error.
    pub error: f64,
    /// The error's 95 % interval.
    pub interval: [f64; 2],
    /// Share of pairs that succeed, 0 to 100.
    pub recall_pct: f64,
    /// Median translation error over all pairs.
    pub median_translation_cm: f64,
    /// How its error differs from the default's, in words.
    pub against_default: String,
}

/// Fitness (lower is better) and step size by generation. Each series is as long as `generation`,
/// or empty.
#[derive(Clone, Debug, Default)]
pub struct Convergence {
    /// Numbers of the generations, rising.
    pub generation: Vec<u32>,
    /// Best candidate of the generation.
    pub best: Vec<f64>,
    /// Lower quartile of the population.
    pub lower_quartile: Vec<f64>,
    /// Median of the population.
    pub median: Vec<f64>,
    /// Upper quartile of the population.
    pub upper_quartile: Vec<f64>,
    /// Fitness at the distribution's mean; not finite where it was not evaluated.
    pub mean_point: Vec<f64>,
    /// Fitness on held-out pairs that steer nothing; not finite where it was not evaluated.
    pub held_out: Vec<f64>,
    /// Step size σ of the search, in widths of the unit cube.
    pub sigma: Vec<f64>,
    /// Fitness of the default parameters on the training pairs.
    pub default_fitness: Option<f64>,
    /// What fitness is and its unit, such as "mean ‖T − T*‖ over 10 training pairs".
    pub fitness_name: String,
}

/// One parameter over the generations, in real units.
#[derive(Clone, Debug, Default)]
pub struct ParameterTrace {
    /// Its name, such as `voxel`.
    pub name: String,
    /// Its unit, such as `m`; empty when it has none.
    pub unit: String,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Whether it was searched, and is drawn, on a logarithmic axis.
    pub log: bool,
    /// Names of its values, from 0, when it is a choice; else none.
    pub choices: &'static [&'static str],
    /// Value before tuning.
    pub default: f64,
    /// Value after tuning.
    pub tuned: f64,
    /// The distribution's mean, one for each of [`Convergence::generation`].
    pub mean: Vec<f64>,
    /// Mean minus one standard deviation, mapped to real units after the subtraction (the search
    /// may be logarithmic).
    pub low: Vec<f64>,
    /// Mean plus one standard deviation, likewise.
    pub high: Vec<f64>,
}

/// Which parameters mattered, as the candidates themselves say.
#[derive(Clone, Debug, Default)]
pub struct Importance {
    /// What was found, or why nothing can be said.
    pub verdict: String,
    /// The parameters, most important first.
    pub bars: Vec<Bar>,
    /// Fitness along the most important ones.
    pub slices: Vec<Slice>,
    /// Why the chosen point lies where the search did not end: what it is, then a sentence for each
    /// parameter.
    pub chosen: Vec<String>,
}

/// The importance of a parameter.
#[derive(Clone, Debug, Default)]
pub struct Bar {
    /// The parameter.
    pub name: String,
    /// Share of the variation, 0 to 1.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Whether that is more than chance.
    pub is_shown: bool,
}

/// Fitness along a parameter, all others as chosen.
#[derive(Clone, Debug, Default)]
pub struct Slice {
    /// The parameter.
    pub name: String,
    /// Its unit; empty when it has none.
    pub unit: String,
    /// Whether it is drawn on a logarithmic axis.
    pub log: bool,
    /// Names of its values, from 0, when it is a choice; else none.
    pub choices: &'static [&'static str],
    /// Where the curve is known.
    pub at: Vec<f64>,
    /// Fitness over that of the chosen point.
    pub ratio: Vec<f64>,
    /// The band around it, from and to.
    pub band: [Vec<f64>; 2],
    /// Candidates: value and ratio.
    pub dots: Vec<[f64; 2]>,
    /// The chosen value.
    pub chosen: f64,
}

/// Correlations of the search distribution, `D^-1/2 C D^-1/2`.
#[derive(Clone, Debug, Default)]
pub struct Correlation {
    /// One name for each row and column.
    pub names: Vec<String>,
    /// Square and symmetric; only the lower triangle is drawn.
    pub matrix: Vec<Vec<f64>>,
    /// Share of the covariance the run can have replaced at most,
    /// `1 − (1 − c_1 − c_µ)^generations`, if known.
    pub covariance_learned: Option<f64>,
}

/// Errors of one test pair under both settings.
#[derive(Clone, Debug, Default)]
pub struct PairError {
    /// Name of the pair.
    pub label: String,
    /// With the default parameters.
    pub default: PoseError,
    /// With the tuned parameters.
    pub tuned: PoseError,
}

/// One pair twice: as the default and as the tuned parameters measure and align it.
#[derive(Clone, Debug, Default)]
pub struct PairClouds {
    /// Name of the pair.
    pub label: String,
    /// Target and source under the default parameters, both in the target's frame, the source in
    /// its estimated pose.
    pub before: [CloudLayer; 2],
    /// The same under the tuned parameters.
    pub after: [CloudLayer; 2],
    /// Error of the pose in `before`.
    pub before_error: PoseError,
    /// Error of the pose in `after`.
    pub after_error: PoseError,
}

/// A cloud in the target's frame, metres, z up. Points that are not finite are left out, and of
/// more than [`MAX_LAYER_POINTS`](super::MAX_LAYER_POINTS) an even selection is shown.
#[derive(Clone, Debug, Default)]
pub struct CloudLayer {
    /// Points x, y, z.
    pub points: Vec<[f32; 3]>,
    /// Intensity of each point, 0 to 1; may be empty.
    pub intensity: Vec<f32>,
}

impl Report {
    /// Refuses series that do not fit together.
    pub(super) fn check(&self) -> Result<(), ReportError> {
        self.convergence.check()?;
        let generations = self.convergence.generation.len();
        for trace in &self.parameters {
            trace.check(generations)?;
        }
        for slice in &self.importance.slices {
            slice.check()?;
        }
        if let Some(correlation) = &self.correlation {
            correlation.check()?;
        }
        self.clouds.as_ref().map_or(Ok(()), PairClouds::check)
    }
}

impl Convergence {
    fn check(&self) -> Result<(), ReportError> {
        let series = [
            ("best fitness", &self.best),
            ("lower quartile", &self.lower_quartile),
            ("median fitness", &self.median),
            ("upper quartile", &self.upper_quartile),
            ("fitness at the mean", &self.mean_point),
            ("held-out fitness", &self.held_out),
            ("sigma", &self.sigma),
        ];
        series.iter().try_for_each(|(name, values)| {
            optional_length(name, values.len(), self.generation.len(), "generations")
        })
    }
}

impl ParameterTrace {
    fn check(&self, generations: usize) -> Result<(), ReportError> {
        [("mean", &self.mean), ("low", &self.low), ("high", &self.high)].iter().try_for_each(
            |(name, values)| {
                let series = format!("{name} of {}", self.name);
                optional_length(&series, values.len(), generations, "generations")
            },
        )
    }
}

impl Slice {
    fn check(&self) -> Result<(), ReportError> {
        let series = [("curve", &self.ratio), ("band", &self.band[0]), ("band", &self.band[1])];
        series.iter().try_for_each(|(name, values)| {
            length(&format!("{name} of {}", self.name), values.len(), self.at.len(), "places")
        })
    }
}

impl Correlation {
    fn check(&self) -> Result<(), ReportError> {
        let names = self.names.len();
        length("correlation matrix", self.matrix.len(), names, "names")?;
        self.matrix
            .iter()
            .try_for_each(|row| length("row of the correlation matrix", row.len(), names, "names"))
    }
}

impl PairClouds {
    fn check(&self) -> Result<(), ReportError> {
        self.before.iter().chain(&self.after).try_for_each(|layer| {
            optional_length("intensity", layer.intensity.len(), layer.points.len(), "points")
        })
    }
}

fn optional_length(series: &str, found: usize, count: usize, of: &str) -> Result<(), ReportError> {
    if found == 0 {
        return Ok(());
    }
    length(series, found, count, of)
}

fn length(series: &str, found: usize, count: usize, of: &str) -> Result<(), ReportError> {
    if found == count {
        return Ok(());
    }
    Err(ReportError::Length { series: series.to_owned(), expected: format!("{count} {of}"), found })
}
