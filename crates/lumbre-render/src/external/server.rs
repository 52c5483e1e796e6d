//! Client of the line protocol for servers, version 1; `docs/reference/external.md` describes it.

use std::path::Path;
use std::time::{Duration, Instant};

use super::clock::check_seconds;
use super::process::{Patience, Process, Talk};
use super::{Access, failed, interrupted, with_output};
use crate::RenderError;

/// Version of the protocol that this program speaks.
const VERSION: &str = "1";

/// A program that renders the waves of a run as they are requested.
pub(super) struct Server {
    process: Process,
    /// Greatest time for a reply.
    timeout: Duration,
}

impl Server {
    /// Starts a server and waits until it has loaded its scene. Returns it with the line about its
    /// device and program, empty if it sends none.
    pub(super) fn start(
        words: &[String],
        timeout: Duration,
        access: &Access<'_>,
    ) -> Result<(Server, String), RenderError> {
        let process = Process::start(words, Talk::Lines).map_err(failed)?;
        let mut server = Server { process, timeout };
        let ready = server.reply(access.cancelled)?;
        let mut parts = ready.splitn(3, ' ');
        match (parts.next(), parts.next(), parts.next()) {
            (Some("ready"), Some(VERSION), device) => {
                let device = device.unwrap_or_default().trim().to_owned();
                Ok((server, device))
            }
            (Some("ready"), Some(version), _) => Err(failed(format!(
                "it speaks version `{version}` of the protocol for servers, but this program \
                 speaks version {VERSION}"
            ))),
            _ => Err(server.protocol_error(&format!("`ready {VERSION}`"), &ready)),
        }
    }

    /// Requests a picture. Returns its render time in seconds.
    pub(super) fn render(
        &mut self,
        samples: u64,
        seed: u32,
        file: &Path,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<f64, RenderError> {
        let start = Instant::now();
        let request = format!("{samples} {seed} {}", file.display());
        self.process.write_line(&request);
        let reply = self.reply(cancelled)?;
        if let Some(reason) = reply.strip_prefix("failed ") {
            let reason = super::printable(reason);
            return Err(failed(with_output(
                format!("it failed: {reason}"),
                &self.process,
            )));
        }
        let seconds: f64 = reply
            .parse()
            .map_err(|_| self.protocol_error("the render time in seconds", &reply))?;
        check_seconds(seconds, start.elapsed().as_secs_f64())
            .map_err(|problem| failed(with_output(problem, &self.process)))
    }

    /// Returns the next line of its standard output.
    fn reply(&mut self, cancelled: &dyn Fn() -> bool) -> Result<String, RenderError> {
        let patience = Patience {
            until: Instant::now() + self.timeout,
            cancelled,
        };
        match self.process.read_line(&patience) {
            Ok(Some(line)) => Ok(line),
            Ok(None) => {
                let status = self.process.close();
                let status = status.map_or_else(String::new, |status| format!(" ({status})"));
                Err(failed(with_output(
                    format!("it exited{status}"),
                    &self.process,
                )))
            }
            Err(why) => {
                self.process.close();
                Err(interrupted(why, self.timeout, &self.process))
            }
        }
    }

    fn protocol_error(&self, expected: &str, reply: &str) -> RenderError {
        failed(with_output(
            format!(
                "protocol error: expected {expected}, got `{}`",
                super::printable(reply)
            ),
            &self.process,
        ))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.process.close();
    }
}
