//! `echoloop evaluate --stream`: candidates of somebody else's optimiser, a line each.
//!
//! The scene is traced once. The first line out says what is searched; then each line in is
//! answered by one line out, and what cannot be judged is an answer, too.

use std::collections::BTreeMap;
use std::io::{BufRead, Read};

use echoloop_files::{MOST_TEXT, shown};
use serde::Deserialize;
use serde_json::{Value, json};

use super::candidate::number;
use super::exit::{Failure, print};
use super::prepared::{PairSet, Prepared};
use super::progress::Progress;
use echoloop_closed_loop::parameters::{
    Axis, Parameters, Scale, ValueError, Values, choices, written, written_values,
};
use echoloop_closed_loop::search::{Judge, Observer};

/// A line of the stream, but for its `id`, which may be anything and comes back with the answer.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Candidate {
    /// By name, in their units, laid over the configuration's; as they are, or not at all.
    parameters: Option<BTreeMap<String, Value>>,
    /// Or a point of the unit cube of the axes; what joint constraints refuse is repaired.
    point: Option<Vec<f64>>,
}

/// What a line asks to be judged.
struct Asked {
    parameters: Parameters,
    repaired: Vec<&'static str>,
}

/// Why a line is not judged.
enum Refused {
    /// It is no candidate.
    Malformed(String),
    /// It is one that nothing can be scanned or registered with.
    Infeasible(String),
}

/// Answers every line of standard input, until there is none.
pub(super) fn serve(
    prepared: &Prepared,
    which: PairSet,
    progress: &Progress,
) -> Result<(), Failure> {
    let (config, bench, noisy) = (&prepared.config, prepared.bench(), prepared.pairs(which));
    progress.begin("judging the start", noisy.pairs.len() as u64);
    let done = || progress.evaluated();
    let judge = Judge::new(config, bench, prepared.hardware, &prepared.start, noisy, &done)?;
    progress.end();
    print(&line(&greeting(prepared, which)))?;
    let mut input = std::io::stdin().lock();
    let mut number = 0;
    while let Some(text) = next_line(&mut input)? {
        number += 1;
        if !text.as_ref().is_ok_and(|text| text.trim().is_empty()) {
            let answer = answer(prepared, &judge, text)?;
            print(&line(&with_line(number, answer)))?;
        }
    }
    Ok(())
}

/// One line of JSON.
fn line(document: &Value) -> String {
    format!("{document}\n")
}

fn with_line(number: usize, mut answer: Value) -> Value {
    answer["line"] = json!(number);
    answer
}

/// What is searched, and on what.
fn greeting(prepared: &Prepared, which: PairSet) -> Value {
    let axes: Vec<Value> = prepared.space.axes().iter().map(told).collect();
    json!({
        "format": 1, "sensor": prepared.sensor, "pairs": which.name(),
        "count": prepared.pairs(which).pairs.len(), "axes": axes,
        "start": prepared.space.start_point(),
    })
}

fn told(axis: &Axis) -> Value {
    let scale = match axis.scale {
        Scale::Linear => "linear",
        Scale::Log => "log",
        Scale::Integer => "integer",
        Scale::PowerOfTwo => "power-of-two",
    };
    let [min, max] = [axis.min, axis.max].map(|value| written(axis.name, value));
    json!({
        "name": axis.name, "unit": axis.unit, "scale": scale, "min": min, "max": max,
        "choices": choices(axis.name),
    })
}

/// The next line; one too long is read to its end and refused.
fn next_line(input: &mut impl BufRead) -> Result<Option<Result<String, Refused>>, Failure> {
    let fail = |error| Failure::usage(format!("cannot read standard input: {error}"));
    let mut bytes = Vec::new();
    if input.by_ref().take(MOST_TEXT).read_until(b'\n', &mut bytes).map_err(fail)? == 0 {
        return Ok(None);
    }
    if bytes.len() as u64 == MOST_TEXT && !bytes.ends_with(b"\n") {
        input.skip_until(b'\n').map_err(fail)?;
        let most = format!("the line is longer than {MOST_TEXT} bytes");
        return Ok(Some(Err(Refused::Malformed(most))));
    }
    let text = String::from_utf8(bytes);
    Ok(Some(text.map_err(|_| Refused::Malformed("the line is no UTF-8".into()))))
}

