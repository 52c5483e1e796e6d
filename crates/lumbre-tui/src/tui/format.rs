//! Human-readable numbers, durations and names, short enough for a table column.

use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::{CellRef, Night};
use lumbre_night::text;

/// Formats seconds with a unit, in at most seven columns: `2.1 ms`, `0.52 s`, `4m05s`, `3d04h`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return "?".to_owned();
    }
    if seconds > 0.0 && seconds < 0.00995 {
        return format!("{:.1} ms", seconds * 1e3);
    }
    if seconds < 9.995 {
        return format!("{seconds:.2} s");
    }
    if seconds < 59.95 {
        return format!("{seconds:.1} s");
    }
    let s = seconds.round() as u64;
    match s {
        0..3600 => format!("{}m{:02}s", s / 60, s % 60),
        3600..86_400 => format!("{}h{:02}m", s / 3600, s / 60 % 60),
        _ => format!("{}d{:02}h", s / 86_400, s / 3600 % 24),
    }
}

/// Formats seconds since the start of the night in five columns: `04:05` for 4 min 5 s, `2h03m`
/// after the first hour.
pub fn stamp(seconds: f64) -> String {
    let s = if seconds.is_finite() {
        seconds.max(0.0) as u64
    } else {
        0
    };
    if s < 3600 {
        format!("{:02}:{:02}", s / 60, s % 60)
    } else {
        format!("{}h{:02}m", s / 3600, s / 60 % 60)
    }
}

/// Formats a number with three significant digits in at most nine columns: `0.0123`, `1.23e-5`.
pub fn number(x: f64) -> String {
    if x.is_nan() {
        return "nan".to_owned();
    }
    if x == 0.0 || x.is_infinite() {
        return format!("{x}");
    }
    text::significant(x, 3, -3..=4)
}

/// Formats a count in at most seven columns: digits, or `12.3M` from ten million on.
pub fn count(n: u64) -> String {
    match n {
        0..10_000_000 => n.to_string(),
        10_000_000..10_000_000_000 => format!("{:.1}M", n as f64 / 1e6),
        _ => format!("{:.1}G", n as f64 / 1e9),
    }
}

/// Formats a metric's value, with its unit if that is short: `30.8 dB`.
pub fn measured(spec: &MetricSpec, value: f64) -> String {
    match spec.unit() {
        unit if (1..=3).contains(&unit.len()) => format!("{} {unit}", number(value)),
        _ => number(value),
    }
}

/// Name of a cell or reference: `depth=5 aa=0.5 rep=1`, or `bpt of cornell.scn`. Axes in which no
/// two cells differ are left out.
pub fn cell_name(night: &Night, cell: CellRef) -> String {
    match cell {
        CellRef::Cell(i) => night.runs.get(i).map_or_else(String::new, |run| {
            let differs = |axis: usize| night.plan.varying.get(axis) == Some(&true);
            let mut parts: Vec<String> = run
                .point
                .iter()
                .enumerate()
                .filter(|(axis, _)| differs(*axis))
                .map(|(_, (name, value))| format!("{name}={value}"))
                .collect();
            if night.plan.is_repeated {
                parts.push(format!("rep={}", run.repeat));
            }
            if parts.is_empty() {
                scene_name(&run.scene)
            } else {
                clean(&parts.join(" "))
            }
        }),
        CellRef::Reference(i) => clean(&night.reference_name(i)),
    }
}

/// File name of a scene's path.
pub fn scene_name(path: &str) -> String {
    clean(
        path.rsplit(['/', '\\'])
            .find(|part| !part.is_empty())
            .unwrap_or(path),
    )
}

/// Puts text on one line without control characters, so that it cannot control the terminal.
pub fn clean(text: &str) -> String {
    let spaced: String = text
        .chars()
        .map(|c| {
            if text::is_control(c) || c.is_control() {
                ' '
            } else {
                c
            }
        })
        .collect();
    spaced.trim().to_owned()
}

/// Number of terminal columns that a text needs.
pub fn width(text: &str) -> usize {
    ratatui::text::Span::raw(text).width()
}

/// Truncates text to `columns` and ends it with `ellipsis` if it is longer.
pub fn fit(text: &str, columns: usize, ellipsis: &str) -> String {
    if width(text) <= columns {
        return text.to_owned();
    }
    let room = columns.saturating_sub(width(ellipsis));
    let mut cut = String::new();
    for c in text.chars() {
        cut.push(c);
        if width(&cut) > room {
            cut.pop();
            break;
        }
    }
    if columns >= width(ellipsis) {
        cut.push_str(ellipsis);
    }
    cut
}

/// Breaks text at spaces into lines of at most `columns`; only words longer than a line are split.
pub fn wrap(text: &str, columns: usize) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let mut piece = String::new();
        for c in word.chars() {
            piece.push(c);
            if width(&piece) > columns && columns > 0 {
                let last = piece.pop();
                words.push(std::mem::take(&mut piece));
                piece.extend(last);
            }
        }
        words.push(piece);
    }
    text::wrap(&words.join(" "), |line| width(line) <= columns)
}

#[cfg(test)]
mod tests {
    use crate::tui::format::*;

    #[test]
    fn durations_keep_their_units_at_every_boundary() {
        let cases = [
            (0.0, "0.00 s"),
            (0.0021, "2.1 ms"),
            (0.00994, "9.9 ms"),
            (0.00996, "0.01 s"),
            (9.994, "9.99 s"),
            (9.996, "10.0 s"),
            (59.94, "59.9 s"),
            (59.96, "1m00s"),
            (245.0, "4m05s"),
            (7380.0, "2h03m"),
            (273_600.0, "3d04h"),
            (f64::NAN, "?"),
        ];
        for (s, text) in cases {
            assert_eq!(duration(s), text);
        }
        assert_eq!(stamp(245.9), "04:05");
        assert_eq!(stamp(7380.0), "2h03m");
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (9.996, "10.0"),
            (123.4, "123"),
            (12_345.0, "12345"),
            (1.234e-5, "1.23e-5"),
            (-0.5, "-0.500"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "nan"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
        assert_eq!(count(9_999_999), "9999999");
        assert_eq!(count(12_340_000), "12.3M");
    }

    #[test]
    fn text_is_cut_and_broken_by_columns() {
        assert_eq!(fit("depth", 5, "…"), "depth");
        assert_eq!(fit("depths", 5, "…"), "dept…");
        assert_eq!(fit("深度深度", 5, "…"), "深度…");
        assert_eq!(fit("abc", 1, ".."), "");
        assert_eq!(wrap("one two  three", 7), ["one two", "three"]);
        assert_eq!(wrap("abcdefgh ij", 3), ["abc", "def", "gh", "ij"]);
        assert_eq!(wrap("", 5), [""]);
        assert_eq!(clean("a\x1b[2Jb\nc"), "a [2Jb c");
    }
}
