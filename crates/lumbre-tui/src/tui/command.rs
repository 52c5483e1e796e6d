//! The command bar: commands for everything that keys do, and for what needs an argument.

use super::model::night::NightModel;
use crate::tui::modes::{ChartX, NightRequest, PictureMode};
use lumbre_light::value::suggest;
use lumbre_night::experiment::PauseAt;

/// A parsed line of the command bar.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// A request to the night.
    Night(NightRequest),
    /// Show only the cells that match these words in the plan; empty shows all.
    Filter(String),
    /// Plot the metric with this index.
    Metric(usize),
    /// Set the chart's horizontal axis.
    ChartX(ChartX),
    /// Set what the picture pane shows.
    Picture(PictureMode),
    /// Start or stop the time animation.
    Play,
    /// Show the time-resolved film at this optical length, in scene units.
    OpticalLength(f64),
    /// Start or stop alternating between picture and reference.
    Flicker,
    /// Set the exposure of pictures, in stops.
    Exposure(f32),
    /// Scroll the plan to the cell with this index, from 0.
    Cell(usize),
    /// Show or hide the help.
    Help,
}

/// A command of the bar: name, argument, description.
pub type CommandInfo = (&'static str, &'static str, &'static str);

/// All commands of the bar.
pub const COMMANDS: &[CommandInfo] = &[
    (
        "pause",
        "[64spp|30s]",
        "pause now, or when the cell reaches this limit",
    ),
    ("resume", "", "resume rendering"),
    ("restart", "", "restart the cell from its first sample"),
    ("skip", "", "skip this cell"),
    ("stop", "[cell]", "stop after this wave, or after this cell"),
    (
        "filter",
        "[WORDS]",
        "show only cells that match these words",
    ),
    ("cell", "N", "scroll to cell N"),
    ("metric", "NAME", "plot this metric"),
    ("axis", "time|spp", "horizontal axis of the chart"),
    (
        "show",
        "KIND",
        "live, reference, difference, flip, strategies, time",
    ),
    ("time", "LENGTH", "show light of this optical path length"),
    ("play", "", "play or stop the time animation"),
    ("flicker", "", "alternate between picture and reference"),
    ("exposure", "STOPS", "exposure of pictures"),
    ("help", "", "keys and symbols"),
];

/// Parses a line of the command bar. Names may be abbreviated as long as they are unambiguous.
///
/// # Errors
/// A message for the user if the command does not exist or its argument is invalid.
pub fn read(line: &str, model: &NightModel) -> Result<Action, String> {
    let (name, argument) = line
        .trim()
        .split_once(char::is_whitespace)
        .unwrap_or((line.trim(), ""));
    let argument = argument.trim();
    let order = match full_name(name)? {
        "pause" if argument.is_empty() => Action::Night(NightRequest::Pause(Some(true))),
        "pause" => Action::Night(NightRequest::PauseAt(Some(limit(argument)?))),
        "resume" => Action::Night(NightRequest::Pause(Some(false))),
        "restart" => Action::Night(NightRequest::Restart),
        "skip" => Action::Night(NightRequest::Skip),
        "stop" if argument == "cell" => Action::Night(NightRequest::StopAfterCell),
        "stop" if argument.is_empty() => Action::Night(NightRequest::Stop),
        "stop" => {
            return Err(format!(
                "expected `stop` or `stop cell`, found `{argument}`"
            ));
        }
        "filter" => Action::Filter(argument.to_lowercase()),
        "cell" => Action::Cell(cell(argument, model)?),
        "metric" => Action::Metric(metric(argument, model)?),
        "axis" => match argument {
            "time" => Action::ChartX(ChartX::RenderS),
            "spp" | "samples" => Action::ChartX(ChartX::Samples),
            _ => {
                return Err(format!(
                    "expected `axis time` or `axis spp`, found `{argument}`"
                ));
            }
        },
        "show" => Action::Picture(picture(argument)?),
        "play" => Action::Play,
        "time" => {
            let length = argument
                .parse()
                .ok()
                .filter(|length: &f64| length.is_finite());
            Action::OpticalLength(
                length.ok_or_else(|| format!("expected a path length, found `{argument}`"))?,
            )
        }
        "flicker" => Action::Flicker,
        "exposure" => {
            let stops = argument
                .parse()
                .ok()
                .filter(|stops: &f32| stops.is_finite());
            Action::Exposure(
                stops.ok_or_else(|| format!("expected a number of stops, found `{argument}`"))?,
            )
        }
        _ => Action::Help,
    };
    Ok(order)
}

/// Returns the only command that begins with `name`.
fn full_name(name: &str) -> Result<&'static str, String> {
    let names = || COMMANDS.iter().map(|(name, ..)| *name);
    let mut matching = names().filter(|known| known.starts_with(name));
    match (matching.next(), matching.next()) {
        _ if name.is_empty() => Err("no command given; `help` lists them".to_owned()),
        (Some(only), None) => Ok(only),
        (Some(first), Some(second)) => names()
            .find(|known| *known == name)
            .ok_or_else(|| format!("`{name}` is ambiguous: `{first}` or `{second}`")),
        (None, _) => Err(match suggest::nearest(name, names()) {
            Some(near) => format!("there is no command `{name}`; did you mean `{near}`?"),
            None => format!("there is no command `{name}`; `help` lists them"),
        }),
    }
}

