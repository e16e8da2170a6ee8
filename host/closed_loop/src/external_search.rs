//! Protocol of `evaluate --stream`: candidates of another program's optimiser, one JSON document a
//! line.
//!
//! The pairs are traced once. The greeting lists the axes of the search; then each line in gets
//! one line out. A line that cannot be evaluated is answered, too: `{"error": …}` if it is no
//! candidate, `{"infeasible": …}` if nothing can be scanned or registered with it.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Read};

use echoloop_files::{MOST_TEXT, one_line};
use serde::Deserialize;
use serde_json::{Value, json};
use thiserror::Error;

use crate::parameters::{
    Axis, Parameters, ValueError, candidate_values, choices, values_json, written,
};
use crate::prepared::{PairSet, Prepared};
use crate::search::{Judge, Started};
use echoloop_sensors::sensor::SensorError;

/// Evaluation of candidates that cannot go on.
#[derive(Debug, Error)]
pub enum ExternalSearchError {
    /// The sensor failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The lines cannot be read.
    #[error("cannot read standard input: {0}")]
    Input(#[from] io::Error),
}

/// A line, but for its `id`, which may be anything and comes back with the answer.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Candidate {
    /// Parameters by name in their units, laid over the configuration's; as they are, or refused.
    parameters: Option<BTreeMap<String, Value>>,
    /// Or a point of the unit cube of the axes; joint constraints are repaired.
    point: Option<Vec<f64>>,
}

/// Parameters of a line, and the names of those that were repaired.
type Asked = (Parameters, Vec<&'static str>);

/// A line that cannot be evaluated.
enum Refused {
    /// It is no candidate.
    Malformed(String),
    /// Nothing can be scanned or registered with it.
    Infeasible(String),
}

/// Evaluates candidates line by line.
pub struct ExternalSearch<'a> {
    prepared: &'a Prepared,
    judge: Judge<'a>,
    which: PairSet,
    /// Lines read.
    lines: usize,
}

impl<'a> ExternalSearch<'a> {
    /// Evaluates the start, with which costs are compared. `done` hears of each pair.
    pub fn new(
        prepared: &'a Prepared,
        which: PairSet,
        done: &(dyn Fn() + Sync),
    ) -> Result<Self, SensorError> {
        Ok(Self { prepared, judge: Judge::new(prepared, which, done)?, which, lines: 0 })
    }

    /// A search like the one whose [`ExternalSearch::started`] this is.
    pub fn against(prepared: &'a Prepared, which: PairSet, start: Started) -> Self {
        Self { prepared, judge: Judge::against(prepared, which, start), which, lines: 0 }
    }

    /// Results of the start.
    pub fn started(&self) -> Started {
        self.judge.started()
    }

    /// Answer to a line.
    pub fn answer_to(&self, line: &str) -> Result<Value, SensorError> {
        self.answer(Ok(line.to_owned()))
    }

    /// First line out: sensor, pairs, axes and start.
    pub fn greeting(&self) -> Value {
        let Self { prepared, which, .. } = *self;
        let axes: Vec<Value> = prepared.space.axes().iter().map(axis_json).collect();
        json!({
            "format": 1, "sensor": prepared.sensor, "pairs": which.name(),
            "count": prepared.pairs(which).pairs.len(), "axes": axes,
            "start": prepared.space.start_point(),
        })
    }

