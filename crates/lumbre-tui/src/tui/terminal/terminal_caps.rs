//! Capabilities of the terminal: colours, glyphs, graphics, and whether a dashboard is possible.

use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::border;

/// Form of the progress output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputMode {
    /// The dashboard on the whole terminal.
    Dashboard,
    /// Plain progress lines.
    Lines,
}

/// Selects the output mode; `env` looks up environment variables.
///
/// Outputs that are not a terminal get lines, as do terminals with `TERM=dumb` and (outside
/// Windows) without `TERM`.
pub fn output_mode(is_terminal: bool, env: &dyn Fn(&str) -> Option<String>) -> OutputMode {
    let capable = match env("TERM") {
        Some(term) => !term.is_empty() && term != "dumb",
        None => cfg!(windows),
    };
    if is_terminal && capable {
        OutputMode::Dashboard
    } else {
        OutputMode::Lines
    }
}

/// Whether lines are coloured: `NO_COLOR` disables colours; otherwise `CLICOLOR_FORCE` enables
/// them; otherwise a capable terminal uses them unless `CLICOLOR` is 0.
pub fn use_colors(is_terminal: bool, env: &dyn Fn(&str) -> Option<String>) -> bool {
    if set(env, "NO_COLOR") {
        return false;
    }
    if env("CLICOLOR_FORCE").is_some_and(|v| !v.is_empty() && v != "0") {
        return true;
    }
    output_mode(is_terminal, env) == OutputMode::Dashboard
        && env("CLICOLOR").as_deref() != Some("0")
}

fn set(env: &dyn Fn(&str) -> Option<String>, name: &str) -> bool {
    env(name).is_some_and(|v| !v.is_empty())
}

/// Number of colours of the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colors {
    /// No colours: only bold, dim and reverse.
    None,
    /// The 256 indexed colours.
    Ansi256,
    /// Direct colours of 24 bits.
    True,
}

/// Protocol for pictures. `tmux`: wrap them in tmux's passthrough sequence, which tmux must allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Graphics {
    /// Half blocks: two pixels in each character cell.
    Blocks,
    /// Graphics protocol of kitty with Unicode placeholders.
    Kitty {
        /// Whether the terminal runs inside tmux.
        tmux: bool,
    },
    /// Graphics in the sixel format.
    Sixel {
        /// Whether the terminal runs inside tmux.
        tmux: bool,
    },
    /// Inline images of iTerm2.
    Iterm2 {
        /// Whether the terminal runs inside tmux.
        tmux: bool,
    },
}

impl Graphics {
    /// Selects the protocol from `LUMBRE_GRAPHICS` (`blocks`, `kitty`, `sixel`, `iterm2`), or else
    /// from the terminal's name. Inside tmux and screen it is blocks unless that variable is set.
    pub fn from_env(env: &dyn Fn(&str) -> Option<String>) -> Graphics {
        let term = env("TERM").unwrap_or_default();
        let tmux = set(env, "TMUX") || term.starts_with("tmux");
        match env("LUMBRE_GRAPHICS").as_deref() {
            Some("kitty") => return Graphics::Kitty { tmux },
            Some("sixel") => return Graphics::Sixel { tmux },
            Some("iterm2") => return Graphics::Iterm2 { tmux },
            Some("blocks") => return Graphics::Blocks,
            _ if tmux || term.starts_with("screen") => return Graphics::Blocks,
            _ => {}
        }
        match env("TERM_PROGRAM").as_deref() {
            Some("ghostty") => Graphics::Kitty { tmux },
            Some("iTerm.app" | "WezTerm") => Graphics::Iterm2 { tmux },
            _ if set(env, "KITTY_WINDOW_ID") || term == "xterm-kitty" => Graphics::Kitty { tmux },
            _ if term.starts_with("foot") || term == "mlterm" => Graphics::Sixel { tmux },
            _ => Graphics::Blocks,
        }
    }
}

/// Display capabilities of the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerminalCaps {
    /// Number of colours.
    pub colors: Colors,
    /// Whether only ASCII glyphs can be displayed.
    pub ascii: bool,
}

