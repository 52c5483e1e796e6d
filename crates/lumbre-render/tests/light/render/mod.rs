//! Renders of the CPU backend, compared with analytic truth, brute force and images by other
//! programs.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "test helpers may panic and print"
)]

mod agreement;
mod agreement_lamps;
mod agreement_lights;
mod agreement_materials;
mod agreement_surfaces;
mod bsdf;
mod bsdf_albedo;
mod bsdf_formulas;
mod bsdf_grid;
mod bsdf_interfaces;
mod bsdf_lanes;
mod bsdf_limits;
mod bsdf_symmetry;
mod builders;
mod camera;
mod camera_kinds;
mod camera_windows;
mod consistent;
mod consistent_bias;
mod consistent_fixtures;
mod determinism;
mod film;
mod furnace;
mod guided;
mod instances;
mod instances_compile;
mod instructions;
mod intersection;
mod lanes;
mod layers;
mod light_tree;
mod lights;
mod lights_density;
mod lights_emission;
mod lights_truth;
mod lvc;
mod opening;
mod oracle;
mod own_shadow;
mod photons;
mod registry;
mod roulette;
mod sampling;
mod scale;
mod studies;
mod surface;
mod surface_bumps;
mod trial;
mod vcm;
mod wavefront;
mod wavefront_features;
mod wavefront_fixtures;
mod wavefront_lights;
