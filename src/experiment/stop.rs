//! Stop rules as data.

/// How a threshold is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparison {
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
}

/// When a cell is finished.
#[derive(Clone, Debug, PartialEq)]
pub enum StopRule {
    /// Render time in seconds has been spent.
    Time(f64),
    /// Every pixel has this many samples; waves are cut so that it is exact.
    Samples(u64),
    /// This many waves were rendered.
    Waves(u64),
    /// A metric compares with a value in `hold` consecutive measurements.
    When {
        /// Metric column.
        column: String,
        /// Comparison.
        op: Comparison,
        /// Threshold.
        value: f64,
        /// Consecutive measurements.
        hold: u32,
    },
    /// At least this many invalid (NaN or infinite) samples were met.
    Nan(u64),
    /// A function of the script says so; the number is the script room's own.
    Predicate(usize),
    /// Any of these; the first that holds is the reason.
    Any(Vec<StopRule>),
    /// All of these.
    All(Vec<StopRule>),
    /// Not this.
    Not(Box<StopRule>),
}
