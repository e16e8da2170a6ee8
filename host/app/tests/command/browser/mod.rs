//! A browser without a window, to open pages in. Without Chromium it says so loudly; with `CI` set,
//! that is a failure.

use std::path::{Path, PathBuf};
use std::process::Command;

fn chromium() -> Option<PathBuf> {
    let found = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]
        .iter()
        .flat_map(|name| {
            let paths = std::env::var_os("PATH").unwrap_or_default();
            std::env::split_paths(&paths).map(|dir| dir.join(name)).collect::<Vec<_>>()
        })
        .find(|path| path.is_file());
    if found.is_none() {
        echoloop_needs::missing("no Chromium on the PATH, so nobody looked at the pages");
    }
    found
}

/// A page after its scripts ran, and the browser's output about it.
pub(crate) struct Opened {
    /// The document.
    pub(crate) dom: String,
    /// Output of the browser.
    log: String,
}

/// Opens `html` in a browser with an empty profile; nothing without a browser.
pub(crate) fn open(name: &str, html: &str, flags: &[&str]) -> Option<Opened> {
    let page = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&page, html).expect("the page is written");
    let browser = chromium()?;
    let profile = tempfile::tempdir().expect("a directory for the profile");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--enable-logging=stderr", "--window-size=1280,900", "--virtual-time-budget=10000"])
        .args(flags)
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg("--dump-dom")
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Some(Opened { dom: text(&output.stdout), log: text(&output.stderr) })
}

impl Opened {
    /// The value of `name` in the tag that opens the body.
    pub(crate) fn body(&self, name: &str) -> Option<&str> {
        let body = self.dom.split_once("<body")?.1.split_once('>')?.0;
        Some(body.split_once(&format!("{name}=\""))?.1.split_once('"')?.0)
    }

    /// The number that `name` of the body holds.
    pub(crate) fn pixels(&self, name: &str) -> u32 {
        let text = self.body(name).unwrap_or_else(|| panic!("no {name}: {}", self.log));
        text.parse().expect("a number of pixels")
    }

    /// Nobody complained.
    pub(crate) fn assert_no_complaints(&self) {
        let complaints: Vec<_> = self.log.lines().filter(|line| is_complaint(line)).collect();
        assert!(complaints.is_empty(), "the console says: {complaints:#?}");
    }

    /// The script reached its end without a complaint.
    pub(crate) fn assert_silent(&self) {
        self.assert_no_complaints();
        assert_eq!(self.body("data-error"), None);
        assert_eq!(self.body("data-ready"), Some("1"), "{}", self.log);
    }
}

/// True when a line of the console is about the page, not about drawing without a graphics card.
fn is_complaint(line: &str) -> bool {
    let is_driver = line.contains("software WebGL") || line.contains("GL Driver Message");
    line.contains("CONSOLE") && !is_driver
}
