//! Modes of the screen, and what the user can request of the night.

use lumbre_night::experiment::PauseAt;

/// Pane that is enlarged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Focus {
    /// All panes share the screen.
    #[default]
    Overview,
    /// The picture pane.
    Picture,
    /// The chart pane.
    Chart,
    /// The log pane.
    Log,
    /// The plan pane.
    Plan,
}

impl Focus {
    /// All panes in the order of the Tab key.
    pub const ORDER: [Focus; 5] = [
        Focus::Overview,
        Focus::Picture,
        Focus::Chart,
        Focus::Log,
        Focus::Plan,
    ];

    /// Returns what the Tab key enlarges next.
    pub fn next(self) -> Focus {
        self.moved(1)
    }

    /// Returns what is enlarged after some presses of the Tab key.
    pub fn moved(self, by: usize) -> Focus {
        let now = Focus::ORDER.iter().position(|focus| *focus == self);
        Focus::ORDER[(now.unwrap_or(0) + by) % Focus::ORDER.len()]
    }
}

/// Horizontal axis of the chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChartX {
    /// Render time in seconds.
    #[default]
    RenderS,
    /// Samples per pixel.
    Samples,
}

lumbre_light::named! {
    /// Content of the picture pane.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum PictureMode {
        /// The picture that is being rendered.
        #[default]
        Live = "live",
        /// The reference image of the cell.
        Reference = "reference",
        /// Absolute error of every pixel.
        Difference = "difference",
        /// FLIP error: the difference seen when alternating between picture and reference.
        Flip = "flip",
        /// Thumbnails of the per-strategy films of the last cell that stored them.
        Strategies = "strategies",
        /// One frame of the time-resolved film.
        Time = "time",
    }
}

impl PictureMode {
    /// Whether the mode compares with a reference.
    pub fn needs_reference(self) -> bool {
        matches!(
            self,
            PictureMode::Reference | PictureMode::Difference | PictureMode::Flip
        )
    }
}

/// Layout of the cells in the plan pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlanLayout {
    /// A tree if that is shorter: only the group of the current cell is open.
    #[default]
    Follow,
    /// A tree with every group open.
    Open,
    /// A list with one row for each cell.
    Flat,
}

/// A request of the user to the night.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NightRequest {
    /// Stop after this wave; a second request quits at once. When watching: quit.
    Stop,
    /// Toggle stopping after this cell.
    StopAfterCell,
    /// Pause, resume, or toggle if `None`.
    Pause(Option<bool>),
    /// Pause when the cell reaches this limit.
    PauseAt(Option<PauseAt>),
    /// Skip the current cell.
    Skip,
    /// Restart the current cell from its first sample.
    Restart,
}
