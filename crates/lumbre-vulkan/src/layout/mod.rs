//! Structs that the host and shaders share, each defined once for both sides.
//!
//! `gpu_structs!` generates a Rust struct and its GLSL text from one list of fields. Every field
//! consists of 32-bit words and shaders use scalar block layout, so `#[repr(C)]` and GLSL lay it
//! out alike; where the compiler of shaders is installed, a test compiles the text and compares
//! each offset in the SPIR-V with the Rust one. The text is `shaders/gen/layout.glsl`.

mod film;
mod job;
mod scene;
mod specialization;
mod subpaths;

use lumbre_light::scene::compile::{DelayKind, Distribution, Formulas, MaskMode, Model, Wrap};
use lumbre_light::transport::camera::FilterKind;
use lumbre_render::path_trace::MAX_PATH_EVENTS;

pub use film::{
    Counters, Invalid, PathStep, SampleSums, SampleValue, SlotSums, WaveParams, add_counters,
};
pub use job::{EnvironmentRow, JobParams, LightChoice};
pub use scene::{
    DelayProfile, DirectionalLight, Emitter, InstanceTransform, Knot, Material, MaterialPart,
    Placement, PointLight, Sphere, Tangents, Texture, Triangle, TriangleAttributes,
};
pub use specialization::{ConstantLayout, Specialization};
pub use subpaths::{LightListHead, LightPath, SubpathLength, SubpathVertex};

/// Rust type with the bytes of a GLSL type in scalar block layout.
pub trait GlslType {
    /// Name of the GLSL type.
    const NAME: &'static str;
}

macro_rules! glsl_types {
    ($($rust:ty => $glsl:literal),* $(,)?) => { $(
        impl GlslType for $rust {
            const NAME: &'static str = $glsl;
        }
    )* };
}

glsl_types! {
    f32 => "float", [f32; 2] => "vec2", [f32; 3] => "vec3", [f32; 4] => "vec4",
    u32 => "uint", [u32; 2] => "uvec2", [u32; 3] => "uvec3", [u32; 4] => "uvec4",
}

/// Field of a shared struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldLayout {
    /// Name, the same on both sides.
    pub name: &'static str,
    /// Name of its GLSL type.
    pub glsl: &'static str,
    /// Offset from the start of the Rust struct in bytes.
    pub offset: usize,
    /// Description of the field.
    pub doc: &'static str,
}

/// Layout of a shared struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Name, the same on both sides.
    pub name: &'static str,
    /// Description of the struct.
    pub doc: &'static str,
    /// Size of the Rust struct in bytes.
    pub size: usize,
    /// Fields in their order.
    pub fields: &'static [FieldLayout],
}