    /// Answer to the next line that is not blank; none at the end of the input.
    pub fn next(&mut self, input: &mut impl BufRead) -> Result<Option<Value>, ExternalSearchError> {
        while let Some(text) = next_line(input)? {
            self.lines += 1;
            if !text.as_ref().is_ok_and(|text| text.trim().is_empty()) {
                let mut answer = self.answer(text)?;
                answer["line"] = json!(self.lines);
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    fn answer(&self, text: Result<String, Refused>) -> Result<Value, SensorError> {
        let (id, asked) = match text {
            Ok(text) => self.read(&text),
            Err(refused) => (None, Err(refused)),
        };
        let mut answer = match asked {
            Ok(asked) => self.judged(&asked)?,
            Err(Refused::Malformed(problem)) => json!({ "error": problem }),
            Err(Refused::Infeasible(problem)) => json!({ "infeasible": problem }),
        };
        if let Some(id) = id {
            answer["id"] = id;
        }
        Ok(answer)
    }

    /// A line's id, and its candidate.
    fn read(&self, text: &str) -> (Option<Value>, Result<Asked, Refused>) {
        let malformed = |error: serde_json::Error| Refused::Malformed(one_line(&error.to_string()));
        let mut document: Value = match serde_json::from_str(text) {
            Ok(document) => document,
            Err(error) => return (None, Err(malformed(error))),
        };
        let id = document.as_object_mut().and_then(|members| members.remove("id"));
        if !document.is_object() {
            return (None, Err(Refused::Malformed("expected {\"parameters\": {…}}".into())));
        }
        let candidate = serde_json::from_value(document).map_err(malformed);
        let asked = candidate.and_then(|candidate: Candidate| {
            match (candidate.parameters, candidate.point) {
                (Some(parameters), None) => self.by_name(parameters),
                (None, Some(point)) => self.by_point(&point),
                _ => Err(Refused::Malformed("expected either parameters or point".into())),
            }
        });
        (id, asked)
    }

    fn by_name(&self, given: BTreeMap<String, Value>) -> Result<Asked, Refused> {
        let values = candidate_values(given).map_err(Refused::Malformed)?;
        let Prepared { config, device, start, .. } = self.prepared;
        let parameters = start.with_values(&values, config, device).map_err(|error| {
            let problem = one_line(&error.to_string());
            match error {
                ValueError::Unknown(..) => Refused::Malformed(problem),
                _ => Refused::Infeasible(problem),
            }
        })?;
        Ok((parameters, Vec::new()))
    }

    fn by_point(&self, point: &[f64]) -> Result<Asked, Refused> {
        let (space, found) = (&self.prepared.space, point.len());
        let axes = space.axes().len();
        if found != axes {
            return Err(Refused::Malformed(format!("point has {found} numbers, expected {axes}")));
        }
        if !point.iter().all(|u| (0.0..=1.0).contains(u)) {
            return Err(Refused::Infeasible("point: expected numbers from 0 to 1".into()));
        }
        Ok(space.parameters(point))
    }

    fn judged(&self, (parameters, repaired): &Asked) -> Result<Value, SensorError> {
        let values = parameters.values(&self.prepared.config);
        let (summary, fitness) = self.judge.evaluate(parameters, &|| ())?;
        let mut answer = json!({
            "fitness": fitness, "parameters": values_json(&values), "summary": summary,
        });
        if !repaired.is_empty() {
            answer["repaired"] = json!(repaired);
        }
        Ok(answer)
    }
}

fn axis_json(axis: &Axis) -> Value {
    let [min, max] = [axis.min, axis.max].map(|value| written(axis.name, value));
    json!({
        "name": axis.name, "unit": axis.unit, "scale": axis.scale, "min": min, "max": max,
        "choices": choices(axis.name),
    })
}

/// The next line; one too long is read to its end and refused.
fn next_line(input: &mut impl BufRead) -> io::Result<Option<Result<String, Refused>>> {
    let mut bytes = Vec::new();
    if input.by_ref().take(MOST_TEXT).read_until(b'\n', &mut bytes)? == 0 {
        return Ok(None);
    }
    if bytes.len() as u64 == MOST_TEXT && !bytes.ends_with(b"\n") {
        input.skip_until(b'\n')?;
        let most = format!("the line is longer than {MOST_TEXT} bytes");
        return Ok(Some(Err(Refused::Malformed(most))));
    }
    let text = String::from_utf8(bytes);
    Ok(Some(text.map_err(|_| Refused::Malformed("the line is no UTF-8".into()))))
}
