//! Devices round differently from the CPU. These tests imitate that: the shaders are compiled with
//! noise of a few units in the last place after roots, products of vectors and interpolations, on
//! every ray and on every hit. All verdicts must accept this, and must still find planted bugs.
//! They need the compiler of shaders.

use std::path::Path;
use std::sync::OnceLock;

use lumbre_vulkan::pipelines::sources::Sources;
use lumbre_vulkan::pipelines::sources::TEXTS;

use super::harness;
use super::images::{room, scene_with_all_lights, technique_job};
use super::verdict::{Difference, STRICT, difference};
use crate::common;

/// GLSL that adds noise to the results of built-in functions, to rays, and to hits. A macro is not
/// expanded in its own text.
const NOISE: &str = r"
float noisy(float x) {
    uint h = floatBitsToUint(x) * 747796405u + 2891336453u;
    h = ((h >> ((h >> 28) + 4u)) ^ h) * 277803737u;
    return x * (1.0 + (float(h >> 30) - 1.5) * 1.2e-7);
}
vec2 noisy(vec2 v) { return vec2(noisy(v.x), noisy(v.y)); }
vec3 noisy(vec3 v) { return vec3(noisy(v.x), noisy(v.y), noisy(v.z)); }
vec4 noisy(vec4 v) { return vec4(noisy(v.x), noisy(v.y), noisy(v.z), noisy(v.w)); }
#ifdef EXTENDED
double noisy(double x) { return x; }
dvec3 noisy(dvec3 v) { return v; }
#endif
#define sqrt(x) noisy(sqrt(x))
#define dot(a, b) noisy(dot(a, b))
#define cross(a, b) noisy(cross(a, b))
#define length(v) noisy(length(v))
#define normalize(v) noisy(normalize(v))
#define mix(a, b, t) noisy(mix(a, b, t))
#define exp(x) noisy(exp(x))
#define log(x) noisy(log(x))
#define pow(a, b) noisy(pow(a, b))
#define Ray(origin, dir) Ray(noisy(origin), noisy(dir))
#define Hit(t, primitive, instance, uv) Hit(noisy(t), primitive, instance, noisy(uv))
";

/// The line of `scene.glsl`, which every shader includes first, after which the noise is inserted.
const START: &str = "#include \"gen/layout.glsl\"";

/// Bugs that the verdicts must find: file, text, and the text that replaces it.
const BUGS: [(&str, &str, &str); 4] = [
    // No cosine at the surface.
    (
        "transport/integrator/nee.glsl",
        "value.f * abs(dot(direct.wi, surface.n_shading)) * direct.radiance",
        "value.f * direct.radiance",
    ),
    // Weights of multiple importance sampling that do not add up to one.
    (
        "transport/integrator/nee.glsl",
        "ALL_LIGHTS ? 1.0 : lights_pdf_choice(surface.emitter)",
        "1.0",
    ),
    // Roulette without its compensation.
    (
        "transport/integrator/camera_path/single.glsl",
        "path.throughput /= survival;",
        "",
    ),
    // Sampled lights that are half a per cent too bright.
    (
        "transport/light/area.glsl",
        "materials[m].emission * coverage(m, uv)",
        "1.005 * materials[m].emission * coverage(m, uv)",
    ),
];

/// Writes the shaders with noise, and with a bug, to a folder.
fn write_noisy(folder: &Path, bug: Option<&(&str, &str, &str)>) {
    for (path, text) in TEXTS {
        let mut text = (*text).to_owned();
        if *path == "scene.glsl" {
            assert!(text.contains(START));
            text = text.replacen(START, &format!("{NOISE}{START}"), 1);
        }
        if let Some((_, from, to)) = bug.filter(|(file, _, _)| file == path) {
            assert!(text.contains(from), "{path} no longer has `{from}`");
            text = text.replace(from, to);
        }
        let file = folder.join(path);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, text).unwrap();
    }
}

/// Returns the shaders with noise; all tests of the process share the folder.
pub fn noisy_sources() -> Sources {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        write_noisy(folder.path(), None);
        folder
    });
    Sources::Folder(folder.path().to_owned())
}

/// Returns how the picture of an integrator by these shaders differs from the CPU's.
fn render_with(sources: &Sources, name: &str) -> Option<Difference> {
    let device = harness::device()?;
    let scene = match name {
        "nee" => scene_with_all_lights(),
        _ => room(),
    };
    let job = technique_job(name, 80);
    let kind = harness::fastest_to_compile(&device);
    let mut renderer =
        lumbre_vulkan::renderer::VulkanRenderer::new(&device, kind, sources, &scene, &job).unwrap();
    lumbre_render::Renderer::advance(&mut renderer, 8).unwrap();
    let expected = common::render(&scene, job, 8);
    let film = lumbre_render::Renderer::film(&renderer);
    Some(difference(film, &expected))
}

#[test]
fn rounding_noise_is_accepted_and_planted_bugs_are_found() {
    if !harness::has_compiler() {
        return;
    }
    for name in ["bpt", "nee", "bdpt"] {
        let plain = render_with(&Sources::Embedded, name);
        let noisy = render_with(&noisy_sources(), name);
        let (Some(plain), Some(noisy)) = (plain, noisy) else {
            return;
        };
        println!("{name}: {plain:?}; with noise {noisy:?}");
        assert_eq!(noisy.problem(STRICT), None, "{name}: {noisy:?}");
        assert!(
            noisy.rmse > 1e-7 && noisy.rmse > plain.rmse,
            "{name}: the noise has no effect"
        );
    }
    for bug in &BUGS {
        let folder = tempfile::tempdir().unwrap();
        write_noisy(folder.path(), Some(bug));
        let sources = Sources::Folder(folder.path().to_owned());
        let found = render_with(&sources, "nee").unwrap();
        let problem = found.problem(STRICT);
        println!("{}: {problem:?}: {found:?}", bug.0);
        assert!(problem.is_some(), "not found: {bug:?}");
    }
    harness::assert_no_validation_messages();
}
