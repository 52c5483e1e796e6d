//! State of a night as the dashboard shows it, folded from events. Nothing here draws.

pub mod column;
pub mod comparison;
pub mod curve;
pub mod end_message;
pub mod eta;
pub mod night;
pub mod plan_rows;
mod remaining;
pub mod strategy_thumbnails;
pub mod time_preview;
pub mod worker_list;
