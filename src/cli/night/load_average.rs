//! The warning about a machine that other programs keep busy, whose render times vary.

use crate::cli::format::{counted, rounded};
use lumbre_night::experiment::Plan;
use lumbre_night::experiment::spec::Order;

/// Share of the machine that other programs may use without a warning.
const MAX_LOAD: f64 = 0.3;

/// Returns a warning if other programs keep this machine busy and cells of the plan end by time.
pub fn warning(plan: &Plan) -> Option<String> {
    let is_timed = plan
        .cells
        .iter()
        .any(|cell| cell.stop.time_limit_s().is_some());
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    let load: f64 = text.split_whitespace().next()?.parse().ok()?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    (is_timed && load > MAX_LOAD * cores as f64).then(|| message(load, cores, plan.night.order))
}

fn message(load: f64, cores: usize, order: Order) -> String {
    let remedy = if order == Order::Interleave {
        "techniques take turns, so that all are slowed alike"
    } else {
        "without `order` in experiment(..) techniques would take turns"
    };
    format!(
        "in the last minute, {} of {} were busy: render times vary more than on an idle machine; \
         {remedy}",
        rounded(load),
        counted(cores, "core")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warning_says_what_turns_do() {
        let text = message(1.5, 2, Order::Sequential);
        assert!(
            text.starts_with("in the last minute, 1.5 of 2 cores were busy"),
            "{text}"
        );
        assert!(text.contains("without `order`"), "{text}");
        assert!(message(1.5, 2, Order::Interleave).ends_with("slowed alike"));
    }
}
