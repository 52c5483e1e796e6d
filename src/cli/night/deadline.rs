//! Deadlines of nights: times of day by the local clock, or durations from now.

use std::time::{Duration, SystemTime};

use jiff::Zoned;
use jiff::civil::Time;

use lumbre_light::value::Value;
use lumbre_night::experiment::spec::Deadline;

/// Parses a deadline such as `08:00` or `7.5h`.
pub fn parse(text: &str) -> Result<Deadline, String> {
    Deadline::parse(&Value::Str(text.to_owned())).ok_or_else(|| {
        format!("expected a time of day such as 08:00 or a duration such as 7.5h, found `{text}`")
    })
}

/// Returns the point in time of a deadline that is set now.
///
/// # Errors
/// Returns an error if the time of day does not exist in the local calendar.
pub fn deadline_time(deadline: Deadline) -> Result<SystemTime, String> {
    match deadline {
        Deadline::After { milliseconds } => {
            Ok(SystemTime::now() + Duration::from_millis(milliseconds))
        }
        Deadline::Clock { minutes } => {
            next_occurrence(&Zoned::now(), minutes).map(|zoned| zoned.timestamp().into())
        }
    }
}

/// Returns the next time strictly after `now` at which the clock in its time zone shows `minutes`
/// after midnight. A time skipped by a daylight saving change is shifted by the length of the gap.
fn next_occurrence(now: &Zoned, minutes: u16) -> Result<Zoned, String> {
    let [hour, minute] = [minutes / 60, minutes % 60].map(|n| n as i8);
    let on = |date: jiff::civil::Date| {
        date.to_datetime(Time::constant(hour, minute, 0, 0))
            .to_zoned(now.time_zone().clone())
    };
    let today = on(now.date()).map_err(|e| e.to_string())?;
    if today > *now {
        return Ok(today);
    }
    now.date()
        .tomorrow()
        .and_then(on)
        .map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use crate::cli::night::deadline::*;

    #[test]
    fn a_time_of_day_means_its_next_occurrence() {
        let at = |text: &str| -> Zoned { text.parse().unwrap() };
        let evening = at("2026-04-27T22:00:00+00:00[UTC]");
        assert_eq!(
            next_occurrence(&evening, 8 * 60).unwrap(),
            at("2026-04-28T08:00:00+00:00[UTC]")
        );
        assert_eq!(
            next_occurrence(&evening, 23 * 60 + 30).unwrap(),
            at("2026-04-27T23:30:00+00:00[UTC]")
        );
        assert_eq!(
            next_occurrence(&evening, 22 * 60).unwrap(),
            at("2026-04-28T22:00:00+00:00[UTC]"),
            "the present moment is excluded"
        );
    }

    #[test]
    fn deadlines_are_times_of_day_or_durations() {
        assert_eq!(parse("08:00"), Ok(Deadline::Clock { minutes: 480 }));
        assert_eq!(
            parse("7.5h"),
            Ok(Deadline::After {
                milliseconds: 27_000_000
            })
        );
        assert_eq!(
            parse("90min"),
            Ok(Deadline::After {
                milliseconds: 5_400_000
            })
        );
        for wrong in ["24:00", "8:60", "noon", "", "-1h", "08:00:00"] {
            assert!(parse(wrong).unwrap_err().contains("08:00"), "{wrong}");
        }
    }
}
