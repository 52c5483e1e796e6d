//! Facts about the machine and the time, recorded with results and never part of a run's identity.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::store::schema::plan::EnvFile;

/// Facts about the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Host {
    /// Name of the machine; empty if unknown.
    pub name: String,
    /// Operating system and architecture: `linux x86_64`.
    pub os: String,
    /// Model of the processor, or the architecture if the model is unknown.
    pub cpu: String,
    /// Number of cores that this process may use.
    pub cores: usize,
}

impl Host {
    /// Reads the facts about this machine.
    pub fn detect() -> Host {
        Host {
            name: host_name(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            cpu: cpu_model().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }

    /// Content of `env.json`: machine, program version, date, working directory and command line.
    pub fn env_file(&self) -> EnvFile {
        EnvFile {
            host: self.name.clone(),
            os: self.os.clone(),
            cpu: self.cpu.clone(),
            cores: self.cores as u64,
            date: utc(SystemTime::now()),
            folder: std::env::current_dir()
                .map(|folder| folder.display().to_string())
                .unwrap_or_default(),
            arguments: crate::text::arguments(),
            ..EnvFile::default()
        }
    }
}

fn host_name() -> String {
    let file = || std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let variable = || {
        std::env::var("HOSTNAME")
            .or_else(|_| std::env::var("COMPUTERNAME"))
            .ok()
    };
    file()
        .or_else(variable)
        .unwrap_or_default()
        .trim()
        .to_owned()
}

fn cpu_model() -> Option<String> {
    let info = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Formats a time in UTC, to the second, as ISO 8601: `2026-04-27T21:30:00Z`. Times before 1970
/// count as 1970.
pub fn utc(moment: SystemTime) -> String {
    let seconds = moment.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let (year, month, day) = date_from_days(seconds / 86_400);
    let clock = seconds % 86_400;
    format!(
        "{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z",
        clock / 3600,
        clock / 60 % 60,
        clock % 60
    )
}

/// Parses a time that [`utc`] formatted, in seconds since 1970. Returns `None` for any other text.
pub fn parse_utc(text: &str) -> Option<u64> {
    let number = |from: usize, to: usize| text.get(from..to)?.parse::<u64>().ok();
    let (year, month, day) = (number(0, 4)?, number(5, 7)?, number(8, 10)?);
    let (hour, minute, second) = (number(11, 13)?, number(14, 16)?, number(17, 19)?);
    if text.len() != 20
        || !(1970..10_000).contains(&year)
        || !(1..=12).contains(&month)
        || !(1..=31).contains(&day)
    {
        return None;
    }
    // Days since 1970 of a Gregorian date. In years that begin in March the leap day comes last.
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let days =
        year * 365 + year / 4 - year / 100 + year / 400 + (month * 153 + 2) / 5 + day - 1 - 719_468;
    Some(days * 86_400 + hour * 3600 + minute * 60 + second)
}

/// Year, month and day of the Gregorian calendar, `days` after 1970-01-01.
fn date_from_days(mut days: u64) -> (u64, u64, u64) {
    let leap = |y: u64| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(leap(year)) {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let lengths = [
        31,
        28 + u64::from(leap(year)),
        31,
        30,
        31,
        30,
        31,
        31,
        30,
        31,
        30,
        31,
    ];
    let mut month = 0;
    while days >= lengths[month] {
        days -= lengths[month];
        month += 1;
    }
    (year, month as u64 + 1, days + 1)
}

#[cfg(test)]
mod tests {
    use crate::store::write::host::*;
    use std::time::Duration;

    #[test]
    fn dates_agree_with_the_calendar() {
        let at = |s| utc(UNIX_EPOCH + Duration::from_secs(s));
        assert_eq!(at(0), "1970-01-01T00:00:00Z");
        assert_eq!(at(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(at(1_709_251_199), "2024-02-29T23:59:59Z");
        assert_eq!(at(4_107_542_400), "2100-03-01T00:00:00Z");
        for seconds in [0, 951_782_400, 1_709_251_199, 4_107_542_400, 1_764_163_537] {
            assert_eq!(parse_utc(&at(seconds)), Some(seconds));
        }
        for text in [
            "",
            "yesterday",
            "2026-13-01T00:00:00Z",
            "2026-04-27T21:30:00+02:00",
            "2026-04-27",
        ] {
            assert_eq!(parse_utc(text), None, "{text}");
        }
    }

    #[test]
    fn the_environment_names_program_and_cores() {
        let env = Host::detect().env_file();
        assert!(env.cores >= 1);
        assert!(env.program.0.starts_with("lumbre "));
    }
}
