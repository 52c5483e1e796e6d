//! Integrators: algorithms that estimate the light reaching a pixel, one file and one table entry
//! each; and the names of techniques of other programs.

pub mod bdpt;
pub mod bpt;
pub mod camera_path;
mod context;
mod directions;
pub mod external;
pub mod guided;
pub mod iteration;
pub mod lvc;
pub mod nee;
pub mod nee_sum;
pub mod oracle;
pub mod own;
mod registry;
mod row;
pub mod settings;
pub mod sppm;
pub mod vcm;

pub use context::{Context, Shared};
pub use registry::{
    INTEGRATORS, TechniqueVisitor, UNBIASED_REFERENCE, bias_of, canonical_name, integrator,
    integrators, register, visit_technique,
};
pub use row::{IntegratorRow, SampleFn};
pub use settings::Settings;
