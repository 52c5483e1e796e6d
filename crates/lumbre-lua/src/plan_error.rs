//! Positions in a script of the errors that are found while a plan is made of it.

use super::api::builder::{Reference, RenderedReference};
use super::error::{Problem, ScriptError};
use super::source::SourcePlace;
use super::{Script, locate};
use lumbre_light::value::schema::SchemaError;
use lumbre_night::experiment::plan::PlanError;

impl Script {
    /// Returns an error of planning with its position in the script; `None` if it is not about a
    /// declaration of the script, such as an unknown axis on the command line.
    pub fn locate_plan_error(&self, error: &PlanError) -> Option<ScriptError> {
        let key = match error {
            PlanError::Set { error, .. } => return self.locate_change(error),
            PlanError::Sheet { name, error } => {
                let builder = self.shared.builder.borrow();
                let (_, place) = builder.sheets.iter().find(|(s, _)| s.name == *name)?;
                let sources = self.shared.sources.borrow();
                return Some(sources.locate_error(place, (**error).clone()));
            }
            PlanError::Stop { rule, .. } => {
                let place = if rule.contains("reference") {
                    self.reference_place()?
                } else {
                    self.shared.builder.borrow().stop.as_ref()?.1.clone()
                };
                return Some(self.plan_error_at(&place, error));
            }
            PlanError::BiasedCheck { .. }
            | PlanError::DenoisedReference { .. }
            | PlanError::Shards { .. }
            | PlanError::ReferenceSize { .. } => {
                return Some(self.plan_error_at(&self.reference_place()?, error));
            }
            PlanError::Scene { .. } => "scene",
            PlanError::Films { .. } => "films",
            PlanError::Resolution { .. } => "resolution",
            PlanError::NoDepth { .. } => "max_depth",
            PlanError::UnknownBackend { .. } | PlanError::UnusableBackend { .. } => "backend",
            PlanError::Refused { .. } => "integrator",
            PlanError::Shaders { .. } => "shaders",
            _ => return None,
        };
        let place = self.render_place()?;
        let sources = self.shared.sources.borrow();
        let text = &sources.get(place.source).text;
        // Scene and backend may be decided elsewhere, such as on the command line.
        locate::find_key(text, place.line, place.last, &[key])?;
        let located = SchemaError::new(key, key, "");
        let problem = Problem::Plan {
            message: error.to_string(),
        };
        Some(sources.locate_error(&place, located).with_problem(problem))
    }

    /// Returns the error of a change of the scene at the key of the change: a path in `set`, or a
    /// field of `camera`.
    fn locate_change(&self, error: &SchemaError) -> Option<ScriptError> {
        let place = self.render_place()?;
        let sources = self.shared.sources.borrow();
        let text = &sources.get(place.source).text;
        let is_written = |keys: &[&str]| {
            let span = locate::find_key(text, place.line, place.last, keys);
            span.is_some()
        };
        let in_set = SchemaError {
            path: format!("set.{}", error.path),
            key: error.path.clone(),
            ..error.clone()
        };
        let located = if is_written(&["set", &error.path]) {
            in_set
        } else {
            error.clone()
        };
        Some(sources.locate_error(&place, located))
    }

    /// Returns the first and last line of the render function.
    fn render_place(&self) -> Option<SourcePlace> {
        let builder = self.shared.builder.borrow();
        let (function, _) = builder.render.as_ref()?;
        Some(self.shared.function_place(function))
    }

    /// Returns the position of `x:reference`, if the reference is rendered.
    fn reference_place(&self) -> Option<SourcePlace> {
        let builder = self.shared.builder.borrow();
        match builder.reference.as_ref()? {
            Reference::Render(RenderedReference { place, .. }) => Some(place.clone()),
            _ => None,
        }
    }

    /// Returns an error of planning that marks the line of `place`.
    fn plan_error_at(&self, place: &SourcePlace, error: &PlanError) -> ScriptError {
        let problem = Problem::Plan {
            message: error.to_string(),
        };
        self.shared.sources.borrow().error(place, problem, None)
    }
}