/// Symbols that differ between UTF-8 and ASCII terminals. Each is one column wide except
/// `ellipsis`, `at_most` and `separator`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glyphs {
    /// A waiting cell.
    pub waiting: &'static str,
    /// A running cell.
    pub running: &'static str,
    /// A finished cell.
    pub done: &'static str,
    /// A cell finished by an earlier night.
    pub cached: &'static str,
    /// A failed cell.
    pub failed: &'static str,
    /// An interrupted cell.
    pub interrupted: &'static str,
    /// A group whose cells are shown.
    pub open: &'static str,
    /// A group whose cells are hidden.
    pub closed: &'static str,
    /// Cursor of the prompt.
    pub cursor: &'static str,
    /// End of truncated text.
    pub ellipsis: &'static str,
    /// Sign for "at most".
    pub at_most: &'static str,
    /// Sign for "about".
    pub about: &'static str,
    /// Separator between two facts on a line.
    pub separator: &'static str,
    /// Filled part of a gauge.
    pub bar: &'static str,
    /// Empty part of a gauge.
    pub track: &'static str,
    /// Grid line of the chart.
    pub grid: &'static str,
    /// Threshold line of the chart.
    pub threshold: &'static str,
    /// Vertical axis, and a tick on it.
    pub axis_y: [&'static str; 2],
    /// Horizontal axis, a tick on it, and the corner.
    pub axis_x: [&'static str; 3],
}

const UNICODE: Glyphs = Glyphs {
    waiting: "·",
    running: "▸",
    done: "✓",
    cached: "≡",
    failed: "✗",
    interrupted: "‖",
    open: "▾",
    closed: "▹",
    cursor: "▏",
    ellipsis: "…",
    at_most: "≤",
    about: "~",
    separator: " · ",
    bar: "━",
    track: "─",
    grid: "┈",
    threshold: "╌",
    axis_y: ["│", "┤"],
    axis_x: ["─", "┬", "└"],
};

const ASCII: Glyphs = Glyphs {
    waiting: ".",
    running: ">",
    done: "+",
    cached: "=",
    failed: "x",
    interrupted: "!",
    open: "v",
    closed: ">",
    cursor: "_",
    ellipsis: "..",
    at_most: "<=",
    about: "~",
    separator: ", ",
    bar: "#",
    track: "-",
    grid: ".",
    threshold: "~",
    axis_y: ["|", "+"],
    axis_x: ["-", "+", "+"],
};

const ASCII_BORDER: border::Set<'static> = border::Set {
    top_left: "+",
    top_right: "+",
    bottom_left: "+",
    bottom_right: "+",
    vertical_left: "|",
    vertical_right: "|",
    horizontal_top: "-",
    horizontal_bottom: "-",
};

impl TerminalCaps {
    /// Reads the capabilities from `NO_COLOR`, `COLORTERM` and the locale in `LC_ALL`, `LC_CTYPE`,
    /// `LANG`.
    ///
    /// The first locale variable that is not empty counts; if it does not name UTF-8, only ASCII is
    /// used. Windows has no such variables and uses UTF-8.
    pub fn from_env(env: &dyn Fn(&str) -> Option<String>) -> TerminalCaps {
        let colors = if set(env, "NO_COLOR") {
            Colors::None
        } else if env("COLORTERM").is_some_and(|v| v == "truecolor" || v == "24bit") {
            Colors::True
        } else {
            Colors::Ansi256
        };
        let locale = ["LC_ALL", "LC_CTYPE", "LANG"]
            .iter()
            .find_map(|name| env(name).filter(|v| !v.is_empty()));
        let utf8 = match locale {
            Some(locale) => {
                let locale = locale.to_ascii_lowercase();
                locale.contains("utf-8") || locale.contains("utf8")
            }
            None => cfg!(windows),
        };
        TerminalCaps {
            colors,
            ascii: !utf8,
        }
    }

    /// Returns the symbols to draw with.
    pub fn glyphs(&self) -> &'static Glyphs {
        if self.ascii { &ASCII } else { &UNICODE }
    }

    /// Border of a pane.
    pub(crate) fn border(&self) -> border::Set<'static> {
        if self.ascii {
            ASCII_BORDER
        } else {
            border::ROUNDED
        }
    }

    fn color(&self, rich: Color, plain: Color) -> Style {
        match self.colors {
            Colors::None => Style::new(),
            Colors::Ansi256 => Style::new().fg(plain),
            Colors::True => Style::new().fg(rich),
        }
    }

    /// Style of highlighted text.
    pub(crate) fn accent(&self) -> Style {
        self.color(Color::Rgb(255, 158, 61), Color::Indexed(215))
            .add_modifier(Modifier::BOLD)
    }

    /// Style of the current curve and of gauges.
    pub(crate) fn glow(&self) -> Style {
        self.color(Color::Rgb(255, 158, 61), Color::Indexed(215))
    }

    /// Colour of the curves of a compared technique; `None` without colours. The colours are those
    /// of Okabe and Ito [2008] that are light enough for a dark terminal.
    pub(crate) fn series(&self, index: usize) -> Option<Color> {
        const COLOURS: [((u8, u8, u8), u8); 6] = [
            ((86, 180, 233), 74),
            ((230, 159, 0), 178),
            ((0, 178, 130), 36),
            ((214, 134, 178), 175),
            ((240, 228, 66), 221),
            ((228, 108, 36), 166),
        ];
        let ((red, green, blue), plain) = COLOURS[index % COLOURS.len()];
        self.color(Color::Rgb(red, green, blue), Color::Indexed(plain))
            .fg
    }

    /// Colour of the curves behind the current one; `None` without colours.
    pub(crate) fn behind(&self) -> Option<Color> {
        self.color(Color::Rgb(98, 98, 104), Color::Indexed(240)).fg
    }

    /// Style of success.
    pub(crate) fn good(&self) -> Style {
        self.color(Color::Rgb(126, 196, 110), Color::Green)
    }

    /// Style of warnings.
    pub(crate) fn warn(&self) -> Style {
        self.color(Color::Rgb(236, 200, 80), Color::Yellow)
    }

    /// Style of errors.
    pub(crate) fn bad(&self) -> Style {
        self.color(Color::Rgb(240, 96, 88), Color::Red)
            .add_modifier(Modifier::BOLD)
    }

    /// Style of labels, borders and units.
    pub(crate) fn dim(&self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    /// Style of values.
    pub(crate) fn strong(&self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }
}