fn answer(
    prepared: &Prepared,
    judge: &Judge<'_>,
    text: Result<String, Refused>,
) -> Result<Value, Failure> {
    let (id, asked) = match text {
        Ok(text) => read(prepared, &text),
        Err(refused) => (None, Err(refused)),
    };
    let mut answer = match asked {
        Ok(asked) => judged(prepared, judge, &asked)?,
        Err(Refused::Malformed(problem)) => json!({ "error": problem }),
        Err(Refused::Infeasible(problem)) => json!({ "infeasible": problem }),
    };
    if let Some(id) = id {
        answer["id"] = id;
    }
    Ok(answer)
}

/// A line's id, and its candidate.
fn read(prepared: &Prepared, text: &str) -> (Option<Value>, Result<Asked, Refused>) {
    let malformed = |error: serde_json::Error| Refused::Malformed(shown(&error.to_string()));
    let mut document: Value = match serde_json::from_str(text) {
        Ok(document) => document,
        Err(error) => return (None, Err(malformed(error))),
    };
    let id = document.as_object_mut().and_then(|members| members.remove("id"));
    if !document.is_object() {
        return (None, Err(Refused::Malformed("expected {\"parameters\": {…}}".into())));
    }
    let asked = serde_json::from_value(document).map_err(malformed);
    (id, asked.and_then(|candidate| asked_of(prepared, candidate)))
}

fn asked_of(prepared: &Prepared, candidate: Candidate) -> Result<Asked, Refused> {
    match (candidate.parameters, candidate.point) {
        (Some(parameters), None) => by_name(prepared, parameters),
        (None, Some(point)) => by_point(prepared, &point),
        _ => Err(Refused::Malformed("expected either parameters or point".into())),
    }
}

fn by_name(prepared: &Prepared, given: BTreeMap<String, Value>) -> Result<Asked, Refused> {
    let value = |(name, given): (String, Value)| number(&name, &given).map(|value| (name, value));
    let values: Result<Values, String> = given.into_iter().map(value).collect();
    let values = values.map_err(Refused::Malformed)?;
    let (config, hardware) = (&prepared.config, &prepared.hardware);
    let parameters = prepared.start.with_values(&values, config, hardware);
    let parameters = parameters.map_err(|error| {
        let said = shown(&error.to_string());
        match error {
            ValueError::Unknown(..) => Refused::Malformed(said),
            _ => Refused::Infeasible(said),
        }
    })?;
    Ok(Asked { parameters, repaired: Vec::new() })
}

fn by_point(prepared: &Prepared, point: &[f64]) -> Result<Asked, Refused> {
    let axes = prepared.space.axes().len();
    if point.len() != axes {
        let found = point.len();
        return Err(Refused::Malformed(format!("point has {found} numbers, expected {axes}")));
    }
    if !point.iter().all(|u| (0.0..=1.0).contains(u)) {
        return Err(Refused::Infeasible("point: expected numbers from 0 to 1".into()));
    }
    let (parameters, repaired) = prepared.space.parameters(point);
    Ok(Asked { parameters, repaired })
}

fn judged(prepared: &Prepared, judge: &Judge<'_>, asked: &Asked) -> Result<Value, Failure> {
    let values = asked.parameters.values(&prepared.config);
    let parameters =
        written_values(&values, serde_json::value::Serializer).map_err(Failure::run)?;
    let (summary, fitness) = judge.judged(&asked.parameters)?;
    let mut answer = json!({ "fitness": fitness, "parameters": parameters, "summary": summary });
    if !asked.repaired.is_empty() {
        answer["repaired"] = json!(asked.repaired);
    }
    Ok(answer)
}
