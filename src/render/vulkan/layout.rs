//! What the host writes and shaders read: every struct once, for both sides.
//!
//! [`gpu_struct!`] makes a Rust struct and its GLSL text from one list of fields. Every field consists of 32-bit words and
//! shaders use scalar block layout, so `#[repr(C)]` and GLSL place them alike; a test compiles the text and compares each
//! offset that SPIR-V names with the Rust one. The texts lie in `shaders/gen/layout.glsl`.

use bytemuck::{Pod, Zeroable};

use crate::render::paths::MOST_STEPS;

/// A Rust type whose bytes are those of a GLSL type in scalar block layout.
pub trait GlslType {
    /// The name of the GLSL type.
    const NAME: &'static str;
}

macro_rules! glsl_types {
    ($($rust:ty => $glsl:literal),* $(,)?) => { $(impl GlslType for $rust { const NAME: &'static str = $glsl; })* };
}

glsl_types! {
    f32 => "float", [f32; 2] => "vec2", [f32; 3] => "vec3", [f32; 4] => "vec4",
    u32 => "uint", [u32; 2] => "uvec2", [u32; 3] => "uvec3", [u32; 4] => "uvec4",
}

/// A field of a struct that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldLayout {
    /// The name, the same on both sides.
    pub name: &'static str,
    /// The GLSL type.
    pub glsl: &'static str,
    /// Bytes from the start of the Rust struct.
    pub offset: usize,
    /// What it means.
    pub doc: &'static str,
}

/// A struct that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// The name, the same on both sides.
    pub name: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Bytes of the Rust struct.
    pub size: usize,
    /// Its fields, in order.
    pub fields: &'static [FieldLayout],
}

macro_rules! gpu_structs {
    ($($(#[doc = $doc:literal])+ pub struct $name:ident { $($(#[doc = $field_doc:literal])+ $field:ident: $ty:ty,)+ })+) => {
        $(
            $(#[doc = $doc])+
            #[repr(C)]
            #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
            pub struct $name { $($(#[doc = $field_doc])+ pub $field: $ty,)+ }
        )+

        /// Every struct that both sides know, in the order of `shaders/gen/layout.glsl`.
        pub const STRUCTS: &[StructLayout] = &[$(StructLayout {
            name: stringify!($name),
            doc: concat!($($doc),+),
            size: size_of::<$name>(),
            fields: &[$(FieldLayout {
                name: stringify!($field),
                glsl: <$ty as GlslType>::NAME,
                offset: std::mem::offset_of!($name, $field),
                doc: concat!($($field_doc),+),
            }),+],
        }),+];
    };
}

gpu_structs! {
    /// Corners of a triangle in world space, counter-clockwise seen from its front.
    pub struct Triangle {
        /// First corner.
        a: [f32; 3],
        /// Second corner, weight `hit.uv.x`.
        b: [f32; 3],
        /// Third corner, weight `hit.uv.y`.
        c: [f32; 3],
    }

    /// What shading needs of a triangle.
    pub struct TriangleAttributes {
        /// Unit shading normal at the first corner.
        na: [f32; 3],
        /// Unit shading normal at the second corner.
        nb: [f32; 3],
        /// Unit shading normal at the third corner.
        nc: [f32; 3],
        /// Texture coordinates at the first corner.
        ta: [f32; 2],
        /// Texture coordinates at the second corner.
        tb: [f32; 2],
        /// Texture coordinates at the third corner.
        tc: [f32; 2],
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// MikkTSpace tangents of a triangle: a unit vector and in `w` the sign of the bitangent.
    pub struct Tangents {
        /// At the first corner.
        a: [f32; 4],
        /// At the second corner.
        b: [f32; 4],
        /// At the third corner.
        c: [f32; 4],
    }

    /// An analytic sphere; its front is the outside.
    pub struct Sphere {
        /// Centre in world space.
        center: [f32; 3],
        /// Radius, positive.
        radius: f32,
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// A material, as `scene::compile::Material`.
    pub struct Material {
        /// Base colour, linear.
        base_color: [f32; 3],
        /// Emitted radiance of the front side.
        emission: [f32; 3],
        /// MODEL_DISNEY and so on.
        model: u32,
        /// Perceptual roughness.
        roughness: f32,
        /// 0 dielectric to 1 metal.
        metallic: f32,
        /// 1 opaque to 0 refractive.
        opacity: f32,
        /// Index of refraction relative to the outside.
        ior: f32,
        /// Part of the flatter diffuse lobe.
        subsurface: f32,
        /// Hue in the dielectric's reflectance at normal incidence.
        specular_tint: f32,
        /// Stretch of highlights.
        anisotropic: f32,
        /// World-space direction of the stretch; zero is the direction of growing u.
        anisotropic_direction: [f32; 3],
        /// Sheen.
        sheen: f32,
        /// Hue of the sheen.
        sheen_tint: f32,
        /// Clear coat.
        clearcoat: f32,
        /// Gloss of the clear coat.
        clearcoat_gloss: f32,
        /// Roughness below which specular lobes are Dirac lobes.
        smooth_below: f32,
        /// Factor on the slope of the normal map.
        normal_strength: f32,
        /// How far 1 in the bump map stands out, in scene units.
        bump_height: f32,
        /// Mask values below this are holes.
        mask_threshold: f32,
        /// MASK_THRESHOLD or MASK_BLEND.
        mask_mode: u32,
        /// 1 where paths leave opaque triangles from the surface that their normals suggest, else 0.
        shadow_terminator: u32,
        /// Texture that multiplies `base_color`, or NONE.
        base_color_texture: u32,
        /// Texture that multiplies `emission`, or NONE.
        emission_texture: u32,
        /// Texture whose red channel is the mask, or NONE.
        mask_texture: u32,
        /// Texture whose red channel replaces `roughness`, or NONE.
        roughness_texture: u32,
        /// Texture whose red channel replaces `metallic`, or NONE.
        metallic_texture: u32,
        /// Texture whose red channel replaces `opacity`, or NONE.
        opacity_texture: u32,
        /// Texture of directions in the tangent frame, or NONE.
        anisotropic_texture: u32,
        /// Normal map, or NONE.
        normal_texture: u32,
        /// Texture whose red channel is a height, or NONE.
        bump_texture: u32,
        /// Factor from texture coordinates to places in the textures.
        tiling_scale: f32,
        /// Offset of the same, in repeats.
        tiling_offset: [f32; 2],
        /// 1 where the surface of a light also reflects, else 0.
        emitter_reflects: u32,
        /// Factor on what an interface reflects.
        specular: [f32; 3],
        /// Real part of a metal's index by channel.
        eta: [f32; 3],
        /// Imaginary part of a metal's index by channel.
        k: [f32; 3],
        /// DISTRIBUTION_GGX or DISTRIBUTION_BECKMANN.
        distribution: u32,
        /// 1 where a dielectric is a thin pane, else 0.
        thin: u32,
        /// 1 where light that plastic reflects back inside takes on its colour each time, else 0.
        nonlinear: u32,
        /// Part of diffuse light that is reflected back at the inside of plastic.
        internal_reflectance: f32,
    }

    /// A texture: texels `[y][x]` from `texels[first]`, linear, origin top-left.
    pub struct Texture {
        /// Index of the first texel.
        first: u32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    }

    /// One emissive primitive.
    pub struct Emitter {
        /// Primitive id: triangles first, spheres after them.
        primitive: u32,
        /// Area in square scene units.
        area: f32,
    }

    /// A point that shines in all directions or into a cone.
    pub struct PointLight {
        /// Position in world space.
        position: [f32; 3],
        /// Radiant intensity along the axis.
        intensity: [f32; 3],
        /// Axis of the cone, a unit vector.
        axis: [f32; 3],
        /// Angle in radians up to which the intensity is whole.
        beam: f32,
        /// Angle in radians from which on there is none.
        cutoff: f32,
        /// One minus the cosine of `beam`.
        beam_height: f32,
        /// One minus the cosine of `cutoff`; 2 is all directions.
        cutoff_height: f32,
        /// 1 where it falls off with the square of what is linear in the cosine, 0 where linearly with the angle.
        is_smooth: u32,
    }

    /// Parallel light.
    pub struct DirectionalLight {
        /// Unit direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance on a surface that faces the light.
        irradiance: [f32; 3],
    }

    /// A light as `transport::light::Lights` chooses it: a column of its alias table, and the light's own probability.
    pub struct LightChoice {
        /// How many of the column's steps mean its own light.
        own: u32,
        /// The light that the others mean.
        above: u32,
        /// Probability of the light with this index; 0 for columns that have no light.
        pmf: f32,
    }

    /// A row of an environment's map, and its cumulative probability.
    pub struct EnvironmentRow {
        /// Cumulative probability after this row.
        marginal: f32,
        /// Cosine of the polar angle at the upper edge.
        upper: f32,
        /// Cosine at the lower edge minus cosine at the upper one: negative.
        step: f32,
        /// One minus the absolute cosine at the upper edge, exact near the poles.
        upper_rest: f32,
        /// Columns over the solid angle of the row: density per solid angle of a cell is its probability times this.
        density: f32,
    }

    /// Everything that stays the same from sample to sample: camera, limits, settings, lights.
    pub struct Job {
        /// Position of the camera in world space.
        camera_position: [f32; 3],
        /// Unit vector to the picture's right.
        camera_right: [f32; 3],
        /// Unit vector to the picture's top.
        camera_up: [f32; 3],
        /// Unit vector along the optical axis.
        camera_forward: [f32; 3],
        /// Half extent of the picture at distance 1, horizontally and vertically.
        camera_half: [f32; 2],
        /// Width and height in pixels.
        resolution: [u32; 2],
        /// Radius of the lens; 0 is a pinhole.
        lens_radius: f32,
        /// Distance of the plane of focus.
        focus_distance: f32,
        /// FILTER_BOX and so on.
        filter_kind: u32,
        /// Half width of the filter in pixels.
        filter_radius: f32,
        /// Greatest number of path edges.
        max_depth: u32,
        /// First path edge after which roulette may end a path, or NONE.
        rr_start: u32,
        /// MIS_POWER, MIS_BALANCE, or NONE.
        mis: u32,
        /// 1 where every light is asked at every vertex, else 0.
        all_lights: u32,
        /// The strategy (s, t) that is kept or left out; NONE, NONE for all.
        one_strategy: [u32; 2],
        /// 1 where that strategy is kept, 0 where it is left out.
        keep_strategy: u32,
        /// SAMPLER_INDEPENDENT or SAMPLER_SOBOL.
        sampler_kind: u32,
        /// Low and high word of the seed.
        seed: [u32; 2],
        /// Number of triangles: primitive ids from here on are spheres.
        triangle_count: u32,
        /// Number of spheres.
        sphere_count: u32,
        /// 1 if `tangents` has a row for every triangle, else 0.
        has_tangents: u32,
        /// First of three texels for each triangle that multiply base colours at its corners, or NONE.
        first_color: u32,
        /// Number of lights.
        light_count: u32,
        /// Index of the first point, direction, environment among the lights.
        light_first: [u32; 3],
        /// Binary logarithm of the steps of a column in `light_choices`; NONE if nothing can be chosen.
        alias_shift: u32,
        /// Centre of the ball around all surfaces.
        ball_center: [f32; 3],
        /// Its radius; 0 without surfaces.
        ball_radius: f32,
        /// 1 if there is an environment, else 0.
        has_environment: u32,
        /// Texture of the environment, or NONE for the same colour from everywhere.
        environment_texture: u32,
        /// Colour, or factor on the texture.
        environment_radiance: [f32; 3],
        /// Sine and cosine of its rotation about +y.
        environment_turn: [f32; 2],
        /// Films of layers for each pixel.
        film_count: u32,
        /// Those of them that are made of contributions; they stand first.
        light_films: u32,
        /// Those of them on which splats land.
        splat_films: u32,
        /// The first film of the layer `depth`, or NONE.
        layer_depth: u32,
        /// The first film of the layer `strategies`, or NONE.
        layer_strategies: u32,
        /// The film of the layer `bounces`, or NONE.
        layer_bounces: u32,
        /// The film of the layer `rays`, or NONE.
        layer_rays: u32,
        /// The film of the layer `albedo`, or NONE.
        layer_albedo: u32,
        /// The film of the layer `normal`, or NONE.
        layer_normal: u32,
        /// The film of the layer `distance`, or NONE.
        layer_distance: u32,
    }

    /// Sums of a pixel's own samples. Each sum is `sum + rest`, where `rest` gathers what rounding took.
    pub struct Sums {
        /// Sum.
        sum: [f32; 3],
        /// What rounding took from it.
        sum_rest: [f32; 3],
        /// Sum of squares.
        sum2: [f32; 3],
        /// What rounding took from it.
        sum2_rest: [f32; 3],
    }

    /// What else a pixel's samples leave.
    pub struct Invalid {
        /// How many of its samples and of their splats were refused.
        count: u32,
        /// Low and high word of the index of the first such sample.
        first: [u32; 2],
    }

    /// What one dispatch counts.
    pub struct Counters {
        /// Rays, modulo 2^32.
        rays: u32,
        /// Samples and splats that were refused.
        invalid: u32,
    }

    /// A step of a sample, as `render::paths::Step`.
    pub struct PathStep {
        /// STEP_CLOSEST, STEP_SHADOW or STEP_LIGHT; 0 where there is none.
        kind: u32,
        /// The primitive that was met, or NONE; of a shadow ray 1 if it was blocked, else 0.
        met: u32,
        /// Where the ray starts.
        origin: [f32; 3],
        /// Where it goes.
        dir: [f32; 3],
        /// How far it is followed.
        t_max: f32,
        /// How far it came.
        t: f32,
        /// Barycentric weights of what it met.
        uv: [f32; 2],
        /// Column and row that light is for.
        pixel: [u32; 2],
        /// The light.
        value: [f32; 3],
        /// The same without its weight.
        unweighted: [f32; 3],
        /// Vertices found from the light.
        light_vertices: u32,
        /// Vertices found from the camera.
        camera_vertices: u32,
    }

    /// Which samples a dispatch adds, as push constants.
    pub struct Wave {
        /// Low and high word of the first sample's index.
        first_sample: [u32; 2],
        /// How many samples of every pixel.
        samples: u32,
        /// The first row of pixels.
        first_row: u32,
        /// The number of rows.
        rows: u32,
    }
}

/// Numbers that both sides write by name.
pub const CONSTANTS: &[(&str, u32)] = &[
    ("NONE", u32::MAX),
    ("MODEL_DISNEY", 0),
    ("MODEL_LAMBERT", 1),
    ("MODEL_CONDUCTOR", 2),
    ("MODEL_PLASTIC", 3),
    ("MODEL_DIELECTRIC", 4),
    ("DISTRIBUTION_GGX", 0),
    ("DISTRIBUTION_BECKMANN", 1),
    ("MASK_THRESHOLD", 0),
    ("MASK_BLEND", 1),
    ("FILTER_BOX", 0),
    ("FILTER_TENT", 1),
    ("FILTER_GAUSS", 2),
    ("FILTER_BLACKMAN_HARRIS", 3),
    ("FILTER_ANTIALIASING_RADIUS", 4),
    ("MIS_POWER", 0),
    ("MIS_BALANCE", 1),
    ("MIS_UNIFORM", 2),
    ("SAMPLER_INDEPENDENT", 0),
    ("SAMPLER_SOBOL", 1),
    ("STEP_CLOSEST", 1),
    ("STEP_SHADOW", 2),
    ("STEP_LIGHT", 3),
    ("MOST_STEPS", MOST_STEPS as u32),
];

/// The text of `shaders/gen/layout.glsl`.
pub fn glsl() -> String {
    let mut text = String::from(
        "// Written by the test `the_committed_layouts_are_those_of_the_code` from src/render/vulkan/layout.rs: edit that.\n\n",
    );
    for (name, value) in CONSTANTS {
        text.push_str(&format!("const uint {name} = {value}u;\n"));
    }
    for s in STRUCTS {
        text.push_str(&format!("\n//{}\nstruct {} {{\n", s.doc, s.name));
        for f in s.fields {
            text.push_str(&format!("    {} {}; //{}\n", f.glsl, f.name, f.doc));
        }
        text.push_str("};\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::render::vulkan::spirv::{self, Sources};

    #[test]
    fn the_committed_layouts_are_those_of_the_code() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/gen/layout.glsl");
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        if committed != glsl() {
            std::fs::write(&path, glsl()).unwrap();
            panic!("shaders/gen/layout.glsl was not up to date: it has been written again, commit it");
        }
    }

    #[test]
    fn fields_follow_each_other_without_holes() {
        for s in STRUCTS {
            let mut at = 0;
            for f in s.fields {
                assert_eq!(f.offset, at, "{}.{}", s.name, f.name);
                at += 4 * match f.glsl {
                    "float" | "uint" => 1,
                    other => usize::from(other.as_bytes()[other.len() - 1] - b'0'),
                };
            }
            assert_eq!(at, s.size, "{}", s.name);
        }
    }

    /// Offset of every member of every struct that a module names: `(struct, member) -> bytes`.
    fn offsets(words: &[u32]) -> BTreeMap<(String, String), u32> {
        let text = |words: &[u32]| {
            let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|b| *b != 0).collect();
            String::from_utf8(bytes).unwrap()
        };
        let (mut names, mut members, mut found) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        let mut rest = &words[5..];
        while let Some(first) = rest.first() {
            let (op, length) = (first & 0xffff, (first >> 16) as usize);
            let (instruction, next) = rest.split_at(length);
            match op {
                5 => drop(names.insert(instruction[1], text(&instruction[2..]))),
                6 => drop(members.insert((instruction[1], instruction[2]), text(&instruction[3..]))),
                // OpMemberDecorate with the decoration Offset.
                72 if instruction[3] == 35 => drop(found.insert((instruction[1], instruction[2]), instruction[4])),
                _ => {}
            }
            rest = next;
        }
        found.into_iter().map(|(key, at)| ((names[&key.0].clone(), members[&key].clone()), at)).collect()
    }

    #[test]
    fn shaders_place_every_field_where_rust_does() {
        let mut text = String::from(
            "#version 460\n#extension GL_EXT_scalar_block_layout : require\n\
             #extension GL_GOOGLE_include_directive : require\n#include \"gen/layout.glsl\"\n",
        );
        let mut uses = String::new();
        for (i, s) in STRUCTS.iter().enumerate() {
            text.push_str(&format!(
                "layout(set = 0, binding = {i}, scalar) buffer B{i} {{ {} rows[2]; }} b{i};\n",
                s.name
            ));
            uses.push_str(&format!("b{i}.rows[0] = b{i}.rows[1];\n"));
        }
        text.push_str(&format!("void main() {{\n{uses}}}\n"));
        let words = spirv::compile(&Sources::Embedded, "layout.comp", &text, &[], &[]).unwrap();
        let found = offsets(&words);
        for s in STRUCTS {
            for f in s.fields {
                let at = found.get(&(s.name.to_owned(), f.name.to_owned()));
                assert_eq!(at.copied(), Some(f.offset as u32), "{}.{}", s.name, f.name);
            }
        }
    }
}
