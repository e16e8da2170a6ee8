//! Record of each pair, and the tally of all.

use std::fmt::{Display, Formatter};

use echoloop_clouds::Pose;
use echoloop_clouds::pose::{rotation_error_deg, to_rows, translation_error_m};
use echoloop_registration::Outcome;
use serde::{Deserialize, Serialize};

/// One pair: what was found, or why it could not be tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Name of the pair.
    pub name: String,
    /// File of the target.
    pub target: String,
    /// File of the source.
    pub source: String,
    /// True when the motion can be trusted, as far as the clouds tell.
    pub converged: bool,
    /// Why the registration ended, in words; why the pair could not be tried.
    pub stop: String,
    /// Rows of the motion; none of a pair that could not be tried.
    pub target_from_source: Option<[[f64; 4]; 4]>,
    /// Steps taken.
    pub iterations: usize,
    /// Pairs of points in the last step.
    pub pairs: usize,
    /// Root mean square distance of those, m.
    pub rmse_m: f64,
    /// Share of the points whose place the other cloud knows that lie on it.
    pub supported: Option<f64>,
    /// Share of the points whose place the other cloud knows.
    pub known: Option<f64>,
    /// Lead over the same motion slid by a little, standard deviations.
    pub lead: Option<f64>,
    /// Distance from the truth, m, where it is known.
    pub translation_error_m: Option<f64>,
    /// Angle from the truth, degrees.
    pub rotation_error_deg: Option<f64>,
}

/// First line of a table of records.
pub const CSV_HEADING: &str = "name,target,source,converged,stop,x_m,y_m,z_m,qx,qy,qz,qw,\
                               iterations,pairs,rmse_m,supported,known,lead,translation_error_m,\
                               rotation_error_deg\n";

impl Record {
    pub(crate) fn of([name, target, source]: [String; 3], outcome: &Outcome, found: &Pose) -> Self {
        let rows = to_rows(found);
        let overlap = outcome.overlap;
        Self {
            name,
            target,
            source,
            converged: outcome.stop.is_success(),
            stop: outcome.stop.to_string(),
            target_from_source: Some(std::array::from_fn(|row| {
                std::array::from_fn(|column| rows[4 * row + column])
            })),
            iterations: outcome.iterations,
            pairs: outcome.pairs,
            rmse_m: outcome.rmse_m,
            supported: overlap.map(|overlap| overlap.supported()),
            known: overlap.map(|overlap| overlap.known()),
            lead: outcome.lead,
            translation_error_m: None,
            rotation_error_deg: None,
        }
    }

    /// The record under the names that its pair and files have now.
    pub(crate) fn named(self, [name, target, source]: [String; 3]) -> Self {
        Self { name, target, source, ..self }
    }

    /// The record with the errors of its motion, or without any where the truth is not known.
    pub(crate) fn judged(self, truth: Option<&Pose>) -> Self {
        let both = self.motion().zip(truth);
        Self {
            translation_error_m: both.map(|(found, truth)| translation_error_m(&found, truth)),
            rotation_error_deg: both.map(|(found, truth)| rotation_error_deg(&found, truth)),
            ..self
        }
    }

    pub(crate) fn untried([name, target, source]: [String; 3], why: String) -> Self {
        Self {
            name,
            target,
            source,
            converged: false,
            stop: why,
            target_from_source: None,
            iterations: 0,
            pairs: 0,
            rmse_m: 0.0,
            supported: None,
            known: None,
            lead: None,
            translation_error_m: None,
            rotation_error_deg: None,
        }
    }

    /// Motion found.
    pub fn motion(&self) -> Option<Pose> {
        let rows = self.target_from_source?;
        echoloop_clouds::pose::from_rows(&std::array::from_fn(|i| rows[i / 4][i % 4])).ok()
    }

    /// True of a pair that could not be tried.
    pub fn is_untried(&self) -> bool {
        self.target_from_source.is_none()
    }

    /// True within 0.5 m and 2.5° of the truth; None without one.
    pub fn succeeds(&self) -> Option<bool> {
        let (m, deg) = (self.translation_error_m?, self.rotation_error_deg?);
        Some(self.converged && m <= 0.5 && deg <= 2.5)
    }

    /// A line of JSON.
    pub fn to_json(&self) -> String {
        // Numbers and texts alone: it is always written.
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }

    /// A line of the table under [`CSV_HEADING`].
    pub fn to_csv(&self) -> String {
        let number = |of: Option<f64>| of.map(|of| of.to_string()).unwrap_or_default();
        let motion = self.motion().map(|motion| {
            let ([x, y, z], q) = (motion.translation.vector.into(), motion.rotation.coords);
            [x, y, z, q.x, q.y, q.z, q.w]
        });
        let motion = (0..7).map(|i| number(motion.map(|motion| motion[i])));
        let head = [&self.name, &self.target, &self.source].map(String::clone);
        let head = head.into_iter().chain([self.converged.to_string(), self.stop.clone()]);
        let of_fit = [self.iterations.to_string(), self.pairs.to_string(), self.rmse_m.to_string()];
        let rest = [
            self.supported,
            self.known,
            self.lead,
            self.translation_error_m,
            self.rotation_error_deg,
        ];
        let mut writer = csv::Writer::from_writer(Vec::new());
        let cells = head.chain(motion).chain(of_fit).chain(rest.map(number));
        let written = writer.write_record(cells).ok().and_then(|()| writer.into_inner().ok());
        String::from_utf8(written.unwrap_or_default()).unwrap_or_default()
    }
}

/// Index of the pair to look at: the farthest from its truth, else one that did not register, else
/// the one whose clouds agree least. None without a motion.
pub fn worst(records: &[Record]) -> Option<usize> {
    let badness = |record: &Record| {
        let error = record.translation_error_m.unwrap_or_default();
        (error, f64::from(u8::from(!record.converged)), 1.0 - record.supported.unwrap_or_default())
    };
    let tried = (0..records.len()).filter(|&index| !records[index].is_untried());
    tried.max_by(|&a, &b| {
        let (a, b) = (badness(&records[a]), badness(&records[b]));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    })
}

/// Number of pairs that registered, of all.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Pairs.
    pub pairs: usize,
    /// Those whose motion can be trusted.
    pub converged: usize,
    /// Those with a truth.
    pub judged: usize,
    /// Those within 0.5 m and 2.5° of it.
    pub succeed: usize,
    /// Names of those that could not be tried, with the reason.
    pub untried: Vec<String>,
}

impl Tally {
    /// Counts records.
    pub fn of(records: &[Record]) -> Self {
        let count =
            |is: &dyn Fn(&Record) -> bool| records.iter().filter(|record| is(record)).count();
        let untried = records.iter().filter(|record| record.is_untried());
        Self {
            pairs: records.len(),
            converged: count(&|record| record.converged),
            judged: count(&|record| record.succeeds().is_some()),
            succeed: count(&|record| record.succeeds() == Some(true)),
            untried: untried.map(|record| format!("{}: {}", record.name, record.stop)).collect(),
        }
    }
}

impl Display for Tally {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { pairs, converged, judged, succeed, untried } = self;
        write!(f, "{converged} of {pairs} pairs registered")?;
        if *judged > 0 {
            let recall = 100.0 * *succeed as f64 / *judged as f64;
            write!(f, "; recall {recall:.1} % of {judged}, within 0.5 m and 2.5° of the truth")?;
        }
        untried.iter().try_for_each(|why| write!(f, "\nnot tried: {why}"))
    }
}
