//! Render times of other programs: by the wall clock, or as the program reports them.

use serde_json::Value as Json;

/// Place of the number in a pattern.
const SECONDS: &str = "{seconds}";
const MILLISECONDS: &str = "{milliseconds}";

/// By how much a reported time may exceed the wall clock: a factor, and seconds for rounding.
const TOLERANCE: (f64, f64) = (1.01, 0.05);

/// Source of the render time of a process.
#[derive(Clone, Debug, PartialEq)]
pub enum Clock {
    /// Wall-clock time from the start of the process to its end.
    Wall,
    /// Field `seconds` of the last line of standard output that is a JSON object.
    Json,
    /// Number in the last line of standard output that fits a text with `{seconds}` or
    /// `{milliseconds}`.
    Pattern(String),
}

/// Time and samples that a program reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Render time in seconds; `None` for the wall clock.
    pub seconds: Option<f64>,
    /// Samples per pixel of the picture, if the program reports them.
    pub samples: Option<u64>,
}

impl Clock {
    /// Reads the option `time` of a script.
    ///
    /// # Errors
    /// Returns a message for text that is neither a known word nor a pattern.
    pub fn from_text(text: &str) -> Result<Clock, String> {
        match text {
            "clock" => Ok(Clock::Wall),
            "json" => Ok(Clock::Json),
            _ if text.matches(SECONDS).count() + text.matches(MILLISECONDS).count() == 1 => {
                Ok(Clock::Pattern(text.to_owned()))
            }
            _ => Err(format!(
                "`{text}` is no source of times: write \"clock\", \"json\", or a line of the \
                 program's output with {SECONDS} or {MILLISECONDS} in the place of the number"
            )),
        }
    }

    /// Reads the report in the standard output of a program.
    ///
    /// # Errors
    /// Returns a message if the output has no such report.
    pub fn read(&self, output: &str) -> Result<Report, String> {
        match self {
            Clock::Wall => Ok(Report {
                seconds: None,
                samples: None,
            }),
            Clock::Json => json_report(output),
            Clock::Pattern(pattern) => {
                let found = output.lines().rev().find_map(|line| matched(pattern, line));
                let seconds = found.ok_or_else(|| {
                    format!("no line of its output fits `{pattern}`, so its render time is unknown")
                })?;
                Ok(Report {
                    seconds: Some(seconds),
                    samples: None,
                })
            }
        }
    }
}

fn json_report(output: &str) -> Result<Report, String> {
    let objects = output
        .lines()
        .rev()
        .filter_map(|line| serde_json::from_str::<Json>(line.trim()).ok());
    let report = objects
        .into_iter()
        .find(Json::is_object)
        .ok_or("its output has no line with a JSON object, which reports the render time")?;
    let seconds = report.get("seconds").and_then(Json::as_f64);
    let samples = match report.get("samples") {
        None => None,
        Some(samples) => Some(samples.as_u64().filter(|n| *n > 0).ok_or_else(|| {
            format!("it reported `{samples}` samples per pixel: expected a positive integer")
        })?),
    };
    Ok(Report {
        seconds: Some(seconds.ok_or("its JSON has no number `seconds`")?),
        samples,
    })
}

/// Returns the seconds in a line that fits a pattern.
fn matched(pattern: &str, line: &str) -> Option<f64> {
    let (placeholder, unit) = match pattern.contains(SECONDS) {
        true => (SECONDS, 1.0),
        false => (MILLISECONDS, 1e-3),
    };
    let (before, after) = pattern.split_once(placeholder)?;
    let starts: Vec<usize> = match before {
        "" => vec![0],
        _ => line.match_indices(before).map(|(at, _)| at).collect(),
    };
    starts.into_iter().rev().find_map(|at| {
        let rest = line[at + before.len()..].trim_start();
        let is_number = |c: char| c.is_ascii_digit() || "+-.:eE".contains(c);
        let end = rest.find(|c| !is_number(c)).unwrap_or(rest.len());
        // A letter of the text behind the number may look like an exponent.
        let ends = (1..=end).rev();
        let mut numbers = ends.filter_map(|end| Some((end, clock_time(&rest[..end])?)));
        let (_, number) = numbers.find(|(end, _)| {
            let behind = &rest[*end..];
            behind.starts_with(after) || behind.trim_start().starts_with(after)
        })?;
        Some(number * unit)
    })
}

/// Returns the value of a number, or of a time such as `1:02.5` or `1:00:02`.
fn clock_time(text: &str) -> Option<f64> {
    text.split(':').try_fold(0.0, |sum, part| {
        let number: f64 = part.parse().ok()?;
        Some(60.0 * sum + number)
    })
}

/// Checks a reported time against the wall clock of the program.
///
/// # Errors
/// Returns a message for a time that is negative, not finite, or longer than the wall clock.
pub fn check_seconds(seconds: f64, wall_s: f64) -> Result<f64, String> {
    let (factor, slack) = TOLERANCE;
    if !seconds.is_finite() || seconds < 0.0 {
        Err(format!("it reported a render time of {seconds} s"))
    } else if seconds > factor * wall_s + slack {
        Err(format!(
            "it reported a render time of {seconds:.3} s, but it ran for {wall_s:.3} s only: it \
             may report processor time; use the wall clock"
        ))
    } else {
        Ok(seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(time: &str, output: &str) -> Result<f64, String> {
        let report = Clock::from_text(time).unwrap().read(output)?;
        Ok(report.seconds.unwrap_or(-1.0))
    }

    #[test]
    fn times_are_read_from_lines_of_output() {
        for (time, output, expected) in [
            ("clock", "nothing", -1.0),
            ("({seconds}s)", "Rendering: [++++]  (12.3s)\nbye", 12.3),
            (
                "Time: {seconds} (Saving",
                "Time: 01:03.45 (Saving: 00:00.10)",
                63.45,
            ),
            ("took {milliseconds} ms", "took 10 ms\ntook 250 ms", 0.25),
            ("{seconds}", "1.5", 1.5),
            ("time = {seconds}", "time = 2e-3", 0.002),
            ("in {seconds}end", "in 3end", 3.0),
            (
                "json",
                "{\"seconds\": 9}\nnoise\n{\"seconds\": 0.5}\n[1]\n",
                0.5,
            ),
        ] {
            let found = seconds(time, output).unwrap();
            assert!((found - expected).abs() < 1e-12, "{time}: {found}");
        }
        let report = Clock::Json
            .read("{\"seconds\": 1, \"samples\": 8}")
            .unwrap();
        assert_eq!(report.samples, Some(8));
    }

    #[test]
    fn missing_reports_and_wrong_options_are_errors() {
        for (time, output, reason) in [
            ("({seconds}s)", "(fast)", "fits `({seconds}s)`"),
            ("json", "12.5\n", "no line with a JSON object"),
            ("json", "{\"time\": 1}", "no number `seconds`"),
            (
                "json",
                "{\"seconds\": 1, \"samples\": -3}",
                "expected a positive integer",
            ),
        ] {
            let found = seconds(time, output).unwrap_err();
            assert!(found.contains(reason), "{found}");
        }
        for wrong in ["", "wall", "{seconds} {seconds}"] {
            assert!(Clock::from_text(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_time_that_cannot_be_true_is_refused() {
        assert_eq!(check_seconds(1.0, 1.0), Ok(1.0));
        assert_eq!(check_seconds(0.0, 1.0), Ok(0.0));
        for wrong in [-0.001, f64::NAN, f64::INFINITY, 1.1] {
            assert!(check_seconds(wrong, 1.0).is_err(), "{wrong}");
        }
    }
}
