//! Commands and configuration of the run.

use echoloop_closed_loop::run_folder::provenance::Session;

use crate::finished_runs::FinishedRun;
use crate::format::escape;
use crate::page::{row, table};

pub(super) fn section(run: &FinishedRun) -> String {
    format!(
        "<section id=\"run\"><h2>The run</h2>{}{}</section>\n",
        commands(&run.about.sessions),
        configuration(&run.config_text)
    )
}

/// Begin, version, build and text of each command that worked on the run.
fn commands(sessions: &[Session]) -> String {
    if sessions.is_empty() {
        return "<p class=\"lead\">The run’s folder does not say who made it.</p>".to_owned();
    }
    let session = |session: &Session| {
        let build = escape(session.build.as_deref().unwrap_or("unknown"));
        let (version, command) = (escape(&session.version), escape(&session.command));
        let cells = format!(
            "<td>{version}</td><td><code>{build}</code></td><td><code>{command}</code></td>"
        );
        row(&session.begun, [cells])
    };
    let heads = ["begun, UTC", "version", "build", "command"].map(str::to_owned);
    table("sessions", "Commands", heads, &sessions.iter().map(session).collect::<String>())
}

fn configuration(text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    format!(
        "<details><summary>The whole configuration</summary><pre class=\"scroll\" tabindex=\"0\" \
         >{}</pre></details>",
        escape(text)
    )
}
