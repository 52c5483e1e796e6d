//! The significance of the A/A check, by pairs of runs whose p-values are known.

use lumbre_night::experiment::aa_check::{Finding, check};
use lumbre_night::experiment::{CellRef, EndCause, Event, Night, Outcome, WaveRow};

use crate::experiment::fixtures::Lab;

/// Returns the logarithms of the ratios of three pairs whose mean differs from 0 with this p-value,
/// by Student's t distribution in closed form for 2 degrees of freedom: `p = 1 - t / sqrt(t^2 + 2)`.
fn ratios_with_p(p: f64) -> [f64; 3] {
    let share = (1.0 - p).powi(2);
    let t = (2.0 * share / (1.0 - share)).sqrt();
    [-1.0, 0.0, 1.0].map(|x| 0.01 * (x + t / 3f64.sqrt()))
}

/// Returns the findings of a check whose speeds and, if measured, errors have these p-values.
fn findings(speed_p: f64, error_p: Option<f64>) -> Vec<Finding> {
    let mut lab = Lab::new();
    if error_p.is_some() {
        lab = lab.measured();
    }
    lab.spec.aa_check = true;
    lab.spec.repeats = 3;
    let plan = lab.plan();
    let (speed, error) = (
        ratios_with_p(speed_p),
        ratios_with_p(error_p.unwrap_or(1.0)),
    );
    let mut night = Night::planned(&plan);
    for (i, cell) in plan.cells.iter().enumerate() {
        // A double differs from its original by the ratios of its pair.
        let ratio = |of: [f64; 3]| cell.double_of.map_or(1.0, |pair| of[pair as usize].exp());
        let row = WaveRow {
            wave: 1,
            samples: 16,
            render_s: 1.0 / ratio(speed),
            metrics: vec![0.1 * ratio(error)],
            ..WaveRow::default()
        };
        let outcome = Outcome::Done(EndCause::limit("16 samples"));
        night.apply(&Event::ended(CellRef::Cell(i), outcome, vec![row]));
    }
    check(&plan, &night)
}

#[test]
fn the_level_of_the_check_is_divided_by_the_number_of_its_tests() {
    for (speed_p, error_p, alarms) in [
        (0.009, None, &[true][..]),
        (0.011, None, &[false]),
        (0.006, Some(0.5), &[false, false]),
        (0.004, Some(0.5), &[true, false]),
        (0.5, Some(0.006), &[false, false]),
        (0.004, Some(0.0049), &[true, true]),
    ] {
        let found = findings(speed_p, error_p);
        let given = std::iter::once(speed_p).chain(error_p);
        for (finding, p) in found.iter().zip(given) {
            let error = finding.p.unwrap() / p - 1.0;
            assert!(error.abs() < 1e-6, "{finding:?} has not p = {p}");
        }
        let found: Vec<bool> = found.iter().map(|finding| finding.alarm).collect();
        assert_eq!(found, alarms, "{speed_p} {error_p:?}");
    }
}
