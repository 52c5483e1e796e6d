//! Light transport: cameras, BSDFs, lights, samplers and integrators over a compiled scene.
//!
//! # Conventions
//! - Radiance is linear sRGB in scene units; lengths are scene units; angles radians.
//! - `wo` points to the previous vertex of the path, `wi` to the next one; both leave the surface
//!   and are unit vectors.
//! - `f` is a BSDF value without the cosine; a density per solid angle has the suffix `_w`, per
//!   area `_a`.
//! - `n_geometric` is the normal of the side from which the corners appear counter-clockwise, never
//!   flipped; `n_shading` is the interpolated normal on the same side.
//! - A path's depth `k` is its number of edges from camera to light: 1 is emission seen directly, 2
//!   direct light. `max_depth` bounds `k` for every integrator.
//! - Emission is one-sided, along the geometric normal. If a material's emitters do not reflect, a
//!   path that hits one ends there, on either side.
//! - Radiance along camera paths is scaled by the squared ratio of indices at refraction;
//!   importance along light paths is not [Veach 1997, 5.2].
//!
//! # Symbols
//! | source | here |
//! |---|---|
//! | omega_o, omega_i | `wo`, `wi` |
//! | beta, path throughput | `throughput` |
//! | f_r, f_t | [`bsdf::Bsdf::eval`] |
//! | p(omega) | `pdf_w` |
//! | p(x) | `pdf_a` |
//! | eta = n_2 / n_1, the side entered over the side left | `eta` |
//! | k = s + t - 1 | [`contribution::Contribution::depth`] |
//!
//! S0, S1 and S2 are the three theses on which this program is based. docs/inside/transport.md lists them,
//! maps every symbol to the code, and lists the corrections.
//!
//! # Bibliography
//! [Kajiya 1986] The Rendering Equation. [Veach 1997] Robust Monte Carlo Methods for Light
//! Transport Simulation. [Georgiev 2012] Implementing Vertex Connection and Merging. [Duff et al.
//! 2017] Building an Orthonormal Basis, Revisited. [Jarzynski & Olano 2020] Hash Functions for GPU
//! Rendering. [Waechter & Binder 2019] A Fast and Robust Method for Avoiding Self-Intersection.
//! [Woop et al. 2013] Watertight Ray/Triangle Intersection. [Haines et al. 2019] Precision
//! Improvements for Ray/Sphere Intersection. [Burley 2015] Extending the Disney BRDF to a BSDF with
//! Integrated Subsurface Scattering. [Schlick 1994] An Inexpensive BRDF Model for Physically-based
//! Rendering. [Heitz 2019] A Low-Distortion Map Between Triangle and Square. [Giles 2010]
//! Approximating the erfinv Function. [Harris 1978] On the Use of Windows for Harmonic Analysis
//! with the Discrete Fourier Transform. [Burley 2020] Practical Hash-based Owen Scrambling. [Owen
//! 1995] Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences. [Sobol 1967] On the Distribution of
//! Points in a Cube. [Joe & Kuo 2008] Constructing Sobol Sequences with Better Two-Dimensional
//! Projections. [Laine & Karras 2011] Stratified Sampling for Stochastic Transparency. [Burley
//! 2012] Physically Based Shading at Disney. [Walter et al. 2007] Microfacet Models for Refraction
//! through Rough Surfaces. [Heitz 2014] Understanding the Masking-Shadowing Function in
//! Microfacet-Based BRDFs. [Heitz 2018] Sampling the GGX Distribution of Visible Normals. [Dupuy &
//! Benyoub 2023] Sampling Visible GGX Normals with Spherical Caps. \[Vives\] M. Vives,
//! "shading_position.hlls", a gist of the user pixnblox on GitHub
//! (5e64b0724c186313bc7b6ce096b08820), which section 3.3 of S1 cites as \[10\];
//! undated there. [Jensen 1996] Global Illumination using Photon Maps. [Hachisuka & Jensen 2009]
//! Stochastic Progressive Photon Mapping. [Knaus & Zwicker 2011] Progressive Photon Mapping: A
//! Probabilistic Approach.

pub mod arrival;
pub mod bsdf;
pub mod camera;
pub mod contribution;
pub mod delay;
pub mod integrator;
pub mod light;
pub mod mis;
pub mod path_time;
pub mod ray;
pub mod sampler;
pub mod surface;
pub mod time_settings;
pub mod vertex;

/// Maximum survival probability of Russian roulette, so that every path ends.
pub const MAX_SURVIVAL: f32 = 0.95;
