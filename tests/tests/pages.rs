//! Checks of README, docs and sources: every link, path and command exists, and no line is too
//! long.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Folders without pages or sources.
const BUILT: [&str; 4] = ["target", ".git", "runs", "node_modules"];

/// Endings of code spans that are files.
const ENDINGS: [&str; 8] = [".rs", ".md", ".toml", ".tsv", ".py", ".s", ".x", ".sh"];

/// Files named by pages that users make.
const MADE: [&str; 3] = ["runs/latest/report.html", "my_sensor.toml", "tuned.toml"];

/// Longest line of Rust or of a page's prose, characters.
const COLUMNS: usize = 100;

/// The one source with wider lines: its raw strings are JavaScript, a statement a line.
const SCRIPTED: &str = "host/app/tests/command/report.rs";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the workspace")
}

/// All files of the repository, relative to its root, with `/`.
fn files() -> BTreeSet<String> {
    fn walk(root: &Path, folder: &Path, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if path.is_dir() && !BUILT.contains(&name) {
                walk(root, &path, found);
            } else if path.is_file() {
                let below = path.strip_prefix(root).expect("below the root");
                found.insert(below.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    let mut found = BTreeSet::new();
    walk(&root(), &root(), &mut found);
    found
}

/// All pages with their texts.
fn pages() -> Vec<(String, String)> {
    let is_page = |path: &&String| path.ends_with(".md") && !path.starts_with("benches/peers/venv");
    let read = |path: &String| {
        (path.clone(), fs::read_to_string(root().join(path)).expect("a page is UTF-8"))
    };
    files().iter().filter(is_page).map(read).collect()
}

/// Lines of a page, each with the language of its fenced block; `None` outside.
fn lines(text: &str) -> impl Iterator<Item = (Option<&str>, &str)> {
    let mut fence = None;
    text.lines().filter_map(move |line| match line.trim_start().strip_prefix("```") {
        Some(language) => {
            fence = if fence.is_some() { None } else { Some(language) };
            None
        }
        None => Some((fence, line)),
    })
}

/// All parts of a line between two markers.
fn between<'a>(line: &'a str, open: &'a str, close: &'a str) -> Vec<&'a str> {
    line.split(open).skip(1).filter_map(|rest| rest.split(close).next()).collect()
}

/// Path from the root of a link relative to a page; `None` when it leads out of the repository.
fn resolve(page: &str, link: &str) -> Option<String> {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in link.trim_end_matches('/').split('/') {
        match part {
            "." => {}
            ".." => drop(parts.pop()?),
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

#[test]
fn every_relative_link_leads_to_a_file_or_folder() {
    for (page, text) in pages() {
        for (_, line) in lines(&text).filter(|(fence, _)| fence.is_none()) {
            for link in between(line, "](", ")") {
                let link = link.split('#').next().unwrap_or_default();
                if link.is_empty() || link.contains("://") {
                    continue;
                }
                let target = resolve(&page, link).expect("a link within the repository");
                assert!(root().join(&target).exists(), "{page}: {link}");
            }
        }
    }
}

/// Anchors that GitHub gives headings: `## Own sensor` is `#own-sensor`.
fn anchors(text: &str) -> BTreeSet<String> {
    let slug = |heading: &str| {
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.collect::<String>().to_lowercase().replace(' ', "-")
    };
    let prose = lines(text).filter(|(fence, line)| fence.is_none() && line.starts_with('#'));
    prose.map(|(_, line)| slug(line.trim_start_matches('#'))).collect()
}

#[test]
fn every_anchor_is_a_heading_of_its_page() {
    let pages: BTreeMap<String, String> = pages().into_iter().collect();
    for (page, text) in &pages {
        for (_, line) in lines(text).filter(|(fence, _)| fence.is_none()) {
            for link in between(line, "](", ")") {
                let Some((path, anchor)) = link.split_once('#') else { continue };
                let target = if path.is_empty() { Some(page.clone()) } else { resolve(page, path) };
                let Some(target) = target.and_then(|path| pages.get(&path)) else { continue };
                assert!(anchors(target).contains(anchor), "{page}: {link}");
            }
        }
    }
}

/// True when a text in a page or source is not a path, or a path that exists: from the root, from
/// the file's folder, or as the end of some file's path.
fn is_no_lost_path(files: &BTreeSet<String>, of: &str, text: &str) -> bool {
    let is_file = ENDINGS.iter().any(|end| text.strip_suffix(end).is_some_and(|r| !r.is_empty()));
    let top = |path: &str| path.split_once('/').map(|(first, _)| first.to_owned());
    let inside = top(text).is_some_and(|first| files.iter().any(|f| top(f) == Some(first.clone())));
    if !(is_file || inside) || text.contains([' ', '*', '<', '$', '…', ':']) {
        return true;
    }
    let beside = || resolve(of, text).is_some_and(|path| root().join(path).exists());
    let ends_so = |file: &String| file.ends_with(&format!("/{text}"));
    MADE.contains(&text) || root().join(text).exists() || beside() || files.iter().any(ends_so)
}

#[test]
fn every_path_in_a_code_span_of_a_page_exists() {
    let files = files();
    for (page, text) in pages() {
        for (_, line) in lines(&text).filter(|(fence, _)| fence.is_none()) {
            for span in line.split('`').skip(1).step_by(2) {
                assert!(is_no_lost_path(&files, &page, span), "{page}: `{span}`");
            }
        }
    }
}

/// Text of a source's line if it is a comment.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    Some(text.trim_start_matches(['/', '!']))
}

/// Words of a comment that look like paths, including targets of links. `p.x` is a field.
fn paths(comment: &str) -> impl Iterator<Item = &str> {
    let words = comment.split([' ', '`', '(', ')', '[', ']', ',', ';', '"']);
    let words = words.map(|word| word.trim_end_matches("'s").trim_end_matches(['.', ':']));
    words.filter(|word| ENDINGS.iter().any(|&end| end != ".x" && word.ends_with(end)))
}

#[test]
fn every_path_in_a_comment_of_a_source_exists() {
    let files = files();
    let mut lost = Vec::new();
    for source in files.iter().filter(|path| path.ends_with(".rs")) {
        let text = fs::read_to_string(root().join(source)).expect("a source is UTF-8");
        for (comment, number) in text.lines().zip(1..).filter_map(|(l, n)| Some((comment(l)?, n))) {
            let gone = paths(comment).filter(|path| !is_no_lost_path(&files, source, path));
            lost.extend(gone.map(|path| format!("{source}:{number}: {path}")));
        }
    }
    assert!(lost.is_empty(), "missing:\n{}", lost.join("\n"));
}

/// Lines of shell blocks; a line that ends in a backslash is joined with the next.
fn shell_lines(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let mut open = false;
    for (_, line) in lines(text).filter(|(fence, _)| *fence == Some("sh")) {
        let (part, more) = line.strip_suffix('\\').map_or((line, false), |part| (part, true));
        match found.last_mut().filter(|_| open) {
            Some(last) => last.push_str(part),
            None => found.push(part.to_owned()),
        }
        open = more;
    }
    found
}

/// Words of a command, up to a comment, a pipe or a redirection.
fn words(command: &str) -> Vec<&str> {
    let ends = |word: &&str| !["|", ">", "<", "&&"].contains(word) && !word.starts_with('#');
    command.split_whitespace().take_while(ends).map(|word| word.trim_matches('\'')).collect()
}

#[test]
fn every_echoloop_command_of_the_pages_is_valid() {
    let mut seen = 0;
    for (page, text) in pages() {
        for line in shell_lines(&text) {
            let line = line.replace("cargo run --release --", "echoloop");
            // The part of a pipeline that runs the program.
            let part = line.split('|').map(str::trim).find(|part| part.starts_with("echoloop "));
            let Some(command) = part.filter(|part| !part.contains('[') && !part.contains('…'))
            else {
                continue;
            };
            let result = echoloop_app::matches_of(words(command));
            assert!(result.is_ok(), "{page}: {line}\n{}", result.unwrap_err());
            seen += 1;
        }
    }
    assert!(seen > 25, "only {seen} commands");
}

/// Code spans outside fenced blocks that run the program with arguments.
fn echoloop_spans(text: &str) -> Vec<String> {
    let prose = lines(text).filter(|(fence, _)| fence.is_none());
    let spans = prose.flat_map(|(_, line)| line.split('`').skip(1).step_by(2));
    let spans = spans.map(|span| span.replace("cargo run --release --", "echoloop"));
    spans.filter(|span| span.starts_with("echoloop ") && !span.contains('[')).collect()
}

#[test]
fn every_echoloop_command_in_a_code_span_is_valid() {
    let mut seen = 0;
    for (page, text) in pages() {
        for span in echoloop_spans(&text) {
            let words = words(span.trim_end_matches('…'));
            let command = echoloop_app::command();
            // A subcommand's name alone refers to it, without its arguments.
            let named = words.len() == 2 && command.find_subcommand(words[1]).is_some();
            let result = echoloop_app::matches_of(&words);
            assert!(named || result.is_ok(), "{page}: `{span}`\n{}", result.unwrap_err());
            seen += 1;
        }
    }
    assert!(seen > 25, "only {seen} commands");
}

#[test]
fn the_porting_guide_has_a_row_for_each_function_of_a_board() {
    let read = |path| fs::read_to_string(root().join(path)).expect("a file");
    let (source, page) = (read("firmware/sensor/src/board.rs"), read("docs/porting.md"));
    let functions = between(&source, "\n    fn ", "(");
    assert!(functions.len() > 10, "{functions:?}");
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| `")).collect();
    for function in functions {
        let name = format!("`{function}`");
        let has_it = |row: &&str| row.split('|').nth(1).is_some_and(|cell| cell.contains(&name));
        assert!(rows.iter().any(has_it), "docs/porting.md: {function}");
    }
}

#[test]
fn the_readme_keeps_to_its_size_and_reaches_each_page() {
    let text = fs::read_to_string(root().join("README.md")).expect("the README");
    assert!(text.lines().count() <= 120, "{} lines", text.lines().count());
    assert!(text.split_whitespace().count() <= 950, "{} words", text.split_whitespace().count());
    for file in files().iter().filter(|f| f.starts_with("docs/") && f.ends_with(".md")) {
        assert!(text.contains(&format!("]({file})")), "the README does not lead to {file}");
    }
}

/// A source without its raw strings, with the same line numbers.
fn without_raw_strings(text: &str) -> String {
    let mut parts = text.split("r#\"");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (raw, code) = part.split_once("\"#").unwrap_or((part, ""));
        kept.extend(raw.chars().filter(|&c| c == '\n'));
        kept.push_str(code);
    }
    kept
}

/// rustfmt does not break comments and strings.
#[test]
fn no_line_of_rust_is_longer_than_100_columns() {
    let mut long = Vec::new();
    for path in files().iter().filter(|path| path.ends_with(".rs")) {
        let mut text = fs::read_to_string(root().join(path)).expect("a source is UTF-8");
        if path == SCRIPTED {
            text = without_raw_strings(&text);
        }
        let lines = text.lines().zip(1..).filter(|(line, _)| line.chars().count() > COLUMNS);
        long.extend(lines.map(|(line, number)| format!("{path}:{number}: {line}")));
    }
    assert!(long.is_empty(), "above {COLUMNS} columns:\n{}", long.join("\n"));
}

/// True when a page's line may be longer: a table's row, a heading, indented code, only code spans,
/// or a single word, like a link.
fn stays_whole(line: &str) -> bool {
    let outside: String = line.split('`').step_by(2).collect();
    line.starts_with(['|', '#'])
        || line.starts_with("    ")
        || !outside.contains(char::is_alphanumeric)
        || line.split_whitespace().filter(|word| !["-", "*", ">"].contains(word)).count() == 1
}

#[test]
fn no_line_of_a_page_s_prose_is_longer_than_100_columns() {
    let mut long = Vec::new();
    for (page, text) in pages() {
        let mut fenced = false;
        for (line, number) in text.lines().zip(1..) {
            fenced ^= line.trim_start().starts_with("```");
            if !fenced && !stays_whole(line) && line.chars().count() > COLUMNS {
                long.push(format!("{page}:{number}: {line}"));
            }
        }
    }
    assert!(long.is_empty(), "above {COLUMNS} columns:\n{}", long.join("\n"));
}
