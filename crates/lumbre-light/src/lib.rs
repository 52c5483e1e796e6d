//! Light transport: scenes, materials, lights, cameras, samplers and integrators.
//!
//! | module | contents |
//! |---|---|
//! | [`value`], [`math`] | values with schemas; mathematics, statistics, SIMD vectors |
//! | [`film`] | sums of samples: pictures, layers, time axes |
//! | [`scene`] | descriptions of scenes, loaders, compiled scenes |
//! | [`transport`] | BSDFs, lights, cameras, samplers and integrators |

pub mod film;
pub mod math;
pub mod scene;
pub mod transport;
pub mod value;
