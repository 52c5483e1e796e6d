//! `metrics.csv`: one line per wave, with floats in the shortest form that reads back to the same
//! bits.
//!
//! The columns are those of [`MEASUREMENT`] and the plan's metrics; all values are cumulative.
//! Infinities and NaN are written as `inf`, `-inf` and `NaN`.

use std::fmt::Write;

use crate::columns::{MEASUREMENT, names};
use crate::experiment::WaveRow;
use crate::text::{csv_field, csv_fields};

/// Name of the file in a run's folder.
pub const FILE: &str = "metrics.csv";

/// Number of columns before the metrics in files of versions that did not have the last of
/// [`MEASUREMENT`].
const WITHOUT_LOST: usize = MEASUREMENT.len() - 1;

/// Formats the header line, with its newline.
pub fn header<'a>(metrics: impl IntoIterator<Item = &'a str>) -> String {
    let mut line = names(&MEASUREMENT).join(",");
    for column in metrics {
        line.push(',');
        // A line is a record, so names have no line breaks.
        line.push_str(&csv_field(&column.replace(['\n', '\r'], " ")));
    }
    line.push('\n');
    line
}

/// Formats a row as a line, with its newline.
pub fn line(row: &WaveRow) -> String {
    let mut line = format!(
        "{},{},{:?},{:?},{:?},{},{},{},{:?}",
        row.wave,
        row.samples,
        row.render_s,
        row.wall_s,
        row.measure_s,
        row.paths,
        row.rays,
        row.invalid,
        row.lost_s
    );
    for value in &row.metrics {
        // Writing to a String cannot fail.
        let _ = write!(line, ",{value:?}");
    }
    line.push('\n');
    line
}

/// Parses a whole file into its metric columns and rows. A last line without a newline is ignored.
/// The position of the first invalid sample is not in this file but in `done.json`.
///
/// # Errors
/// When the header or a line is invalid; the text contains the line number.
pub fn parse(text: &str) -> Result<(Vec<String>, Vec<WaveRow>), String> {
    let complete = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
    let mut lines = complete.lines();
    let columns = csv_fields(lines.next().ok_or("the file is empty")?);
    let all = names(&MEASUREMENT);
    let fixed = match () {
        () if columns.starts_with(&all) => all.len(),
        () if columns.starts_with(&all[..WITHOUT_LOST]) => WITHOUT_LOST,
        () => {
            return Err(format!(
                "line 1: expected a header that starts with {}",
                all.join(",")
            ));
        }
    };
    let metrics = &columns[fixed..];
    let rows = lines.enumerate().map(|(i, line)| {
        parse_row(line, metrics.len()).map_err(|problem| format!("line {}: {problem}", i + 2))
    });
    let rows = rows.collect::<Result<_, _>>()?;
    Ok((metrics.to_vec(), rows))
}

/// Parses further lines of a file whose header was read before, with this number of metrics. Skips
/// lines that are no rows.
pub fn parse_more(text: &str, metrics: usize) -> Vec<WaveRow> {
    text.lines()
        .filter_map(|line| parse_row(line, metrics).ok())
        .collect()
}

/// Parses a line with this number of metrics, with or without the last column of [`MEASUREMENT`].
fn parse_row(line: &str, metrics: usize) -> Result<WaveRow, String> {
    let cells: Vec<&str> = line.split(',').collect();
    let has_lost = cells.len() == MEASUREMENT.len() + metrics;
    if !has_lost && cells.len() != WITHOUT_LOST + metrics {
        let width = MEASUREMENT.len() + metrics;
        return Err(format!("expected {width} values, found {}", cells.len()));
    }
    let fixed = cells.len() - metrics;
    let count = |i: usize| {
        cells[i].parse::<u64>().map_err(|_| {
            format!(
                "`{}` in column {} is not a count",
                cells[i], MEASUREMENT[i].name
            )
        })
    };
    let number = |i: usize| {
        cells[i]
            .parse::<f64>()
            .map_err(|_| format!("`{}` is not a number", cells[i]))
    };
    Ok(WaveRow {
        wave: count(0)?,
        samples: count(1)?,
        render_s: number(2)?,
        wall_s: number(3)?,
        measure_s: number(4)?,
        paths: count(5)?,
        rays: count(6)?,
        invalid: count(7)?,
        first_invalid: None,
        lost_s: if has_lost { number(WITHOUT_LOST)? } else { 0.0 },
        metrics: (fixed..cells.len()).map(number).collect::<Result<_, _>>()?,
    })
}

