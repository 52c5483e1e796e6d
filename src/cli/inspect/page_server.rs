//! `lumbre watch --page`: the page of a night's report for a browser of this machine, made anew
//! while the night renders.
//!
//! Only the loopback address is served, files are only read, and every address begins with a random
//! token: other users of the machine and pages of other sites cannot guess it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, UNIX_EPOCH};

use tiny_http::{Header, Method, Request, Response, Server};

use super::follow::open_follower;
use super::report;
use crate::cli::args::Global;
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::night::signals;
use lumbre_night::experiment::NightControls;
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{Evidence, Follower, regular_file};
use lumbre_report::report::{Report, ReportOptions};
use lumbre_scene_io::uri;

/// Longest wait for a request before a signal is noticed.
const POLL: Duration = Duration::from_millis(200);
/// Share of the time in which pages are made, which the night's renderer lacks.
const LARGEST_SHARE: f64 = 0.05;

type Answer = Response<std::io::Cursor<Vec<u8>>>;

/// Serves the page of a night until a signal ends the program. `port` 0 takes a free one.
pub fn main(night: Option<&Path>, port: u16, global: &Global) -> Result<Exit, Failure> {
    let follower = open_follower(night, global)?;
    let server = Server::http(("127.0.0.1", port)).map_err(Failure::usage)?;
    let address = server.server_addr().to_ip();
    let address = address.ok_or_else(|| Failure::internal("the server has no address"))?;
    let folder = fs::canonicalize(follower.folder()).map_err(Failure::usage)?;
    let mut token = [0; 16];
    getrandom::fill(&mut token).map_err(Failure::internal)?;
    let mut pages = Pages {
        root: folder.parent().unwrap_or(&folder).to_owned(),
        token: format!("{:032x}", u128::from_le_bytes(token)),
        folder,
        follower,
        last: None,
    };
    let control = Arc::new(NightControls::default());
    signals::install(Arc::clone(&control))?;
    print_result(&format!("http://{address}{}\n", pages.start()))?;
    if !global.quiet {
        print_status("the page is updated while the night renders; Ctrl-C ends it");
    }
    while !control.stop_requested() {
        if let Ok(Some(request)) = server.recv_timeout(POLL) {
            let answer = pages.answer(&request);
            // A browser that closes the connection meanwhile needs no answer.
            let _ = request.respond(answer);
        }
    }
    Ok(Exit::Done)
}

/// A report of the night, and the state of its files from which it was made.
struct Made {
    state: u64,
    at: Instant,
    took: Duration,
    report: Result<Report, Failure>,
}

/// All that is served: the report of a night at `/TOKEN/<night>/report/`, and the files of the folder
/// that has the night, to which the page links.
struct Pages {
    root: PathBuf,
    token: String,
    folder: PathBuf,
    follower: Follower,
    last: Option<Made>,
}

impl Pages {
    /// Returns the path of the page in addresses.
    fn start(&self) -> String {
        let name = self.folder.file_name().unwrap_or_default();
        let name = uri::encoded(&name.to_string_lossy());
        format!("/{}/{name}/report/", self.token)
    }

    fn answer(&mut self, request: &Request) -> Answer {
        let (path, query) = request.url().split_once('?').unwrap_or((request.url(), ""));
        let allowed = matches!(request.method(), Method::Get | Method::Head);
        let prefix = format!("/{}/", self.token);
        let Some(below) = path.strip_prefix(&prefix).filter(|_| allowed) else {
            return text(404, "not found");
        };
        match path.strip_prefix(&self.start()) {
            Some("" | "index.html") => self.page(query.strip_prefix("after=")),
            Some(name) => self.item(name),
            None => file(&self.root, &uri::decoded(below)),
        }
    }

    /// Makes the report anew if files of the night changed since and the renderer had the machine
    /// long enough.
    fn made(&mut self) -> &Made {
        let modified = self.follower.last_modified();
        let since = modified.and_then(|at| at.duration_since(UNIX_EPOCH).ok());
        let state = since.map_or(0, |since| since.as_millis() as u64);
        let is_current = |made: &Made| {
            made.state == state || made.took.div_f64(LARGEST_SHARE) > made.at.elapsed()
        };
        let last = self.last.take().filter(is_current);
        self.last.insert(last.unwrap_or_else(|| {
            let start = Instant::now();
            let report = report_of(&self.folder, state);
            Made {
                state,
                at: start,
                took: start.elapsed(),
                report,
            }
        }))
    }

