// Twin of crates/lumbre-light/src/transport/mod.rs, which states conventions, symbols and sources.
//
// Translation of Rust to GLSL:
// - `Type::method` and `module::function` are `type_method` and `module_function`, with the
//   arguments in the same order. Functions whose name is unambiguous keep it, such as
//   `concentric_disk`.
// - Arguments that are the same for all invocations (scene, camera, lights, settings) are global:
//   `scene.glsl`.
// - `Option<T>` is a `bool` result and an `out T`, which is meaningless if the result is false.
// - References into tables are row numbers.
// - 64-bit integers are `uvec2`, low word first.
// - An enum of models or kinds of lights is a number and the fields of all variants.
// - Compilers inline a function wherever it is called, and ray traversal is large. Integrators are
//   therefore loops with one call of `trace_closest` and one of `trace_occluded` each, in which a
//   small number states the purpose of the ray; sample numbers are taken in the same order as in Rust.
#ifndef TRANSPORT_MOD_GLSL
#define TRANSPORT_MOD_GLSL

// Maximum survival probability of Russian roulette.
const float MAX_SURVIVAL = 0.95;

#endif