/// Parses a pause limit: `64spp`, `64`, `30s`, `5m`, `2h`.
fn limit(text: &str) -> Result<PauseAt, String> {
    let wrong =
        || format!("expected samples or render time such as 64spp, 30s or 5m, found `{text}`");
    let digits = text
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(text.len());
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

fn cell(text: &str, model: &NightModel) -> Result<usize, String> {
    let cells = model.night.runs.len();
    let number = text
        .parse::<usize>()
        .ok()
        .filter(|n| (1..=cells).contains(n));
    number
        .map(|n| n - 1)
        .ok_or_else(|| format!("expected a cell number from 1 to {cells}, found `{text}`"))
}

fn metric(text: &str, model: &NightModel) -> Result<usize, String> {
    let metrics = model.metrics();
    let names = || metrics.iter().map(|m| m.column.as_str());
    names()
        .position(|name| name == text)
        .ok_or_else(|| match suggest::nearest(text, names()) {
            Some(near) => format!("there is no metric `{text}`; did you mean `{near}`?"),
            None => format!(
                "there is no metric `{text}`; known: {}",
                names().collect::<Vec<_>>().join(", ")
            ),
        })
}

fn picture(text: &str) -> Result<PictureMode, String> {
    let mut matching = PictureMode::ALL
        .iter()
        .filter(|kind| !text.is_empty() && kind.name().starts_with(text));
    let names = || PictureMode::ALL.map(PictureMode::name).join(", ");
    matching
        .next()
        .copied()
        .ok_or_else(|| format!("expected one of {}, found `{text}`", names()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::tests::night::in_the_middle;

    fn ordered(line: &str) -> Result<Action, String> {
        read(line, &in_the_middle().model().0)
    }

    #[test]
    fn every_command_can_be_typed_and_abbreviated() {
        let parsed = |line: &str| ordered(line).unwrap();
        assert_eq!(
            parsed("pause"),
            Action::Night(NightRequest::Pause(Some(true)))
        );
        assert_eq!(
            parsed("pause 64spp"),
            Action::Night(NightRequest::PauseAt(Some(PauseAt::Samples(64))))
        );
        assert_eq!(
            parsed("pa 1.5m"),
            Action::Night(NightRequest::PauseAt(Some(PauseAt::RenderS(90.0))))
        );
        assert_eq!(
            parsed("resume"),
            Action::Night(NightRequest::Pause(Some(false)))
        );
        assert_eq!(
            parsed("stop cell"),
            Action::Night(NightRequest::StopAfterCell)
        );
        assert_eq!(parsed("stop"), Action::Night(NightRequest::Stop));
        assert_eq!(
            parsed("  filter  Depth=5 Failed "),
            Action::Filter("depth=5 failed".to_owned())
        );
        assert_eq!(parsed("cell 3"), Action::Cell(2));
        assert_eq!(parsed("m psnr"), Action::Metric(2));
        assert_eq!(parsed("axis spp"), Action::ChartX(ChartX::Samples));
        assert_eq!(
            parsed("show diff"),
            Action::Picture(PictureMode::Difference)
        );
        assert_eq!(parsed("exp -1.5"), Action::Exposure(-1.5));
        assert_eq!(
            (parsed("time 6.25"), parsed("pl")),
            (Action::OpticalLength(6.25), Action::Play)
        );
        for (name, ..) in COMMANDS {
            assert!(
                !matches!(ordered(name), Err(e) if e.contains("no command")),
                "{name}"
            );
        }
    }

    #[test]
    fn invalid_lines_are_rejected_with_a_message() {
        let answer = |line: &str| ordered(line).unwrap_err();
        assert!(answer("").contains("no command given"));
        assert_eq!(answer("s"), "`s` is ambiguous: `skip` or `stop`");
        assert_eq!(
            answer("pauze"),
            "there is no command `pauze`; did you mean `pause`?"
        );
        assert!(answer("pause soon").contains("64spp"));
        assert!(answer("pause 0").contains("64spp"));
        assert!(answer("cell 5").contains("1 to 4"));
        assert_eq!(
            answer("metric rsme"),
            "there is no metric `rsme`; did you mean `rmse`?"
        );
        assert!(answer("show nothing").contains("difference"));
        assert!(answer("exposure bright").contains("stops"));
        assert!(answer("time late").contains("path length"));
        assert!(answer("stop now").contains("stop cell"));
    }
}
