//! The table of integrators, the registration of others, and the look-up of techniques by name.

use super::bdpt::joins::SubpathTechnique;
use super::camera_path::CameraPaths;
use super::guided::bidirectional;
use super::own::{OWN, Registered, RegistrationError, is_valid_name};
use super::row::IntegratorRow;
use super::{bdpt, bpt, external, guided, lvc, nee, nee_sum, own, sppm, vcm};

/// A computation for any technique whose steps are generic over the width of vectors.
pub trait TechniqueVisitor {
    /// The result of the computation.
    type Output;

    /// Runs the computation for a technique that follows paths from the camera.
    fn camera_paths<T: CameraPaths>(self) -> Self::Output;

    /// Runs the computation for a technique that joins subpaths from the camera with subpaths from
    /// lights.
    fn subpaths<T: SubpathTechnique>(self) -> Self::Output;
}

/// Declares the integrators of this program: modules with a `ROW`, and their techniques.
macro_rules! integrators {
    (
        camera paths: $($module:ident::$technique:ident),*;
        subpaths: $($joined:ident::$joining:ident),*
    ) => {
        /// All built-in integrators. [`integrators`] has registered ones too.
        pub const INTEGRATORS: &[IntegratorRow] = &[$($module::ROW,)* $($joined::ROW),*];

        /// Calls a visitor with the technique of the integrator with this name; returns `None` if
        /// it has no generic steps.
        pub fn visit_technique<V: TechniqueVisitor>(
            name: &str,
            visitor: V,
        ) -> Option<V::Output> {
            $(if name == $module::ROW.name {
                return Some(visitor.camera_paths::<$module::$technique>());
            })*
            $(if name == $joined::ROW.name {
                return Some(visitor.subpaths::<$joined::$joining>());
            })*
            None
        }
    };
}

integrators!(
    camera paths: bpt::Bpt, nee::Nee, nee_sum::Nee, guided::Guided, sppm::Sppm;
    subpaths: bdpt::Bdpt, bidirectional::GuidedBdpt, vcm::Vcm, lvc::Lvc
);

/// Other names of integrators, with the name in the table: `pt` is what most of the literature calls
/// path tracing, where BPT is bidirectional path tracing.
const ALIASES: &[(&str, &str)] = &[("pt", "bpt")];

/// Returns the name in the table of an integrator that may be given by another name; any other text
/// is returned as it is.
pub fn canonical_name(name: &str) -> &str {
    let alias = ALIASES.iter().find(|(alias, _)| *alias == name);
    alias.map_or(name, |(_, name)| name)
}

/// Integrator of references where none is named and those that are compared are biased: unbiased,
/// and the one that finds light through glass and from metal best.
pub const UNBIASED_REFERENCE: &str = "bdpt";

/// Returns why pictures of the integrator with this name are biased; `None` if they are not, or the
/// name is unknown.
pub fn bias_of(name: &str) -> Option<&'static str> {
    integrator(name).and_then(|row| row.bias)
}

/// Registers integrators, which [`integrators`] then returns after the built-in
/// ones. Must be called at most once, before any integrator is looked up.
///
/// # Errors
/// Returns an error, and registers nothing, if a name is invalid or taken, or hides a bias, or on a
/// later call.
pub fn register(techniques: Vec<Registered>) -> Result<(), RegistrationError> {
    let rows: Vec<&IntegratorRow> = techniques.iter().map(|own| &own.row).collect();
    for (i, row) in rows.iter().enumerate() {
        if !is_valid_name(row.name) {
            return Err(RegistrationError::InvalidName(row.name.to_owned()));
        }
        let mut taken = INTEGRATORS
            .iter()
            .chain(rows[..i].iter().copied())
            .map(|row| row.name)
            .chain(ALIASES.iter().map(|(alias, _)| *alias))
            .chain([external::DECLARED.name]);
        if taken.any(|name| name == row.name) {
            return Err(RegistrationError::TakenName(row.name.to_owned()));
        }
        if row.bias.is_some() && !row.long_name.ends_with("biased") {
            return Err(RegistrationError::HiddenBias(row.name.to_owned()));
        }
    }
    OWN.set(techniques).map_err(|_| RegistrationError::TooLate)
}

/// Returns all integrators of this program: the built-in ones, then those [registered](own).
pub fn integrators() -> impl Iterator<Item = &'static IntegratorRow> + Clone {
    INTEGRATORS.iter().chain(own::rows())
}

/// Returns the integrator with this name, of this program or of [another one](external).
pub fn integrator(name: &str) -> Option<&'static IntegratorRow> {
    integrators()
        .chain(external::EXTERNALS)
        .find(|row| row.name == canonical_name(name))
        .or_else(|| external::declared(name))
}
