//! Techniques of other programs, which an experiment may compare with the integrators of this one.
//! They are run by `lumbre_render::external`; no backend of this program
//! accepts them.

use super::IntegratorRow;
use crate::value::schema::{Field, Table, Ty};

/// The parameter of the Python interpreter. Its location is not part of a run's identity.
pub const PYTHON: Field = Field {
    key: "python",
    ty: Ty::Str,
    required: false,
    default: "python3",
    doc: "the Python interpreter that has the package: a path, or a name to be found on PATH",
};

/// The parameter of Mitsuba's variant.
pub const VARIANT: Field = Field {
    key: "variant",
    ty: Ty::Str,
    required: false,
    default: "scalar_rgb",
    doc: "Mitsuba's variant: scalar_rgb, llvm_ad_rgb, cuda_ad_rgb",
};

/// The parameter of Mitsuba's integrator.
pub const METHOD: Field = Field {
    key: "method",
    ty: Ty::Str,
    required: false,
    default: "path",
    doc: "Mitsuba's integrator: path, which combines light sampling and BSDF sampling, or another \
          that takes a max_depth",
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
    begin: None,
    sample: |_, _, _, _| {},
}];

/// Returns whether another program renders this technique.
pub fn is_external(row: &IntegratorRow) -> bool {
    EXTERNALS.iter().any(|external| external.name == row.name)
}
