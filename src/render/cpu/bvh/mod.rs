//! Bounding volume hierarchies on the CPU.
//!
//! [`accel`] builds and owns the hierarchy of a scene, `build` holds the builders of binary trees,
//! `bvh8` the eight-wide nodes that they are collapsed to, `packed` the compressed form that
//! `vulkan-compute` traverses as well, `compressed` its traversal by `obvhs`, `instances` the
//! instances of meshes, `intersect` the primitive tests, [`simd`] the vectors they run on, and
//! `traverse` the traversal loop.

pub mod accel;
pub(crate) mod build;
pub(crate) mod bvh8;
pub(crate) mod compressed;
pub(crate) mod instances;
pub(crate) mod intersect;
pub(crate) mod packed;
pub mod simd;
pub(crate) mod traverse;
