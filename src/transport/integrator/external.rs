//! Techniques of other programs, which an experiment may put beside our own. What carries them out is
//! [`render::external`](crate::render::external); no backend of ours takes one.

use super::IntegratorRow;
use crate::value::schema::{Field, Table, Ty};

/// The key of the interpreter. Where it lies is no part of what a run is.
pub const PYTHON: Field = Field {
    key: "python",
    ty: Ty::Str,
    required: false,
    default: "python3",
    doc: "the Python interpreter that has the package: a path, or a name that is looked for on PATH",
};

/// The key of the variant.
pub const VARIANT: Field = Field {
    key: "variant",
    ty: Ty::Str,
    required: false,
    default: "scalar_rgb",
    doc: "Mitsuba's variant: scalar_rgb, llvm_ad_rgb, cuda_ad_rgb",
};

/// The key of the integrator inside.
pub const METHOD: Field = Field {
    key: "method",
    ty: Ty::Str,
    required: false,
    default: "path",
    doc: "Mitsuba's integrator: path, which joins light sampling and BSDF sampling, or another that takes a max_depth",
};

/// Every technique of another program.
pub const EXTERNALS: &[IntegratorRow] = &[IntegratorRow {
    name: "external:mitsuba",
    long_name: "Mitsuba 3",
    revision: 1,
    doc: "The scene is exported and rendered by Mitsuba 3 through its Python package; its own render time is the clock.",
    params: Table {
        name: "ExternalMitsubaParams",
        doc: "Parameters of `external:mitsuba`.",
        fields: &[PYTHON, VARIANT, METHOD],
    },
    splats: false,
    sample: |_, _, _, _| {},
}];

/// Whether another program carries this technique out.
pub fn is_external(row: &IntegratorRow) -> bool {
    EXTERNALS.iter().any(|external| external.name == row.name)
}
