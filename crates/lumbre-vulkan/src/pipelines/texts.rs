//! Texts of the shaders: file names and contents of the folder `shaders/`. They complete folders of
//! modified shaders, and the check for stale modules hashes them.

/// Embeds the listed files of `shaders/`.
macro_rules! embed {
    ($($path:literal),* $(,)?) => {
        /// Texts of the shaders: path below `shaders/`, text.
        pub static TEXTS: &[(&str, &str)] =
            &[$(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/", $path)))),*];
    };
}

embed![
    "instance_transform.glsl",
    "entry/compute.comp",
    "entry/generation.rgen",
    "entry/invocation.glsl",
    "entry/light_list.comp",
    "entry/light_paths.glsl",
    "entry/mask.rahit",
    "entry/miss.rmiss",
    "entry/query.comp",
    "entry/samples.glsl",
    "entry/sphere.rchit",
    "entry/sphere.rint",
    "entry/sum.comp",
    "entry/triangle.rchit",
    "film/film.glsl",
    "film/layers.glsl",
    "film/paths.glsl",
    "film/pixel.glsl",
    "film/splat.glsl",
    "film/sums.glsl",
    "film/time.glsl",
    "gen/layout.glsl",
    "gen/specialization.glsl",
    "iteration.glsl",
    "math/distribution.glsl",
    "math/trig.glsl",
    "math/frame.glsl",
    "math/piecewise.glsl",
    "math/rng.glsl",
    "math/warp.glsl",
    "scene.glsl",
    "subpaths.glsl",
    "trace/bvh.glsl",
    "trace/instances.glsl",
    "trace/intersect.glsl",
    "trace/payload.glsl",
    "trace/pipeline.glsl",
    "trace/query.glsl",
    "trace/valid.glsl",
    "transport/bsdf/beckmann.glsl",
    "transport/bsdf/clearcoat.glsl",
    "transport/bsdf/conductor.glsl",
    "transport/bsdf/dielectric.glsl",
    "transport/bsdf/diffuse.glsl",
    "transport/bsdf/disney.glsl",
    "transport/bsdf/facets.glsl",
    "transport/bsdf/fresnel.glsl",
    "transport/bsdf/ggx.glsl",
    "transport/bsdf/glass.glsl",
    "transport/bsdf/ideal.glsl",
    "transport/bsdf/interface.glsl",
    "transport/bsdf/lambert.glsl",
    "transport/bsdf/lobe.glsl",
    "transport/bsdf/mirror.glsl",
    "transport/bsdf/mod.glsl",
    "transport/bsdf/plastic.glsl",
    "transport/bsdf/translucent.glsl",
    "transport/camera/filter.glsl",
    "transport/camera/lens.glsl",
    "transport/camera/orthographic.glsl",
    "transport/camera/spherical.glsl",
    "transport/contribution.glsl",
    "transport/delay/profile.glsl",
    "transport/path_time.glsl",
    "transport/integrator/bdpt/connect.glsl",
    "transport/integrator/bdpt/draw.glsl",
    "transport/integrator/bdpt/mod.glsl",
    "transport/integrator/bdpt/subpath.glsl",
    "transport/integrator/bdpt/weights.glsl",
    "transport/integrator/iteration/light_paths.glsl",
    "transport/integrator/lvc/cache.glsl",
    "transport/integrator/lvc/mod.glsl",
    "transport/integrator/bpt.glsl",
    "transport/integrator/camera_path/single.glsl",
    "transport/integrator/nee.glsl",
    "transport/integrator/settings.glsl",
    "transport/light/area.glsl",
    "transport/light/bounds.glsl",
    "transport/light/directional.glsl",
    "transport/light/environment.glsl",
    "transport/light/mod.glsl",
    "transport/light/point.glsl",
    "transport/light/sphere.glsl",
    "transport/light/types.glsl",
    "transport/mis.glsl",
    "transport/mod.glsl",
    "transport/ray.glsl",
    "transport/sampler/independent.glsl",
    "transport/sampler/mod.glsl",
    "transport/sampler/sobol.glsl",
    "transport/sampler/zsobol.glsl",
    "transport/surface.glsl",
    "transport/vertex.glsl",
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::TEXTS;

    #[test]
    fn every_file_of_the_folder_is_embedded() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
        let (mut open, mut found) = (vec![root.clone()], BTreeSet::new());
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    let name = path.strip_prefix(&root).unwrap().to_string_lossy();
                    found.insert(name.replace('\\', "/"));
                }
            }
        }
        let embedded: BTreeSet<String> = TEXTS.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(
            embedded, found,
            "the list in crates/lumbre-vulkan/src/pipelines/texts.rs and the folder shaders/ differ"
        );
    }
}
