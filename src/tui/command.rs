//! The command bar: words for everything that keys do, and for what needs an argument.

use crate::experiment::PauseAt;
use crate::tui::model::Model;
use crate::tui::view::{ChartX, Command, Picture};
use crate::value::suggest;

/// What a line of the command bar asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Something of the night.
    Night(Command),
    /// Show only what contains these words in the plan; empty shows all.
    Filter(String),
    /// The chart shows this metric, by its place.
    Metric(usize),
    /// The chart's horizontal axis.
    Axis(ChartX),
    /// The picture pane shows this.
    Picture(Picture),
    /// Light plays through time, or stops.
    Play,
    /// Light by time at this optical length.
    Moment(f64),
    /// Picture and reference in turn, or not.
    Flicker,
    /// Stops that pictures are brightened by.
    Exposure(f32),
    /// Bring this row of the plan into view, from 0.
    Cell(usize),
    /// The help.
    Help,
}

/// A command of the bar: its name, its argument, and what it does.
pub type Row = (&'static str, &'static str, &'static str);

/// Every command there is.
pub const COMMANDS: &[Row] = &[
    ("pause", "[64spp|30s]", "pause now, or when the cell has come so far"),
    ("resume", "", "go on"),
    ("restart", "", "render the cell from its first sample"),
    ("skip", "", "give up this cell"),
    ("stop", "[cell]", "end after this wave, or after this cell"),
    ("filter", "[WORDS]", "show only cells with these words"),
    ("cell", "N", "bring cell N into view"),
    ("metric", "NAME", "metric of the chart"),
    ("axis", "time|spp", "horizontal axis of the chart"),
    ("show", "KIND", "live, reference, difference, flip, strategies, time"),
    ("time", "LENGTH", "light that comes at this path length"),
    ("play", "", "light through time, or stop"),
    ("flicker", "", "live and reference in turn"),
    ("exposure", "STOPS", "brightness of pictures"),
    ("help", "", "keys and signs"),
];

/// Reads a line of the command bar. Names may be cut short as long as they stay clear.
///
/// # Errors
/// In words, when there is no such command or its argument makes no sense.
pub fn read(line: &str, model: &Model) -> Result<Order, String> {
    let (name, argument) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
    let argument = argument.trim();
    let order = match full_name(name)? {
        "pause" if argument.is_empty() => Order::Night(Command::Pause(Some(true))),
        "pause" => Order::Night(Command::PauseAt(Some(limit(argument)?))),
        "resume" => Order::Night(Command::Pause(Some(false))),
        "restart" => Order::Night(Command::Restart),
        "skip" => Order::Night(Command::Skip),
        "stop" if argument == "cell" => Order::Night(Command::StopAfterCell),
        "stop" if argument.is_empty() => Order::Night(Command::Stop),
        "stop" => return Err(format!("expected `stop` or `stop cell`, found `{argument}`")),
        "filter" => Order::Filter(argument.to_lowercase()),
        "cell" => Order::Cell(cell(argument, model)?),
        "metric" => Order::Metric(metric(argument, model)?),
        "axis" => match argument {
            "time" => Order::Axis(ChartX::RenderS),
            "spp" | "samples" => Order::Axis(ChartX::Samples),
            _ => return Err(format!("expected `axis time` or `axis spp`, found `{argument}`")),
        },
        "show" => Order::Picture(picture(argument)?),
        "play" => Order::Play,
        "time" => {
            let length = argument.parse().ok().filter(|length: &f64| length.is_finite());
            Order::Moment(length.ok_or_else(|| format!("expected a path length, found `{argument}`"))?)
        }
        "flicker" => Order::Flicker,
        "exposure" => {
            let stops = argument.parse().ok().filter(|stops: &f32| stops.is_finite());
            Order::Exposure(stops.ok_or_else(|| format!("expected a number of stops, found `{argument}`"))?)
        }
        _ => Order::Help,
    };
    Ok(order)
}

/// The one command that begins with `name`.
fn full_name(name: &str) -> Result<&'static str, String> {
    let names = || COMMANDS.iter().map(|(name, ..)| *name);
    let mut matching = names().filter(|known| known.starts_with(name));
    match (matching.next(), matching.next()) {
        _ if name.is_empty() => Err("a command is missing; `help` lists them".to_owned()),
        (Some(only), None) => Ok(only),
        (Some(first), Some(second)) => {
            names().find(|known| *known == name).ok_or_else(|| format!("`{name}` may be `{first}` or `{second}`"))
        }
        (None, _) => Err(match suggest::nearest(name, names()) {
            Some(near) => format!("there is no command `{name}`; did you mean `{near}`?"),
            None => format!("there is no command `{name}`; `help` lists them"),
        }),
    }
}

