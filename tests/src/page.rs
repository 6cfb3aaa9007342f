//! The operators' page in headless Chromium: scripts of `web/e2e` against a running server, and what they say.

use std::path::Path;
use std::process::Stdio;

use serde_json::Value;
use tokio::process::Command;

use crate::Error;
use crate::server::Server;

/// What a script said, one JSON object a line.
#[derive(Debug)]
pub struct Said {
    /// All of it, for messages.
    pub text: String,
    events: Vec<Value>,
}

impl Said {
    /// The first event of a name; null if there is none.
    pub fn event(&self, name: &str) -> Value {
        let found = self.events.iter().find(|event| event["event"] == name);
        found.cloned().unwrap_or_default()
    }

    /// A text of the first event of a name; empty if there is none.
    pub fn words(&self, name: &str, field: &str) -> String {
        self.event(name)[field].as_str().unwrap_or_default().to_owned()
    }
}

/// Plays a script of `web/e2e` on a level, signed in as administrator, with what else it has to be told.
///
/// # Errors
/// The script cannot be started, or fails: with all that it said.
pub async fn play(
    server: &Server,
    script: &str,
    [site, level]: [&str; 2],
    settings: &[(&str, &str)],
) -> Result<Said, Error> {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web");
    let script = format!("e2e/{script}");
    let output = Command::new("node")
        .arg(&script)
        .current_dir(&web)
        .env("PAGE_URL", server.url())
        .env("TOKEN", server.admin_token())
        .env("SITE", site)
        .env("LEVEL", level)
        .envs(settings.iter().copied())
        .stdin(Stdio::null())
        .output()
        .await
        .map_err(|e| Error::file(web.join(&script), e))?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    if !output.status.success() {
        let complaint = String::from_utf8_lossy(&output.stderr);
        let told = format!("{}\n{text}{complaint}", output.status);
        return Err(Error::Script { script, told });
    }
    let events = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    Ok(Said { text, events })
}
