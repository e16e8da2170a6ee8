//! docs/configuration.md lists the keys as the tables have them.

use std::fmt::Write as _;
use std::path::Path;

use echoloop_closed_loop::config::key_reference::{Explained, explained, said};
use echoloop_closed_loop::config::load;
use echoloop_registration::setting;

const BEGIN: &str = "<!-- written by `cargo test -p echoloop-app --test configuration`, \
    ECHOLOOP_WRITE_DOCS=1 -->\n";
const END: &str = "<!-- end of the keys -->\n";

/// Every section with its keys; settings of registration have a page of their own.
fn tables() -> String {
    let rows = explained(&load(None, &[]).expect("the defaults")).expect("they are explained");
    let (mut text, mut section) = (String::new(), None);
    for row in rows.iter().filter(|row| !is_setting(row)) {
        let (of, key) = row.key.rsplit_once('.').unwrap_or(("", row.key));
        if section != Some(of) {
            section = Some(of);
            let title =
                if of.is_empty() { "Above all sections".into() } else { format!("`[{of}]`") };
            let _ = write!(text, "\n## {title}\n\n{HEAD}");
        }
        let Explained { unit, must, help, .. } = row;
        let _ = writeln!(text, "| `{key}` | {unit} | {} | {must} | {help} |", default(row));
    }
    text
}

const HEAD: &str = "| key | unit | default | must be | what it is |\n|---|---|---|---|---|\n";

fn is_setting(row: &Explained) -> bool {
    row.key.strip_prefix("registration.").is_some_and(|key| setting(key).is_some())
}

fn default(row: &Explained) -> String {
    let others = row.other_defaults.iter().map(|other| format!("; {other}"));
    said(row.default.as_ref()) + &others.collect::<String>()
}

#[test]
fn the_documentation_lists_every_key_as_the_tables_have_it() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/configuration.md");
    let text = std::fs::read_to_string(&path).expect("docs/configuration.md");
    let (before, rest) = text.split_once(BEGIN).expect("where the tables begin");
    let (_, after) = rest.split_once(END).expect("where they end");
    let expected = format!("{before}{BEGIN}{}\n{END}{after}", tables());
    let is_written = std::env::var_os("ECHOLOOP_WRITE_DOCS").is_some();
    if is_written {
        std::fs::write(&path, &expected).expect("docs/configuration.md is written");
    }
    assert!(
        text == expected || is_written,
        "docs/configuration.md is not what the tables have; \
         with ECHOLOOP_WRITE_DOCS=1 this test writes it"
    );
}
