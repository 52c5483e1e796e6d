//! Techniques of other programs, which an experiment may compare with the integrators of this one.
//! They are run by `lumbre_render::external`; no backend of this program
//! accepts them.
//!
//! [`EXTERNALS`] are bridges to programs that this one knows. All others are declared by a script,
//! which gives the command to run; they share the row [`DECLARED`].

use super::IntegratorRow;
use crate::value::schema::{Field, Table, Ty};

/// The parameter of the Python interpreter. Its location is not part of a run's identity.
pub const PYTHON: Field = crate::field! {
    python = "python3": Ty::Str,
        "the Python interpreter that has the package: a path, or a name to be found on PATH"
};

/// The parameter of Mitsuba's variant.
pub const VARIANT: Field = crate::field! {
    variant = "scalar_rgb": Ty::Str, "Mitsuba's variant: scalar_rgb, llvm_ad_rgb, cuda_ad_rgb"
};

/// The parameter of Mitsuba's integrator.
pub const METHOD: Field = crate::field! {
    method = "path": Ty::Str,
        "Mitsuba's integrator: path, which combines light sampling and BSDF sampling, or another \
         that takes a max_depth"
};

/// All techniques of other programs.
pub const EXTERNALS: &[IntegratorRow] = &[IntegratorRow {
    name: "external:mitsuba",
    long_name: "Mitsuba 3",
    revision: 1,
    doc: "The scene is exported and rendered by Mitsuba 3 through its Python package, which also \
          measures the render time.",
    params: Table {
        name: "ExternalMitsubaParams",
        doc: "Parameters of `external:mitsuba`.",
        fields: &[PYTHON, VARIANT, METHOD],
    },
    splats: false,
    bias: None,
    sharing: None,
    sample: |_, _, _, _| {},
}];

/// Start of the names of all techniques of other programs.
pub const PREFIX: &str = "external:";

/// Row of all techniques that scripts declare by `external`. Their parameters are those that the
/// script declares, so the row has none.
pub const DECLARED: IntegratorRow = IntegratorRow {
    name: "external",
    long_name: "another renderer",
    revision: 1,
    doc: "A command of the script renders the scene, or a scene file of its own format.",
    params: Table {
        name: "ExternalParams",
        doc: "Parameters of techniques that the script declares by `external`.",
        fields: &[],
    },
    splats: false,
    bias: None,
    sharing: None,
    sample: |_, _, _, _| {},
};

/// Returns whether another program renders this technique.
pub fn is_external(row: &IntegratorRow) -> bool {
    is_declared(row) || EXTERNALS.iter().any(|external| external.name == row.name)
}

/// Returns whether this is the row of techniques that scripts declare.
pub fn is_declared(row: &IntegratorRow) -> bool {
    row.name == DECLARED.name
}

/// Returns whether a declared technique may have this name, which follows [`PREFIX`] in the names
/// of integrators: at most 40 letters, digits, `_`, `-` and `.`, not that of a bridge.
pub fn is_free_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    let is_bridge = EXTERNALS
        .iter()
        .any(|row| row.name.strip_prefix(PREFIX) == Some(name));
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphanumeric());
    starts_well && name.len() <= 40 && name.chars().all(plain) && !is_bridge
}

/// Returns the row of techniques that scripts declare, if an integrator's name is one of theirs.
pub(super) fn declared(name: &str) -> Option<&'static IntegratorRow> {
    name.strip_prefix(PREFIX)
        .is_some_and(is_free_name)
        .then_some(&DECLARED)
}
