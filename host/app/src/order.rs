//! Flags may stand before the command's name, too: `echoloop --seed 3 evaluate`.

use std::ffi::OsString;

use clap::{Arg, Command};

/// Moves the command's name before the flags that precede it; the command refuses those it does
/// not have.
pub(super) fn command_first(root: &Command, mut arguments: Vec<OsString>) -> Vec<OsString> {
    if let Some(at) = command_at(root, &arguments) {
        arguments[1..=at].rotate_right(1);
    }
    arguments
}

/// Index of the command's name, if the flags before it are known.
fn command_at(root: &Command, arguments: &[OsString]) -> Option<usize> {
    let mut at = 1;
    loop {
        let text = arguments.get(at)?.to_str()?;
        if root.find_subcommand(text).is_some() {
            return Some(at);
        }
        let next = arguments.get(at + 1).and_then(|next| next.to_str()).unwrap_or_default();
        let is_value = !next.starts_with('-') && root.find_subcommand(next).is_none();
        at += 1 + values_after(root, text, is_value)?;
    }
}

/// Number of arguments after a flag that are its values; `None` of what is no flag of the root.
fn values_after(root: &Command, text: &str, is_value: bool) -> Option<usize> {
    if let Some(long) = text.strip_prefix("--") {
        let (name, value) = long.split_once('=').map_or((long, None), |(n, v)| (n, Some(v)));
        let flag = root.get_arguments().find(|arg| arg.get_long() == Some(name))?;
        return Some(if value.is_some() { 0 } else { values_of(flag, is_value) });
    }
    let letters = text.strip_prefix('-').filter(|letters| !letters.is_empty())?;
    for (i, letter) in letters.char_indices() {
        let flag = root.get_arguments().find(|arg| arg.get_short() == Some(letter))?;
        if flag.get_action().takes_values() {
            let is_last = i + letter.len_utf8() == letters.len();
            return Some(if is_last { values_of(flag, is_value) } else { 0 });
        }
    }
    Some(0)
}

/// Number of values of a flag; one whose value is optional takes the next argument if that can be
/// a value.
fn values_of(flag: &Arg, is_value: bool) -> usize {
    let is_optional = flag.get_num_args().is_some_and(|count| count.min_values() == 0);
    usize::from(flag.get_action().takes_values() && (!is_optional || is_value))
}

#[cfg(test)]
mod tests {
    use super::super::command;
    use super::*;

    fn ordered(line: &str) -> String {
        let arguments = line.split(' ').map(OsString::from).collect();
        let ordered = command_first(&command(), arguments);
        ordered.iter().map(|one| one.to_str().unwrap()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn flags_before_a_command_are_the_command_s() {
        for (line, expected) in [
            ("e --seed 3 evaluate --json", "e evaluate --seed 3 --json"),
            ("e --seed=3 -q evaluate", "e evaluate --seed=3 -q"),
            ("e -qc evaluate scan -o a", "e scan -qc evaluate -o a"),
            ("e -cevaluate scan", "e scan -cevaluate"),
            (
                "e --set a.b=1 --set c.d=-2 --scene tune pairs",
                "e pairs --set a.b=1 --set c.d=-2 --scene tune",
            ),
            ("e --pareto evaluate", "e evaluate --pareto"),
            ("e --pareto bits tune", "e tune --pareto bits"),
        ] {
            assert_eq!(ordered(line), expected);
        }
        for line in [
            "e",
            "e tune --seed 3",
            "e --seed 3",
            "e --seed",
            "e --magic 3 evaluate",
            "e -- evaluate",
            "e --help evaluate",
            "e conjure evaluate",
            "e --set evaluate",
        ] {
            assert_eq!(ordered(line), line);
        }
    }
}
