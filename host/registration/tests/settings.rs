//! docs/settings.md lists the settings as the table has them.

use std::fmt::Write as _;
use std::path::Path;

use echoloop_parameters::Scale;
use echoloop_registration::config::Range;
use echoloop_registration::{Method, MethodConfig, SETTINGS, Setting};

const BEGIN: &str = "<!-- written by `cargo test -p echoloop-registration --test settings`, \
    ECHOLOOP_WRITE_DOCS=1 -->\n";
const END: &str = "<!-- end of the settings -->\n";

/// Meanings of all settings.
fn meanings() -> String {
    let mut text = String::from("| setting | what it is |\n|---|---|\n");
    for setting in SETTINGS {
        let _ = writeln!(text, "| `{}` | {} |", setting.key, setting.help);
    }
    text
}

/// Defaults of all settings in each method, and their bounds.
fn settings() -> String {
    let names = Method::ALL.map(Method::name);
    let mut text = format!("| setting | unit | {} | bounds |\n", names.join(" | "));
    let _ = writeln!(text, "|---|---|{}---|", "---|".repeat(names.len()));
    for setting in SETTINGS {
        let defaults = Method::ALL.map(|method| default(setting, method)).join(" | ");
        let (key, unit) = (setting.key, setting.unit);
        let _ = writeln!(text, "| `{key}` | {unit} | {defaults} | {} |", setting.bounds());
    }
    text
}

fn default(setting: &Setting, method: Method) -> String {
    match (setting.of(method), MethodConfig::outdoor(method).get(setting.key)) {
        (None, _) => "–".into(),
        (Some(_), None) => "none".into(),
        (Some(_), Some(value)) if value < 1e-3 => format!("{value:e}"),
        (Some(_), Some(value)) => value.to_string(),
    }
}

/// All axes of a search, methods that share one together.
fn axes() -> String {
    let mut text = String::from("| axis | symbol | method | `outdoor` | `paper` | starts at |\n");
    text += "|---|---|---|---|---|---|\n";
    for setting in SETTINGS {
        let mut rows: Vec<([String; 2], Vec<&str>)> = Vec::new();
        for method in Method::ALL {
            let Some(search) = setting.of(method).and_then(|of| of.search) else { continue };
            let outdoor = MethodConfig::outdoor(method).get(setting.key).unwrap_or(f64::NAN);
            let (paper, start) = search
                .paper
                .map_or(("none".into(), "none".into()), |(r, at)| (range(r), at.to_string()));
            let ranges = format!("{} | {paper} | {outdoor}, {start}", range(search.outdoor));
            let row = [search.symbol.to_owned(), ranges];
            match rows.iter_mut().find(|(of, _)| *of == row) {
                Some((_, methods)) => methods.push(method.name()),
                None => rows.push((row, vec![method.name()])),
            }
        }
        for ([symbol, ranges], methods) in rows {
            let (key, methods) = (setting.key, methods.join(", "));
            let _ = writeln!(text, "| `{key}` | {symbol} | {methods} | {ranges} |");
        }
    }
    text
}

fn range(Range { min, max, scale }: Range) -> String {
    let spacing = if scale == Scale::Log { ", log" } else { "" };
    format!("{min} to {max}{spacing}")
}

#[test]
fn the_documentation_lists_every_setting_as_the_table_has_it() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/settings.md");
    let text = std::fs::read_to_string(&path).expect("docs/settings.md");
    let (before, rest) = text.split_once(BEGIN).expect("where the tables begin");
    let (_, after) = rest.split_once(END).expect("where they end");
    let expected =
        format!("{before}{BEGIN}\n{}\n{}\n{}\n{END}{after}", meanings(), settings(), axes());
    if std::env::var_os("ECHOLOOP_WRITE_DOCS").is_some() {
        std::fs::write(&path, &expected).expect("docs/settings.md is written");
    }
    assert!(
        text == expected || std::env::var_os("ECHOLOOP_WRITE_DOCS").is_some(),
        "docs/settings.md is not what the table has; \
         with ECHOLOOP_WRITE_DOCS=1 this test writes it"
    );
}