macro_rules! gpu_structs {
    ($(
        $(#[doc = $doc:literal])+
        pub struct $name:ident {
            $($(#[doc = $field_doc:literal])+ $field:ident: $ty:ty,)+
        }
    )+) => {
        $(
            $(#[doc = $doc])+
            #[repr(C)]
            #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            pub struct $name { $($(#[doc = $field_doc])+ pub $field: $ty,)+ }
        )+

        /// These structs, in the order of `shaders/gen/layout.glsl`.
        pub const STRUCTS: &[super::StructLayout] = &[$(super::StructLayout {
            name: stringify!($name),
            doc: concat!($($doc),+),
            size: size_of::<$name>(),
            fields: &[$(super::FieldLayout {
                name: stringify!($field),
                glsl: <$ty as super::GlslType>::NAME,
                offset: std::mem::offset_of!($name, $field),
                doc: concat!($($field_doc),+),
            }),+],
        }),+];
    };
}

use gpu_structs;

/// Returns all shared structs, in the order of `shaders/gen/layout.glsl`.
pub fn structs() -> impl Iterator<Item = &'static StructLayout> {
    [
        scene::STRUCTS,
        job::STRUCTS,
        film::STRUCTS,
        subpaths::STRUCTS,
    ]
    .into_iter()
    .flatten()
}

/// Custom index of the instance of the triangles outside instanced meshes.
pub const INSTANCE_TRIANGLES: u32 = 0;

/// Custom index of the instance of the spheres.
pub const INSTANCE_SPHERES: u32 = 1;

/// Custom index of the first instance of a mesh; the others follow.
pub const INSTANCE_MESHES: u32 = 2;

/// Size of the traversal stack of `shaders/trace/bvh.glsl`: one entry for each level of the scene's
/// tree and, with instances, one for each level of a mesh's tree and two between them.
pub const BVH_STACK: u32 = 32;

/// Number of light subpaths in a row of invocations.
pub const LIGHT_PATHS_ROW: u32 = 1024;

/// Number of light subpaths whose vertices a workgroup lists.
pub const LIST_BLOCK: u32 = 256;

/// Steps of `shaders/entry/light_list.comp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListStep {
    /// Sums of the numbers of vertices within blocks of subpaths.
    Paths,
    /// Sums of those of the blocks.
    Blocks,
    /// The list itself.
    Vertices,
}

/// Enums whose values shaders know by number: the beginning of their constants, and the names of
/// the values, in their order.
const NAMED: &[(&str, &[&str])] = &[
    ("MODEL", Model::NAMES),
    ("DISTRIBUTION", Distribution::NAMES),
    ("FORMULAS", Formulas::NAMES),
    ("MASK", MaskMode::NAMES),
    ("WRAP", Wrap::NAMES),
    ("FILTER", FilterKind::NAMES),
    ("DELAY", DelayKind::NAMES),
];

/// Further constants that both sides refer to by name.
pub const CONSTANTS: &[(&str, u32)] = &[
    ("NONE", u32::MAX),
    ("CAMERA_PERSPECTIVE", 0),
    ("CAMERA_ORTHOGRAPHIC", 1),
    ("CAMERA_SPHERICAL", 2),
    ("MIS_POWER", 0),
    ("MIS_BALANCE", 1),
    ("MIS_UNIFORM", 2),
    ("SAMPLER_INDEPENDENT", 0),
    ("SAMPLER_SOBOL", 1),
    ("SAMPLER_ZSOBOL", 2),
    ("TIME_FILTER_NONE", 0),
    ("TIME_FILTER_BOX", 1),
    ("TIME_FILTER_GAUSS", 2),
    ("STEP_CLOSEST", 1),
    ("STEP_SHADOW", 2),
    ("STEP_LIGHT", 3),
    ("MAX_PATH_EVENTS", MAX_PATH_EVENTS as u32),
    ("INSTANCE_TRIANGLES", INSTANCE_TRIANGLES),
    ("INSTANCE_SPHERES", INSTANCE_SPHERES),
    ("INSTANCE_MESHES", INSTANCE_MESHES),
    ("BVH_STACK", BVH_STACK),
    ("NOT_CONNECTIBLE", 1 << 31),
    ("LIGHT_PATHS_ROW", LIGHT_PATHS_ROW),
    ("LIST_BLOCK", LIST_BLOCK),
    ("LIST_STEP_PATHS", ListStep::Paths as u32),
    ("LIST_STEP_BLOCKS", ListStep::Blocks as u32),
    ("LIST_STEP_VERTICES", ListStep::Vertices as u32),
];

/// Returns the text of `shaders/gen/layout.glsl`.
pub fn glsl() -> String {
    let mut text = String::from(
        "// Generated from crates/lumbre-vulkan/src/layout/ by the test\n\
         // `the_committed_layouts_are_those_of_the_code`; do not edit.\n\n",
    );
    for (name, value) in CONSTANTS {
        text.push_str(&format!("const uint {name} = {value}u;\n"));
    }
    for (prefix, names) in NAMED {
        for (value, name) in names.iter().enumerate() {
            let name = name.to_uppercase();
            text.push_str(&format!("const uint {prefix}_{name} = {value}u;\n"));
        }
    }
    for s in structs() {
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
    use super::*;

    #[test]
    fn the_committed_layouts_are_those_of_the_code() {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders/gen/layout.glsl");
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        if committed != glsl() {
            std::fs::write(&path, glsl()).unwrap();
            panic!("shaders/gen/layout.glsl was outdated and has been regenerated: commit it");
        }
    }

    #[test]
    fn fields_follow_each_other_without_holes() {
        for s in structs() {
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
}

#[cfg(test)]
mod offset_tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::pipelines::glsl::Compiler;
    use crate::pipelines::recipe::Recipe;
    use crate::pipelines::shrink::instructions;
    use crate::pipelines::sources::Sources;

    /// Returns the offset in bytes of every struct member in a module: `(struct, member) -> bytes`.
    fn offsets(words: &[u32]) -> BTreeMap<(String, String), u32> {
        let text = |words: &[u32]| {
            let bytes: Vec<u8> = words
                .iter()
                .flat_map(|w| w.to_le_bytes())
                .take_while(|b| *b != 0)
                .collect();
            String::from_utf8(bytes).unwrap()
        };
        let (mut names, mut members, mut found) =
            (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for instruction in instructions(words) {
            match instruction[0] & 0xffff {
                5 => {
                    names.insert(instruction[1], text(&instruction[2..]));
                }
                6 => {
                    members.insert((instruction[1], instruction[2]), text(&instruction[3..]));
                }
                // OpMemberDecorate with the decoration Offset.
                72 if instruction[3] == 35 => {
                    found.insert((instruction[1], instruction[2]), instruction[4]);
                }
                _ => {}
            }
        }
        found
            .into_iter()
            .map(|(key, at)| ((names[&key.0].clone(), members[&key].clone()), at))
            .collect()
    }

    #[test]
    fn shaders_place_every_field_where_rust_does() {
        let Some(compiler) = Compiler::installed() else {
            return;
        };
        let mut text = String::from(
            "#version 460\n#extension GL_EXT_scalar_block_layout : require\n\
             #extension GL_GOOGLE_include_directive : require\n#include \"gen/layout.glsl\"\n",
        );
        let mut uses = String::new();
        for (i, s) in structs().enumerate() {
            text.push_str(&format!(
                "layout(set = 0, binding = {i}, scalar) buffer B{i} {{ {} rows[2]; }} b{i};\n",
                s.name
            ));
            uses.push_str(&format!("b{i}.rows[0] = b{i}.rows[1];\n"));
        }
        text.push_str(&format!("void main() {{\n{uses}}}\n"));
        let recipe = Recipe {
            file: String::new(),
            entry: "layout.comp".to_owned(),
            text: Some(text),
            defines: Vec::new(),
            generated: Vec::new(),
        };
        let words = compiler.compile(&Sources::Embedded, &recipe).unwrap();
        let found = offsets(&words);
        for s in structs() {
            for f in s.fields {
                let at = found.get(&(s.name.to_owned(), f.name.to_owned()));
                assert_eq!(at.copied(), Some(f.offset as u32), "{}.{}", s.name, f.name);
            }
        }
    }
}
