//! Renders of the CPU backend, compared with analytic truth, brute force and images by other
//! programs.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

mod common;

#[path = "render/agreement.rs"]
mod agreement;
#[path = "render/agreement_lamps.rs"]
mod agreement_lamps;
#[path = "render/agreement_lights.rs"]
mod agreement_lights;
#[path = "render/agreement_materials.rs"]
mod agreement_materials;
#[path = "render/agreement_surfaces.rs"]
mod agreement_surfaces;
#[path = "render/bsdf.rs"]
mod bsdf;
#[path = "render/bsdf_albedo.rs"]
mod bsdf_albedo;
#[path = "render/bsdf_formulas.rs"]
mod bsdf_formulas;
#[path = "render/bsdf_grid.rs"]
mod bsdf_grid;
#[path = "render/bsdf_interfaces.rs"]
mod bsdf_interfaces;
#[path = "render/bsdf_limits.rs"]
mod bsdf_limits;
#[path = "render/bsdf_symmetry.rs"]
mod bsdf_symmetry;
#[path = "render/builders.rs"]
mod builders;
#[path = "render/camera.rs"]
mod camera;
#[path = "render/determinism.rs"]
mod determinism;
#[path = "render/film.rs"]
mod film;
#[path = "render/furnace.rs"]
mod furnace;
#[path = "render/instances.rs"]
mod instances;
#[path = "render/instances_compile.rs"]
mod instances_compile;
#[path = "render/instructions.rs"]
mod instructions;
#[path = "render/intersection.rs"]
mod intersection;
#[path = "render/layers.rs"]
mod layers;
#[path = "render/lights.rs"]
mod lights;
#[path = "render/lights_density.rs"]
mod lights_density;
#[path = "render/lights_emission.rs"]
mod lights_emission;
#[path = "render/lights_truth.rs"]
mod lights_truth;
#[path = "render/oracle.rs"]
mod oracle;
#[path = "render/references.rs"]
mod references;
#[path = "render/sampling.rs"]
mod sampling;
#[path = "render/surface.rs"]
mod surface;
#[path = "render/surface_bumps.rs"]
mod surface_bumps;
#[path = "render/wavefront.rs"]
mod wavefront;
#[path = "render/wavefront_fixtures.rs"]
mod wavefront_fixtures;
