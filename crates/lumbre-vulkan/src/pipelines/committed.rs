//! SPIR-V of the shaders. Written by `cargo shaders`; do not edit.

/// Embeds files of `spirv/`.
macro_rules! embed {
    ($($file:literal),* $(,)?) => {
        /// File name and bytes of every module.
        pub(super) static MODULES: &[(&str, &[u8])] = &[$((
            $file,
            include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/spirv/", $file)),
        )),*];
    };
}

embed![
    "bdpt.floats.comp.spv",
    "bdpt.floats.query.comp.spv",
    "bdpt.floats.rgen.spv",
    "bdpt.integers.comp.spv",
    "bdpt.integers.query.comp.spv",
    "bdpt.integers.rgen.spv",
    "bpt.comp.spv",
    "bpt.extended.comp.spv",
    "bpt.extended.query.comp.spv",
    "bpt.extended.rgen.spv",
    "bpt.query.comp.spv",
    "bpt.rgen.spv",
    "mask.extended.rahit.spv",
    "mask.rahit.spv",
    "miss.rmiss.spv",
    "nee.comp.spv",
    "nee.extended.comp.spv",
    "nee.extended.query.comp.spv",
    "nee.extended.rgen.spv",
    "nee.query.comp.spv",
    "nee.rgen.spv",
    "sphere.extended.rint.spv",
    "sphere.rchit.spv",
    "sphere.rint.spv",
    "triangle.extended.rchit.spv",
    "triangle.rchit.spv",
];
