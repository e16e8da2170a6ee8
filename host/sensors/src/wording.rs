//! Settings and counters of a sensor in words.

use echoloop_dsp::{Kind, PARAMETERS, Parameter, Settings};
use echoloop_link::Counters;

/// Settings that are not the defaults.
pub fn changed_settings(settings: &Settings) -> impl Iterator<Item = &'static Parameter> {
    let (settings, usual) = (*settings, Settings::default());
    PARAMETERS.iter().filter(move |p| settings.get(p.id) != usual.get(p.id))
}

/// Settings that are not the defaults, as a sentence.
pub fn settings_text(settings: &Settings) -> String {
    let one = |p: &Parameter| {
        let text = format!("{} = {} {}", p.name, value_text(p, settings.get(p.id)), p.unit);
        text.trim_end().to_owned()
    };
    match changed_settings(settings).map(one).collect::<Vec<_>>() {
        none if none.is_empty() => "all settings are the defaults".into(),
        all if all.len() == PARAMETERS.len() => all.join(", "),
        some => format!("{}; all others are the defaults", some.join(", ")),
    }
}

/// Value of a setting in its unit, or the name of a choice; `follows` when it is not given.
pub fn value_text(parameter: &Parameter, code: Option<i32>) -> String {
    match (code, parameter.kind) {
        (None, _) => "follows".into(),
        (Some(code), Kind::Choice { names, .. }) => {
            names.get(code as usize).unwrap_or(&"?").to_string()
        }
        (Some(code), _) => parameter.to_unit(code).to_string(),
    }
}

/// Values that a setting takes, with its unit.
pub fn range_text(parameter: &Parameter) -> String {
    match parameter.kind {
        Kind::Choice { names, .. } => names.join(", "),
        Kind::PowerOfTwo => format!("1 to {}, powers of two", parameter.max),
        _ => format!(
            "{} to {} {}",
            parameter.to_unit(parameter.min),
            parameter.to_unit(parameter.max),
            parameter.unit
        ),
    }
}

/// Counters in a line; faults of the line only where they occurred.
pub fn counters_text(counters: &Counters) -> String {
    let usual = [
        (counters.frames, "frames"),
        (counters.refusals, "refused"),
        (counters.restarts, "restarts"),
    ];
    let faults = [
        (counters.crc_failures, "with a wrong checksum"),
        (counters.cobs_failures, "that were not COBS"),
        (counters.overflows, "too long"),
        (counters.unintelligible, "that were no command"),
        (counters.stale, "out of date"),
        (counters.rollbacks, "trials undone"),
        (counters.echoes, "of its own, given back by the line"),
    ];
    let shown = usual.iter().chain(faults.iter().filter(|(count, _)| *count > 0));
    shown.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_the_line_are_counted_where_they_occurred() {
        let counters = Counters { frames: 12, restarts: 1, ..Counters::default() };
        assert_eq!(counters_text(&counters), "12 frames, 0 refused, 1 restarts");
        let bad = Counters { crc_failures: 3, echoes: 2, ..counters };
        let text = "12 frames, 0 refused, 1 restarts, 3 with a wrong checksum, \
                    2 of its own, given back by the line";
        assert_eq!(counters_text(&bad), text);
    }
}