    /// Returns the page, or nothing, which keeps the one shown, if the browser has this one.
    fn page(&mut self, shown: Option<&str>) -> Answer {
        let made = self.made();
        match &made.report {
            Ok(_) if shown == Some(made.state.to_string().as_str()) => text(204, ""),
            Ok(_) => self.item("index.html"),
            Err(failure) => text(200, &failure.message).with_header(header("Refresh", "2")),
        }
    }

    /// Returns a file of the report.
    fn item(&mut self, name: &str) -> Answer {
        let name = uri::decoded(name);
        let Ok(report) = &self.made().report else {
            return text(404, "not found");
        };
        let path = Path::new(&name);
        let stem = path.with_extension("");
        let item = report
            .items
            .iter()
            .find(|item| Path::new(&item.stem) == stem);
        let files = item.map(|item| item.files()).transpose();
        let found = files.map(|files| files.into_iter().flatten().find(|(file, _)| *file == name));
        match found {
            Ok(Some((_, bytes))) => data(path, bytes),
            Ok(None) => file(&self.folder, &format!("report/{name}")),
            Err(error) => text(500, &error.to_string()),
        }
    }
}

/// Makes the report of a night as `lumbre report` does, without writing it.
fn report_of(folder: &Path, state: u64) -> Result<Report, Failure> {
    let evidence = Evidence::default();
    let nights = [read_night(folder, &evidence).map_err(Failure::usage)?];
    report::check_measured(&nights, &evidence)?;
    let to = folder.join("report");
    report::build(
        &nights,
        &ReportOptions::default(),
        &evidence,
        &to,
        Some(state),
    )
}

/// Returns a file below a folder, or the names in a folder. Links that lead out of it are refused.
fn file(root: &Path, below: &str) -> Answer {
    let path = fs::canonicalize(root.join(below));
    let Some(path) = path.ok().filter(|path| path.starts_with(root)) else {
        return text(404, "not found");
    };
    let Ok(entries) = fs::read_dir(&path) else {
        return match regular_file::read(&path) {
            Ok(bytes) => data(&path, bytes),
            Err(error) => text(404, &error.to_string()),
        };
    };
    let mut names: Vec<String> = entries
        .flatten()
        .map(|entry| {
            let slash = if entry.path().is_dir() { "/" } else { "" };
            uri::encoded(&entry.file_name().to_string_lossy()) + slash
        })
        .collect();
    names.sort();
    // Percent-encoded names have no character that HTML knows.
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let base = if below.ends_with('/') {
        String::new()
    } else {
        uri::encoded(&name) + "/"
    };
    let links = names.iter();
    let links: String = links
        .map(|name| format!("<p><a href=\"{base}{name}\">{name}</a></p>\n"))
        .collect();
    data(Path::new("folder.html"), links.into_bytes())
}

fn text(status: u16, text: &str) -> Answer {
    answer("text/plain", text.as_bytes().to_vec()).with_status_code(status)
}

/// Returns the bytes of a file with the type that its name says.
fn data(path: &Path, bytes: Vec<u8>) -> Answer {
    let kind = match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
        "html" => "text/html",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "gif" => "image/gif",
        "pdf" => "application/pdf",
        "json" => "application/json",
        "exr" | "npy" => "application/octet-stream",
        _ => "text/plain",
    };
    answer(kind, bytes)
}

fn answer(kind: &str, bytes: Vec<u8>) -> Answer {
    Response::from_data(bytes)
        .with_header(header("Content-Type", &format!("{kind}; charset=utf-8")))
        .with_header(header("Cache-Control", "no-store"))
        .with_header(header("Referrer-Policy", "no-referrer"))
        .with_header(header("X-Content-Type-Options", "nosniff"))
}

/// Creates a header from characters that headers may have.
fn header(name: &str, value: &str) -> Header {
    Header::from_bytes(name, value).expect("headers are written in this file")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_outside_of_the_folder_is_served() {
        let place = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(place.path()).unwrap();
        fs::create_dir(root.join("out")).unwrap();
        fs::write(root.join("secret"), "x").unwrap();
        fs::write(root.join("out/a <b>"), "y").unwrap();
        let status = |below: &str| file(&root.join("out"), below).status_code().0;
        assert_eq!((status("a <b>"), status("")), (200, 200));
        assert_eq!(status("../secret"), 404);
        assert_eq!(status(root.join("secret").to_str().unwrap()), 404);
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(root.join("secret"), root.join("out/link")).unwrap();
            assert_eq!(status("link"), 404);
        }
    }
}
