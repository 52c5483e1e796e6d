//! Bounding volume hierarchies on the CPU.
//!
//! [`accel`] builds and owns the hierarchy of a scene. [`build`] builds binary trees from the boxes
//! of primitives:
//!
//! | module | contents |
//! |---|---|
//! | [`build`] | top-down builders, and the settings of each quality |
//! | `parts` | parts of long triangles, which builders take for primitives |
//! | `clusters` | locally ordered clustering and reinsertion by `obvhs` |
//!
//! `collapse` finds the best children of eight-wide nodes. These exist in two formats:
//!
//! | module | contents |
//! |---|---|
//! | `bvh8`, `traverse` | nodes and blocks of primitives of the CPU, and their traversal |
//! | `slabs`, `stack` | tests of boxes, and the stack of the traversal |
//! | `packets` | traversal of rays together |
//! | `interleave` | traversal of several rays in turn |
//! | [`packed`] | compressed nodes of `obvhs`, which `vulkan-compute` traverses |
//! | `compressed` | traversal of compressed nodes on the CPU, for the builder `cwbvh` |
//!
//! `instances` transforms rays into the space of a mesh, `intersect` and `intersect_lanes` test rays
//! against primitives, and [`simd`] defines the vectors for both.
//!
//! Invariant: hits do not depend on the builder, its settings, or the instruction set, except for
//! instances that a builder flattens. Of hits at the same distance, the one with the lesser
//! instance index counts, then the lesser primitive index.

pub mod accel;
pub mod build;
pub mod build_primitive;
pub mod bvh8;
pub mod chunks;
mod clusters;
pub mod collapse;
pub mod compressed;
pub mod instances;
#[cfg(target_arch = "x86_64")]
mod interleave;
pub mod intersect;
pub mod intersect_lanes;
pub mod packed;
#[cfg(target_arch = "x86_64")]
mod packets;
mod parts;
mod progress;
pub mod simd;
mod slabs;
mod stack;
#[cfg(test)]
mod test_primitives;
pub mod traverse;