#[cfg(test)]
mod tests {
    use crate::store::write::metrics_csv::*;

    fn sample_row(wave: u64, metrics: &[f64]) -> WaveRow {
        WaveRow {
            wave,
            samples: 1 << wave,
            render_s: 0.1 + wave as f64 / 3.0,
            wall_s: 1e-9,
            measure_s: 0.25 * wave as f64,
            paths: u64::MAX,
            rays: 7,
            invalid: 0,
            first_invalid: None,
            lost_s: 0.125 * wave as f64,
            metrics: metrics.to_vec(),
        }
    }

    #[test]
    fn files_without_lost_time_are_read() {
        let text = "wave,samples,render_s,wall_s,measure_s,paths,rays,invalid,rmse\n1,2,0.5,1,0.25,3,4,0,0.125\n";
        let (columns, rows) = parse(text).unwrap();
        assert_eq!(columns, ["rmse"]);
        assert_eq!((rows[0].lost_s, &*rows[0].metrics), (0.0, &[0.125][..]));
        let line = text.lines().nth(1).unwrap();
        assert_eq!(parse_more(line, 1), rows);
    }

    #[test]
    fn rows_read_back_to_the_same_bits() {
        let rows = [
            sample_row(1, &[f64::MIN_POSITIVE, 1e300]),
            sample_row(2, &[f64::INFINITY, 1.0 / 3.0]),
        ];
        let text = header(["rmse", "odd, \"name\""]) + &rows.iter().map(line).collect::<String>();
        let (columns, back) = parse(&text).unwrap();
        assert_eq!(columns, ["rmse", "odd, \"name\""]);
        assert_eq!(back, rows);
        let nan = header(["m"]) + &line(&sample_row(1, &[f64::NAN]));
        assert!(parse(&nan).unwrap().1[0].metrics[0].is_nan());
    }

    #[test]
    fn an_incomplete_last_line_is_ignored() {
        let text =
            header(["rmse"]) + &line(&sample_row(1, &[0.5])) + &line(&sample_row(2, &[0.25]));
        for cut in 0..text.len() {
            let kept = text[..cut].matches('\n').count();
            match parse(&text[..cut]) {
                Ok((_, rows)) => assert_eq!(rows.len(), kept - 1),
                Err(_) => assert_eq!(kept, 0),
            }
        }
    }

    #[test]
    fn further_lines_need_no_header() {
        let (first, second) = (sample_row(1, &[0.5]), sample_row(2, &[0.25]));
        let text = line(&first) + "torn,1\nx,1,2,3,4,5,6,7,8\n" + &line(&second);
        assert_eq!(parse_more(&text, 1), [first, second]);
    }

    #[test]
    fn errors_name_the_line() {
        let good = header(["rmse"]) + &line(&sample_row(1, &[0.5]));
        assert!(
            parse(&(good.clone() + "1,2,3\n"))
                .unwrap_err()
                .starts_with("line 3: expected 10 values")
        );
        assert!(
            parse(&(good + "x,2,0.1,0.2,0.1,3,4,5,0,6\n"))
                .unwrap_err()
                .contains("`x` in column wave is not a count")
        );
        assert!(parse("time,error\n1,2\n").unwrap_err().contains("line 1"));
    }
}
