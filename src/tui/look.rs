//! What the terminal can show: colours, glyphs, and whether a dashboard makes sense at all.

use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::border;

/// Which of the two faces of a night suits the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The dashboard, on the whole terminal.
    Dashboard,
    /// Plain lines.
    Lines,
}

/// The mode for an output that is, or is not, a terminal; `env` looks up environment variables.
///
/// A terminal that calls itself `dumb`, or (outside Windows) does not say what it is, gets lines.
pub fn wanted(is_terminal: bool, env: &dyn Fn(&str) -> Option<String>) -> Mode {
    let capable = match env("TERM") {
        Some(term) => !term.is_empty() && term != "dumb",
        None => cfg!(windows),
    };
    if is_terminal && capable { Mode::Dashboard } else { Mode::Lines }
}

/// Whether lines may carry colours: `NO_COLOR` forbids them, then `CLICOLOR_FORCE` demands them, then a capable
/// terminal has them unless `CLICOLOR` is 0.
pub fn colored(is_terminal: bool, env: &dyn Fn(&str) -> Option<String>) -> bool {
    if set(env, "NO_COLOR") {
        return false;
    }
    if env("CLICOLOR_FORCE").is_some_and(|v| !v.is_empty() && v != "0") {
        return true;
    }
    wanted(is_terminal, env) == Mode::Dashboard && env("CLICOLOR").as_deref() != Some("0")
}

fn set(env: &dyn Fn(&str) -> Option<String>, name: &str) -> bool {
    env(name).is_some_and(|v| !v.is_empty())
}

/// How many colours there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colors {
    /// None: bold, dim and reverse only.
    None,
    /// The 256 indexed ones.
    Ansi256,
    /// Three bytes for every colour.
    True,
}

/// How pictures are shown. `tmux` says that they have to be handed through tmux, which must allow it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Graphics {
    /// Two pixels in each character cell.
    Blocks,
    /// The protocol of kitty, with placeholders.
    Kitty {
        /// Whether tmux is in between.
        tmux: bool,
    },
    /// Sixels.
    Sixel {
        /// Whether tmux is in between.
        tmux: bool,
    },
    /// The protocol of iTerm2.
    Iterm2 {
        /// Whether tmux is in between.
        tmux: bool,
    },
}

impl Graphics {
    /// What the environment says: `LUMBRE_GRAPHICS` (`blocks`, `kitty`, `sixel`, `iterm2`), or else the terminal's name.
    /// Inside tmux and screen pictures are blocks unless that variable says otherwise.
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

/// What the terminal can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// How many colours there are.
    pub colors: Colors,
    /// Whether glyphs must stay within ASCII.
    pub ascii: bool,
}

