//! Formatting of text for the terminal: aligned columns, durations, counts, sizes and paths.

use std::path::{Path, PathBuf};

/// Formats lines of table cells as left-aligned columns. Each column is as wide as its widest cell,
/// with two spaces between columns and no trailing spaces.
pub fn aligned(lines: &[Vec<String>]) -> String {
    let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| {
        lines
            .iter()
            .filter_map(|l| l.get(c))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |cells: &Vec<String>| {
        let padded = cells
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"))
            .collect::<Vec<_>>();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    lines.iter().map(line).collect()
}

/// Formats a duration in seconds: `0.25 s`, `42 s`, `3 min 20 s`, `8 h 5 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round();
    if !whole.is_finite() {
        return format!("{seconds} s");
    }
    let (h, min, s) = (
        whole as u64 / 3600,
        whole as u64 / 60 % 60,
        whole as u64 % 60,
    );
    match (h, min) {
        (0, 0) if seconds < 10.0 => format!("{} s", rounded(seconds)),
        (0, 0) => format!("{s} s"),
        (0, _) => format!("{min} min {s} s"),
        _ => format!("{h} h {min} min"),
    }
}

/// Formats a number with three significant digits, without trailing zeros after the decimal point.
pub fn rounded(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let digits = (2 - x.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Formats a number with six significant digits, for tables in which numbers are compared.
pub fn precise(x: f64) -> String {
    let digits = format!("{x:.5e}");
    digits.parse().map_or(digits, |x: f64| x.to_string())
}

/// Formats a size in bytes with decimal units: `12 B`, `3.4 kB`, `5.6 MB`.
pub fn size(bytes: u64) -> String {
    match bytes {
        0..1000 => format!("{bytes} B"),
        1000..1_000_000 => format!("{} kB", rounded(bytes as f64 / 1e3)),
        _ => format!("{} MB", rounded(bytes as f64 / 1e6)),
    }
}

/// Formats a count with its noun: `1 cell`, `3 cells`.
pub fn counted(n: usize, noun: &str) -> String {
    lumbre_night::text::counted(n as u64, noun)
}

/// Formats a path relative to the current folder if it lies below it.
pub fn display_path(path: &Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    let relative = path.strip_prefix(&here).unwrap_or(path);
    let relative: PathBuf = relative
        .components()
        .filter(|c| *c != std::path::Component::CurDir)
        .collect();
    if relative.as_os_str().is_empty() {
        ".".to_owned()
    } else {
        relative.display().to_string()
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::format::*;

    #[test]
    fn columns_line_up_and_lines_have_no_tail() {
        let lines = vec![
            vec!["a".into(), "long".into(), "x".into()],
            vec!["bbb".into(), "é".into(), String::new()],
        ];
        assert_eq!(aligned(&lines), "a    long  x\nbbb  é\n");
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(duration(0.25), "0.25 s");
        assert_eq!(duration(59.6), "1 min 0 s");
        assert_eq!(duration(200.0), "3 min 20 s");
        assert_eq!(duration(29_100.0), "8 h 5 min");
        assert_eq!(rounded(1234.5), "1234");
        assert_eq!(rounded(0.001_239), "0.00124");
        assert_eq!(precise(0.043_725_339_960_965_17), "0.0437253");
        assert_eq!(precise(f64::NAN), "NaN");
        assert_eq!(size(999), "999 B");
        assert_eq!(size(3_440), "3.44 kB");
    }
}
