//! `lumbre watch --page`: the page of a night, for a browser of this machine.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};

use super::workplace::Workplace;

/// A served page, until it is dropped.
struct Served {
    child: Child,
    /// Host and port.
    host: String,
    /// Path of the page with the token.
    page: String,
}

impl Served {
    fn new(place: &Workplace) -> Served {
        let mut command = place.command(&["watch", "latest", "--page", "-q"]);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        lines.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://").expect(&line);
        let (host, page) = address.split_at(address.find('/').unwrap());
        let (host, page) = (host.to_owned(), page.to_owned());
        Served { child, host, page }
    }

    /// Returns status and content of an answer.
    fn ask(&self, method: &str, path: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        let host = &self.host;
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head[9..12].parse().unwrap(), body.to_owned())
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask("GET", path)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn the_page_is_served_to_who_has_the_token() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let before = place.files("out");
    let served = Served::new(&place);
    assert!(served.host.starts_with("127.0.0.1:"), "{}", served.host);
    let (status, page) = served.get(&served.page);
    assert_eq!(status, 200);
    assert!(page.contains("id=\"answer\"") && !page.contains("\"live\":null"));
    // A browser that shows this state keeps its page.
    let (_, rest) = page.split_once("\"live\":").unwrap();
    let state: String = rest.chars().take_while(char::is_ascii_digit).collect();
    let after = |state: &str| served.get(&format!("{}?after={state}", served.page)).0;
    assert_eq!((after(&state), after("0")), (204, 200));
    // Figures are made when they are asked for, and links of the page lead to files of the night.
    let stem = page.split("figure id=\"").nth(1).unwrap();
    let stem = stem.split('"').next().unwrap();
    let (status, svg) = served.get(&format!("{}{stem}.svg", served.page));
    assert!(status == 200 && svg.contains("<svg"), "{stem}: {status}");
    let night = served.page.strip_suffix("report/").unwrap();
    let (status, plan) = served.get(&format!("{night}plan.json"));
    assert!(status == 200 && plan.contains("\"cells\""));
    assert!(served.get(&format!("{night}runs/")).1.contains("href"));
    // Everybody else gets nothing.
    let wrong = served.page.replacen(|c: char| c.is_ascii_digit(), "x", 1);
    for path in ["/", "/index.html", &wrong, &served.page[1..]] {
        assert_eq!(served.get(path).0, 404, "{path}");
    }
    let token = served.page[1..].split('/').next().unwrap();
    assert_eq!(served.get(&format!("/{token}/../secret")).0, 404);
    assert_eq!(
        served.get(&format!("/{token}/%2e%2e/%2e%2e/etc/passwd")).0,
        404
    );
    assert_eq!(served.ask("POST", &served.page).0, 404);
    assert_eq!(place.files("out"), before, "nothing is written");
}

#[test]
fn the_page_follows_a_night_and_names_what_is_damaged() {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let mut picture = place.files("out").into_iter();
    let is_final = |file: &String| file.contains("/runs/") && file.ends_with("final.exr");
    let picture = picture.rfind(is_final).unwrap();
    let served = Served::new(&place);
    assert!(!served.get(&served.page).1.contains("id=\"problems\""));
    place.write(&picture, "damaged");
    let journal = place.path("out/latest/journal.jsonl");
    let text = std::fs::read_to_string(&journal).unwrap();
    // The page is made anew at most a small share of the time.
    let mut page = String::new();
    for _ in 0..600 {
        std::thread::sleep(std::time::Duration::from_millis(100));
        std::fs::write(&journal, &text).unwrap();
        page = served.get(&served.page).1;
        if page.contains("id=\"problems\"") {
            break;
        }
    }
    assert!(page.contains("id=\"problems\""));
}