#[cfg(test)]
mod tests {
    use crate::tui::terminal::terminal_caps::*;

    fn env(pairs: &'static [(&'static str, &'static str)]) -> impl Fn(&str) -> Option<String> {
        move |name| {
            pairs
                .iter()
                .find(|(k, _)| *k == name)
                .map(|(_, v)| (*v).to_owned())
        }
    }

    #[test]
    fn only_a_capable_terminal_gets_the_dashboard() {
        assert_eq!(
            output_mode(true, &env(&[("TERM", "xterm-256color")])),
            OutputMode::Dashboard
        );
        assert_eq!(
            output_mode(false, &env(&[("TERM", "xterm-256color")])),
            OutputMode::Lines
        );
        assert_eq!(
            output_mode(true, &env(&[("TERM", "dumb")])),
            OutputMode::Lines
        );
        assert_eq!(
            output_mode(true, &env(&[("TERM", "tmux-256color"), ("NO_COLOR", "1")])),
            OutputMode::Dashboard
        );
        #[cfg(not(windows))]
        assert_eq!(output_mode(true, &env(&[])), OutputMode::Lines);
    }

    #[test]
    fn colours_follow_the_conventions() {
        assert!(use_colors(true, &env(&[("TERM", "xterm")])));
        assert!(!use_colors(false, &env(&[("TERM", "xterm")])));
        assert!(use_colors(false, &env(&[("CLICOLOR_FORCE", "1")])));
        assert!(!use_colors(false, &env(&[("CLICOLOR_FORCE", "0")])));
        assert!(!use_colors(
            true,
            &env(&[
                ("TERM", "xterm"),
                ("NO_COLOR", "1"),
                ("CLICOLOR_FORCE", "1")
            ])
        ));
        assert!(use_colors(
            true,
            &env(&[("TERM", "xterm"), ("NO_COLOR", "")])
        ));
        assert!(!use_colors(
            true,
            &env(&[("TERM", "xterm"), ("CLICOLOR", "0")])
        ));
        assert!(!use_colors(true, &env(&[("TERM", "dumb")])));
    }

    #[test]
    fn pictures_are_blocks_under_tmux_unless_overridden() {
        let graphics = |pairs| Graphics::from_env(&env(pairs));
        assert_eq!(
            graphics(&[("TERM", "xterm-kitty")]),
            Graphics::Kitty { tmux: false }
        );
        assert_eq!(
            graphics(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")]),
            Graphics::Iterm2 { tmux: false }
        );
        assert_eq!(
            graphics(&[("TERM", "foot")]),
            Graphics::Sixel { tmux: false }
        );
        assert_eq!(graphics(&[("TERM", "xterm-256color")]), Graphics::Blocks);
        assert_eq!(
            graphics(&[
                ("TERM", "tmux-256color"),
                ("TMUX", "x"),
                ("KITTY_WINDOW_ID", "1")
            ]),
            Graphics::Blocks
        );
        let overridden = graphics(&[
            ("TERM", "screen"),
            ("TMUX", "x"),
            ("LUMBRE_GRAPHICS", "sixel"),
        ]);
        assert_eq!(overridden, Graphics::Sixel { tmux: true });
        assert_eq!(
            graphics(&[("TERM", "xterm-kitty"), ("LUMBRE_GRAPHICS", "blocks")]),
            Graphics::Blocks
        );
    }

    #[test]
    fn capabilities_follow_colorterm_and_the_locale() {
        let caps = |pairs| TerminalCaps::from_env(&env(pairs));
        assert_eq!(
            caps(&[("COLORTERM", "truecolor"), ("LANG", "de_DE.UTF-8")]),
            TerminalCaps {
                colors: Colors::True,
                ascii: false
            }
        );
        assert_eq!(
            caps(&[("LANG", "en_US.utf8")]),
            TerminalCaps {
                colors: Colors::Ansi256,
                ascii: false
            }
        );
        assert_eq!(
            caps(&[
                ("NO_COLOR", "1"),
                ("COLORTERM", "24bit"),
                ("LANG", "C.UTF-8")
            ])
            .colors,
            Colors::None
        );
        assert!(
            caps(&[("LC_ALL", "C"), ("LANG", "en_US.UTF-8")]).ascii,
            "LC_ALL wins over LANG"
        );
        assert!(!caps(&[("LC_ALL", ""), ("LC_CTYPE", "en_US.UTF-8"), ("LANG", "C")]).ascii);
        #[cfg(not(windows))]
        assert!(caps(&[]).ascii, "no locale at all is the C locale");
    }
}
