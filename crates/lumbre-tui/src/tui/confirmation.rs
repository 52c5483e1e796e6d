//! Requests that throw rendered work away, which are made only if they are repeated.

use super::format;
use super::model::night::NightModel;
use super::modes::NightRequest;
use lumbre_night::experiment::CellRef;

/// Render time in seconds from which a run is not given up without being asked twice.
const ASK_FROM_S: f64 = 10.0;

/// A request that is waiting to be repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Confirmation {
    /// Request to repeat.
    pub request: NightRequest,
    /// Run that it concerns.
    pub cell: CellRef,
    /// Time until which repeating it counts, in seconds on the model's clock.
    pub until_s: f64,
}

/// Returns the question to ask before a request is made to the run that renders `cell`, or `None` if
/// too little has been rendered to ask.
pub(super) fn question(request: NightRequest, cell: CellRef, model: &NightModel) -> Option<String> {
    let render_s = model.night.last_row(cell)?.render_s;
    if render_s < ASK_FROM_S {
        return None;
    }
    let name = format::cell_name(&model.night, cell);
    let time = format::duration(render_s);
    let (key, action) = match request {
        NightRequest::Restart => ("R", format!("renders {name} from its first sample again")),
        _ => ("s", format!("gives up {name}")),
    };
    let waiting = match (cell, request) {
        (CellRef::Reference(index), NightRequest::Skip) => {
            let runs = model.night.runs.iter();
            let count = runs.filter(|run| run.reference == Some(index)).count();
            format!(
                "; {} need it",
                lumbre_night::text::counted(count as u64, "cell")
            )
        }
        _ => String::new(),
    };
    Some(format!(
        "{key} {action} after {time} of rendering{waiting}: repeat it to do so"
    ))
}
