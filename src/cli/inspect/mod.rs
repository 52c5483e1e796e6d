//! Verbs that read results: `ls`, `show`, `status`, `watch`, `note`, `report`, `view`, `metric`
//! and `diff`.

pub(in crate::cli) mod compare;
pub(in crate::cli) mod explain;
pub(in crate::cli) mod export_night;
pub mod follow;
mod guiding;
pub mod list;
pub(in crate::cli) mod note;
mod page_server;
mod picture_limits;
pub(in crate::cli) mod report;
pub(in crate::cli) mod status;
pub(in crate::cli) mod view;
pub mod watch;
