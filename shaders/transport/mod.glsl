// Twin of src/transport/mod.rs: conventions, symbols and sources are those that it states.
//
// How Rust becomes GLSL here:
// - `Type::method` and `module::function` are `type_method` and `module_function`, with the arguments in the same order.
//   Functions whose name says enough have it alone, as `concentric_disk`.
// - What Rust passes along and is the same for all invocations, scene, camera, lights, settings, is global: `scene.glsl`.
// - `Option<T>` is a `bool` that says whether there is one and an `out T`, which holds something of no use if not.
// - References into tables are row numbers.
// - 64-bit numbers are `uvec2`, low word first.
// - A choice between models or kinds of lights is a number and the fields of all of them.
// - Compilers put a copy of a function wherever it is called, and the traversal of rays is large. So integrators are
//   written as loops with one call of `trace_closest` and one of `trace_occluded` each, in which a small number says what
//   the ray is for; the order in which they take sample numbers is that of Rust.
#ifndef TRANSPORT_MOD_GLSL
#define TRANSPORT_MOD_GLSL

// Russian roulette never lets a path survive with a probability above this.
const float MAX_SURVIVAL = 0.95;

#endif