/// The signs that differ between UTF-8 and ASCII terminals. Each is one column wide but for `ellipsis`, `at_most`
/// and `separator`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glyphs {
    /// A cell that waits.
    pub waiting: &'static str,
    /// A cell that runs.
    pub running: &'static str,
    /// A cell that is done.
    pub done: &'static str,
    /// A cell that an earlier night had done.
    pub cached: &'static str,
    /// A cell that failed.
    pub failed: &'static str,
    /// A cell that was interrupted.
    pub interrupted: &'static str,
    /// A group whose cells follow.
    pub open: &'static str,
    /// A group whose cells do not.
    pub closed: &'static str,
    /// Where the next letter goes.
    pub cursor: &'static str,
    /// Text that goes on.
    pub ellipsis: &'static str,
    /// At most.
    pub at_most: &'static str,
    /// About.
    pub about: &'static str,
    /// Between two facts on a line.
    pub separator: &'static str,
    /// The part of a gauge that is done.
    pub bar: &'static str,
    /// The part of a gauge that is not.
    pub track: &'static str,
    /// A grid line across the chart.
    pub grid: &'static str,
    /// The line of a threshold across the chart.
    pub threshold: &'static str,
    /// The vertical axis, and a tick on it.
    pub axis_y: [&'static str; 2],
    /// The horizontal axis, a tick on it, and the corner.
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

impl Look {
    /// What the environment says: `NO_COLOR`, `COLORTERM`, and the locale in `LC_ALL`, `LC_CTYPE`, `LANG`.
    ///
    /// The first of the locale variables that is not empty counts; one that does not name UTF-8 means ASCII. Windows
    /// has no such variables and draws UTF-8.
    pub fn from_env(env: &dyn Fn(&str) -> Option<String>) -> Look {
        let colors = if set(env, "NO_COLOR") {
            Colors::None
        } else if env("COLORTERM").is_some_and(|v| v == "truecolor" || v == "24bit") {
            Colors::True
        } else {
            Colors::Ansi256
        };
        let locale = ["LC_ALL", "LC_CTYPE", "LANG"].iter().find_map(|name| env(name).filter(|v| !v.is_empty()));
        let utf8 = match locale {
            Some(locale) => {
                let locale = locale.to_ascii_lowercase();
                locale.contains("utf-8") || locale.contains("utf8")
            }
            None => cfg!(windows),
        };
        Look { colors, ascii: !utf8 }
    }

    /// The signs to draw with.
    pub fn glyphs(&self) -> &'static Glyphs {
        if self.ascii { &ASCII } else { &UNICODE }
    }

    /// The frame of a pane.
    pub(super) fn border(&self) -> border::Set<'static> {
        if self.ascii { ASCII_BORDER } else { border::ROUNDED }
    }

    fn color(&self, rich: Color, plain: Color) -> Style {
        match self.colors {
            Colors::None => Style::new(),
            Colors::Ansi256 => Style::new().fg(plain),
            Colors::True => Style::new().fg(rich),
        }
    }

    /// What stands out: the glow of the fire.
    pub(super) fn accent(&self) -> Style {
        self.color(Color::Rgb(255, 158, 61), Color::Indexed(215)).add_modifier(Modifier::BOLD)
    }

    /// The curve of the chart and the gauge.
    pub(super) fn glow(&self) -> Style {
        self.color(Color::Rgb(255, 158, 61), Color::Indexed(215))
    }

    /// The curves behind the current one, where colours can tell them apart.
    pub(super) fn behind(&self) -> Option<Color> {
        self.color(Color::Rgb(98, 98, 104), Color::Indexed(240)).fg
    }

    /// What went well.
    pub(super) fn good(&self) -> Style {
        self.color(Color::Rgb(126, 196, 110), Color::Green)
    }

    /// What deserves a look.
    pub(super) fn warn(&self) -> Style {
        self.color(Color::Rgb(236, 200, 80), Color::Yellow)
    }

    /// What went wrong.
    pub(super) fn bad(&self) -> Style {
        self.color(Color::Rgb(240, 96, 88), Color::Red).add_modifier(Modifier::BOLD)
    }

    /// Labels, frames, units.
    pub(super) fn dim(&self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    /// Values.
    pub(super) fn strong(&self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn env(pairs: &'static [(&'static str, &'static str)]) -> impl Fn(&str) -> Option<String> {
        move |name| pairs.iter().find(|(k, _)| *k == name).map(|(_, v)| (*v).to_owned())
    }

    #[test]
    fn only_a_capable_terminal_gets_the_dashboard() {
        assert_eq!(wanted(true, &env(&[("TERM", "xterm-256color")])), Mode::Dashboard);
        assert_eq!(wanted(false, &env(&[("TERM", "xterm-256color")])), Mode::Lines);
        assert_eq!(wanted(true, &env(&[("TERM", "dumb")])), Mode::Lines);
        assert_eq!(wanted(true, &env(&[("TERM", "tmux-256color"), ("NO_COLOR", "1")])), Mode::Dashboard);
        #[cfg(not(windows))]
        assert_eq!(wanted(true, &env(&[])), Mode::Lines);
    }

    #[test]
    fn colours_follow_the_conventions() {
        assert!(colored(true, &env(&[("TERM", "xterm")])));
        assert!(!colored(false, &env(&[("TERM", "xterm")])));
        assert!(colored(false, &env(&[("CLICOLOR_FORCE", "1")])));
        assert!(!colored(false, &env(&[("CLICOLOR_FORCE", "0")])));
        assert!(!colored(true, &env(&[("TERM", "xterm"), ("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")])));
        assert!(colored(true, &env(&[("TERM", "xterm"), ("NO_COLOR", "")])));
        assert!(!colored(true, &env(&[("TERM", "xterm"), ("CLICOLOR", "0")])));
        assert!(!colored(true, &env(&[("TERM", "dumb")])));
    }

    #[test]
    fn pictures_are_blocks_under_tmux_unless_it_is_said() {
        let graphics = |pairs| Graphics::from_env(&env(pairs));
        assert_eq!(graphics(&[("TERM", "xterm-kitty")]), Graphics::Kitty { tmux: false });
        assert_eq!(
            graphics(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")]),
            Graphics::Iterm2 { tmux: false }
        );
        assert_eq!(graphics(&[("TERM", "foot")]), Graphics::Sixel { tmux: false });
        assert_eq!(graphics(&[("TERM", "xterm-256color")]), Graphics::Blocks);
        assert_eq!(graphics(&[("TERM", "tmux-256color"), ("TMUX", "x"), ("KITTY_WINDOW_ID", "1")]), Graphics::Blocks);
        let said = graphics(&[("TERM", "screen"), ("TMUX", "x"), ("LUMBRE_GRAPHICS", "sixel")]);
        assert_eq!(said, Graphics::Sixel { tmux: true });
        assert_eq!(graphics(&[("TERM", "xterm-kitty"), ("LUMBRE_GRAPHICS", "blocks")]), Graphics::Blocks);
    }

    #[test]
    fn the_look_follows_colorterm_and_the_locale() {
        let look = |pairs| Look::from_env(&env(pairs));
        assert_eq!(
            look(&[("COLORTERM", "truecolor"), ("LANG", "de_DE.UTF-8")]),
            Look { colors: Colors::True, ascii: false }
        );
        assert_eq!(look(&[("LANG", "en_US.utf8")]), Look { colors: Colors::Ansi256, ascii: false });
        assert_eq!(look(&[("NO_COLOR", "1"), ("COLORTERM", "24bit"), ("LANG", "C.UTF-8")]).colors, Colors::None);
        assert!(look(&[("LC_ALL", "C"), ("LANG", "en_US.UTF-8")]).ascii, "LC_ALL wins over LANG");
        assert!(!look(&[("LC_ALL", ""), ("LC_CTYPE", "en_US.UTF-8"), ("LANG", "C")]).ascii);
        #[cfg(not(windows))]
        assert!(look(&[]).ascii, "no locale at all is the C locale");
    }
}
