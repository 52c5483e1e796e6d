//! Means of finished runs, and the time at which they are compared.

use super::*;

#[test]
fn a_cell_of_a_heat_map_is_a_geometric_mean() {
    let mut night = night("Sample GPU", 1.0);
    let runs = night.runs.iter_mut().map(Arc::make_mut);
    for (run, error) in runs.zip([0.1, 0.2, 0.4]) {
        let last = Arc::make_mut(&mut run.rows).last_mut().unwrap();
        last.metrics[0] = error;
    }
    let made = report(&[night], &ReportOptions::default());
    let svg = item(&made, "figures/heat-rmse").svg.as_deref().unwrap();
    assert!(svg.contains(">0.200</text>"), "{svg}");
}

#[test]
fn unfinished_runs_do_not_shorten_the_time_of_a_comparison() {
    let times = |night: Night| {
        let made = report(&[night], &ReportOptions::default());
        let table = item(&made, "tables/equal-time-rmse").table.clone().unwrap();
        let rows = table.rows.into_iter();
        rows.map(|(labels, _)| labels).collect::<Vec<_>>()
    };
    let mut unfinished = night("Sample GPU", 1.0);
    let run = Arc::make_mut(&mut unfinished.runs[2]);
    run.state = UNFINISHED;
    Arc::make_mut(&mut run.rows).truncate(2);
    assert_eq!(times(unfinished), times(night("Sample GPU", 1.0)));
}
