//! Bounding volume hierarchies on the CPU.
//!
//! [`accel`] builds and owns the hierarchy of a scene. `build` builds binary trees, `bvh8`
//! collapses them to eight-wide nodes, and `traverse` traverses these. `instances` transforms rays
//! into the space of a mesh, `intersect` tests rays against primitives, and [`simd`] defines the
//! vectors for both. `packed` builds compressed trees, which `vulkan-compute` uses as well, and
//! `compressed` traverses them with `obvhs`.
//!
//! Invariant: hits do not depend on the builder, its settings, or the instruction set, except for
//! instances that a builder flattens. Of hits at the same distance, the one with the lesser
//! instance index counts, then the lesser primitive index.

pub mod accel;
pub mod build;
pub mod bvh8;
pub mod compressed;
pub mod instances;
pub mod intersect;
pub mod packed;
pub mod simd;
pub mod traverse;
