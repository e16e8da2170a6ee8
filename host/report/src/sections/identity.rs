//! Commands and configuration of the run.

use crate::finished_runs::FinishedRun;

use crate::format::escape;

/// Provenance of a run.
#[derive(Clone, Debug, Default)]
pub struct Identity {
    /// For each command that worked on the run: its begin (UTC), the program's version, its build,
    /// and the command itself.
    pub sessions: Vec<[String; 4]>,
    /// The whole configuration as TOML.
    pub configuration: String,
}

impl Identity {
    /// The commands and the configuration of a finished run.
    pub(super) fn of_run(run: &FinishedRun) -> Self {
        let sessions = run.about.sessions.iter().map(|session| {
            let build = session.build.clone().unwrap_or_else(|| "unknown".into());
            [session.begun.clone(), session.version.clone(), build, session.command.clone()]
        });
        Self { sessions: sessions.collect(), configuration: run.config_text.clone() }
    }
}

/// The commands and the configuration; empty where neither is known.
pub(super) fn section(identity: &Identity) -> String {
    if identity.sessions.is_empty() && identity.configuration.is_empty() {
        return String::new();
    }
    format!(
        "<section id=\"run\"><h2>The run</h2>{}{}</section>\n",
        commands(&identity.sessions),
        configuration(&identity.configuration)
    )
}

const HEADS: [&str; 4] = ["begun, UTC", "version", "build", "command"];

fn commands(sessions: &[[String; 4]]) -> String {
    if sessions.is_empty() {
        return "<p class=\"lead\">The run’s folder does not say who made it.</p>".to_owned();
    }
    let heads: String = HEADS.iter().map(|head| format!("<th scope=\"col\">{head}</th>")).collect();
    let rows: String = sessions.iter().map(row).collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Commands\"><table \
         class=\"sessions\"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )
}

fn row(session: &[String; 4]) -> String {
    let [begun, version, build, command] = session.each_ref().map(|text| escape(text));
    format!(
        "<tr><th scope=\"row\">{begun}</th><td>{version}</td><td><code>{build}</code></td>\
         <td><code>{command}</code></td></tr>"
    )
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_and_configuration_stand_on_the_page_escaped() {
        let session = ["2026-11-22T17:00:00Z", "0.1.0", "c0ffee", "echoloop tune --set 'a<b'"];
        let identity = Identity {
            sessions: vec![session.map(str::to_owned)],
            configuration: "seed = 1\n[tune]\ngenerations = 30\n".into(),
        };
        let html = section(&identity);
        assert!(html.contains("<th scope=\"row\">2026-11-22T17:00:00Z</th><td>0.1.0</td>"));
        assert!(html.contains("<code>echoloop tune --set &#39;a&lt;b&#39;</code>"));
        assert!(html.contains("<details><summary>The whole configuration</summary>"));
        assert!(html.contains(">seed = 1\n[tune]\ngenerations = 30\n</pre>"));
        assert_eq!(section(&Identity::default()), "");
    }
}