/// `64spp`, `64`, `30s`, `5m`, `2h`.
fn limit(text: &str) -> Result<PauseAt, String> {
    let wrong = || format!("expected samples or render time such as 64spp, 30s or 5m, found `{text}`");
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let number: f64 = number.parse().map_err(|_| wrong())?;
    match unit.trim() {
        "" | "spp" if number >= 1.0 && number.fract() == 0.0 => Ok(PauseAt::Samples(number as u64)),
        "s" => Ok(PauseAt::RenderS(number)),
        "m" | "min" => Ok(PauseAt::RenderS(number * 60.0)),
        "h" => Ok(PauseAt::RenderS(number * 3600.0)),
        _ => Err(wrong()),
    }
}

fn cell(text: &str, model: &Model) -> Result<usize, String> {
    let cells = model.cells.len();
    let number = text.parse::<usize>().ok().filter(|n| (1..=cells).contains(n));
    number.map(|n| n - 1).ok_or_else(|| format!("expected the number of a cell, 1 to {cells}, found `{text}`"))
}

fn metric(text: &str, model: &Model) -> Result<usize, String> {
    let metrics = model.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
    let names = || metrics.iter().map(|m| m.column.as_str());
    names().position(|name| name == text).ok_or_else(|| match suggest::nearest(text, names()) {
        Some(near) => format!("there is no metric `{text}`; did you mean `{near}`?"),
        None => format!("the metrics are {}", names().collect::<Vec<_>>().join(", ")),
    })
}

fn picture(text: &str) -> Result<Picture, String> {
    let mut matching = Picture::ALL.iter().filter(|kind| !text.is_empty() && kind.name().starts_with(text));
    let names = || Picture::ALL.map(Picture::name).join(", ");
    matching.next().copied().ok_or_else(|| format!("expected one of {}, found `{text}`", names()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::tests::night::in_the_middle;

    fn ordered(line: &str) -> Result<Order, String> {
        read(line, &in_the_middle().model().0)
    }

    #[test]
    fn every_command_can_be_said_and_cut_short() {
        let said = |line: &str| ordered(line).unwrap();
        assert_eq!(said("pause"), Order::Night(Command::Pause(Some(true))));
        assert_eq!(said("pause 64spp"), Order::Night(Command::PauseAt(Some(PauseAt::Samples(64)))));
        assert_eq!(said("pa 1.5m"), Order::Night(Command::PauseAt(Some(PauseAt::RenderS(90.0)))));
        assert_eq!(said("resume"), Order::Night(Command::Pause(Some(false))));
        assert_eq!(said("stop cell"), Order::Night(Command::StopAfterCell));
        assert_eq!(said("stop"), Order::Night(Command::Stop));
        assert_eq!(said("  filter  Depth=5 Failed "), Order::Filter("depth=5 failed".to_owned()));
        assert_eq!(said("cell 3"), Order::Cell(2));
        assert_eq!(said("m psnr"), Order::Metric(2));
        assert_eq!(said("axis spp"), Order::Axis(ChartX::Samples));
        assert_eq!(said("show diff"), Order::Picture(Picture::Difference));
        assert_eq!(said("exp -1.5"), Order::Exposure(-1.5));
        assert_eq!((said("time 6.25"), said("pl")), (Order::Moment(6.25), Order::Play));
        for (name, ..) in COMMANDS {
            assert!(!matches!(ordered(name), Err(e) if e.contains("no command")), "{name}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_answered() {
        let answer = |line: &str| ordered(line).unwrap_err();
        assert!(answer("").contains("missing"));
        assert_eq!(answer("s"), "`s` may be `skip` or `stop`");
        assert_eq!(answer("pauze"), "there is no command `pauze`; did you mean `pause`?");
        assert!(answer("pause soon").contains("64spp"));
        assert!(answer("pause 0").contains("64spp"));
        assert!(answer("cell 5").contains("1 to 4"));
        assert_eq!(answer("metric rsme"), "there is no metric `rsme`; did you mean `rmse`?");
        assert!(answer("show nothing").contains("difference"));
        assert!(answer("exposure bright").contains("stops"));
        assert!(answer("time late").contains("path length"));
        assert!(answer("stop now").contains("stop cell"));
    }
}
