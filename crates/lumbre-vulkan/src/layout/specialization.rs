//! Specialisation constants of the shaders: numbers and switches of a job that a driver compiles
//! into its pipeline, so that unused code is removed.

use std::mem::offset_of;

use ash::vk;
use lumbre_light::scene::compile::{Model, NONE};

/// Specialisation constant of the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConstantLayout {
    /// Name in GLSL.
    pub name: &'static str,
    /// Type in GLSL: `uint` or `bool`.
    pub glsl: &'static str,
    /// Offset from the start of [`Specialization`] in bytes.
    pub offset: usize,
    /// Whether only extended modules have it.
    pub extended: bool,
    /// Value without specialisation.
    pub default: u32,
    /// Description of the constant.
    pub doc: &'static str,
}

macro_rules! specialization {
    ($($(#[doc = $doc:literal])+ $field:ident: $name:literal $glsl:literal $extended:literal = $default:expr,)+) => {
        /// Values of the specialisation constants. The id of a constant is its index among the
        /// fields. A field of 32 bits for each, 0 or 1 for a `bool`.
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct Specialization { $($(#[doc = $doc])+ pub $field: u32,)+ }

        /// The constants in the order of their ids.
        pub const CONSTANTS: &[ConstantLayout] = &[$(ConstantLayout {
            name: $name,
            glsl: $glsl,
            offset: offset_of!(Specialization, $field),
            extended: $extended,
            default: $default,
            doc: concat!($($doc),+),
        }),+];

        impl Default for Specialization {
            fn default() -> Specialization {
                Specialization { $($field: $default),+ }
            }
        }
    };
}

specialization! {
    /// SAMPLER_INDEPENDENT, SAMPLER_SOBOL, or SAMPLER_ZSOBOL plus the binary logarithm of a block.
    sampler_kind: "SAMPLER_KIND" "uint" false = 0,
    /// Bit mask of the material models of the scene.
    models: "MODELS" "uint" false = (1 << Model::ALL.len()) - 1,
    /// Whether the film has layers.
    layers: "LAYERS" "bool" false = 0,
    /// Whether the events of paths are recorded.
    paths: "PATHS" "bool" false = 0,
    /// Whether the scene has composed or delayed materials.
    parts: "PARTS" "bool" false = 0,
    /// Whether a mesh has a second set of texture coordinates.
    second_uvs: "SECOND_UVS" "bool" false = 0,
    /// Binary logarithm of the number of words of a block of texels; NONE if all are in one buffer.
    texel_shift: "TEXEL_SHIFT" "uint" true = NONE,
    /// Whether the film has a time axis.
    times: "TIMES" "bool" true = 0,
    /// Whether the scene has instances of meshes.
    instances: "INSTANCES" "bool" true = 0,
    /// Whether a parameter of a material, such as its base colour, has a texture.
    textures: "TEXTURES" "bool" false = 1,
    /// Whether a texture has texels of bytes.
    byte_texels: "BYTE_TEXELS" "bool" false = 1,
    /// Whether a texture has texels of floats.
    float_texels: "FLOAT_TEXELS" "bool" false = 1,
    /// Whether a material has a mask.
    masks: "MASKS" "bool" false = 1,
    /// Whether shading needs tangents: for a normal map or for stretched highlights.
    tangents: "TANGENTS" "bool" false = 1,
    /// Whether a material has a bump map.
    bumps: "BUMPS" "bool" false = 1,
    /// Whether a material has offsets against the shadow terminator.
    terminators: "TERMINATORS" "bool" false = 1,
    /// Whether there are lights other than emissive surfaces.
    other_lights: "OTHER_LIGHTS" "bool" false = 1,
    /// Whether light is sampled from every light at every vertex, not from one.
    all_lights: "ALL_LIGHTS" "bool" false = 0,
    /// Whether each sample of a pixel is an invocation, and its value is added afterwards.
    parallel_samples: "PARALLEL_SAMPLES" "bool" false = 0,
    /// Whether an invocation starts its next sample as soon as a camera path has ended, whatever its
    /// neighbours do.
    regenerated: "REGENERATED" "bool" false = 0,
    /// Number of light vertices that are drawn for a connection.
    candidates: "CANDIDATES" "uint" false = 1,
}

impl Specialization {
    /// Returns the entries that assign the constants of a pipeline.
    pub fn entries() -> Vec<vk::SpecializationMapEntry> {
        let entry = |(id, constant): (u32, &ConstantLayout)| {
            vk::SpecializationMapEntry::default()
                .constant_id(id)
                .offset(constant.offset as u32)
                .size(size_of::<u32>())
        };
        (0..).zip(CONSTANTS).map(entry).collect()
    }
}

/// Returns the text of `shaders/gen/specialization.glsl`.
#[cfg(test)]
fn glsl() -> String {
    let mut text = String::from(
        "// Generated from crates/lumbre-vulkan/src/layout/specialization.rs by the test\n\
         // `the_committed_constants_are_those_of_the_code`; do not edit.\n\n",
    );
    for (id, constant) in CONSTANTS.iter().enumerate() {
        let ConstantLayout { name, glsl, .. } = constant;
        let value = match *glsl {
            "bool" => (constant.default != 0).to_string(),
            _ => format!("{}u", constant.default),
        };
        let declared = format!("layout(constant_id = {id}) const {glsl} {name} = {value};\n");
        text.push_str(&format!("//{}\n", constant.doc));
        if constant.extended {
            let fixed = format!("const {glsl} {name} = {value};\n");
            text.push_str(&format!(
                "#ifdef EXTENDED\n{declared}#else\n{fixed}#endif\n"
            ));
        } else {
            text.push_str(&declared);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_committed_constants_are_those_of_the_code() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../shaders/gen/specialization.glsl"
        );
        let committed = std::fs::read_to_string(path).unwrap_or_default();
        if committed != glsl() {
            std::fs::write(path, glsl()).unwrap();
            panic!("shaders/gen/specialization.glsl was outdated and has been written: commit it");
        }
    }

    #[test]
    fn every_constant_has_its_own_words_of_the_data() {
        let offsets: Vec<usize> = CONSTANTS.iter().map(|constant| constant.offset).collect();
        let expected: Vec<usize> = (0..CONSTANTS.len()).map(|i| 4 * i).collect();
        assert_eq!(offsets, expected);
        assert_eq!(size_of::<Specialization>(), 4 * CONSTANTS.len());
        assert_eq!(Specialization::entries().len(), CONSTANTS.len());
    }
}
