//! Texels beyond the size of one buffer: they are stored in blocks by address, with the same
//! results.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::layer::LayerLayout;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{LinearTexels, NONE, Texture};
use lumbre_light::scene::desc::{Texels, TextureDesc};
use lumbre_render::RenderError;
use lumbre_vulkan::context::{device::Device, limits::Limits, physical_device::Caps};
use lumbre_vulkan::error::VulkanError;
use lumbre_vulkan::layout::Specialization;
use lumbre_vulkan::memory::subpaths::SubpathRoom;
use lumbre_vulkan::memory::texel_words::{TexelLayout, environment_map};
use lumbre_vulkan::memory::upload::{JobBuffers, SceneBuffers};
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::test_kernel;
use lumbre_vulkan::renderer::into_render_error;

use super::harness;
use super::images::{render, scene_with_all_lights, supported_modes};
use super::verdict::compare;
use crate::common::{self, SceneBuilder, grey, job, named_job};

/// Returns the device with a limit of this many words of texels per buffer.
fn limited_to(device: &Device, words: u64) -> Arc<Device> {
    harness::changed(device, |limits, _| limits.texels = words * 4)
}

/// Returns a scene with textures of floats and, by both curves, of bytes, a mask and an environment
/// map, with colours and second coordinates at triangle corners.
fn scene() -> Arc<CompiledScene> {
    let mut scene = (*scene_with_all_lights()).clone();
    let part = |i: usize, k: usize| (7 * i + 3 * k) as f32 % 10.0 / 10.0;
    let triangles = 0..scene.triangles.len();
    scene.colors = triangles
        .clone()
        .map(|i| [0, 1, 2].map(|k| Vec3::new(1.0, part(i, k), 0.5)))
        .collect();
    scene.second_uvs = triangles
        .map(|i| [0, 1, 2].map(|k| Vec2::new(part(i, k), part(k, i))))
        .collect();
    scene.textures[0].lookup.second = true;
    // Bytes in the base colours; the same ones by the other curve belong to no material.
    let byte = |i: usize, k: usize| (37 * i + 91 * k) as u8;
    let bytes: Vec<[u8; 4]> = (0..15).map(|i| [0, 1, 2, 3].map(|k| byte(i, k))).collect();
    let image = TextureDesc::new("", 5, 3, Texels::Rgba8(bytes.into()));
    let lookup = scene.textures[0].lookup;
    let decoded = |srgb| Texture {
        lookup,
        ..Texture::decode(&image, srgb)
    };
    scene.textures[0] = decoded(true);
    scene.textures.push(decoded(false));
    Arc::new(scene)
}

/// Numbers of what is no texture in `parity/texels.comp`.
const COLORS: u32 = u32::MAX - 1;
const SECOND_COORDINATES: u32 = u32::MAX;

/// Returns the inputs of `parity/texels.comp` for all texels of [`scene`], and the texels.
fn all_texels(scene: &CompiledScene) -> (Vec<[u32; 2]>, Vec<[f32; 3]>) {
    let maps = scene.textures.iter().chain(environment_map(scene));
    let maps = maps.map(|map| map.texels.iter().collect());
    let colors = scene.colors.as_flattened().iter().map(Vec3::to_array);
    let second = scene.second_uvs.as_flattened().iter();
    let second = second.map(|uv| [uv.x, uv.y, 0.0]);
    let sets = (0..).zip(maps).chain([
        (COLORS, colors.collect::<Vec<_>>()),
        (SECOND_COORDINATES, second.collect()),
    ]);
    let all = sets.flat_map(|(set, texels)| {
        let numbered = texels.into_iter().enumerate();
        numbered.map(move |(i, texel)| ([set, i as u32], texel))
    });
    all.unzip()
}

#[test]
fn shaders_find_every_texel_in_blocks_of_every_size() {
    let device = or_return!(harness::device());
    if !device.info.caps.extended() {
        common::skipped(format_args!(
            "{} has no extended shaders",
            device.info.line()
        ));
        return;
    }
    let (scene, job) = (scene(), job([8, 8], 2, 1));
    let (inputs, texels) = all_texels(&scene);
    let bits = |x: &f32| x.to_bits();
    let expected: Vec<u32> = texels.as_flattened().iter().map(bits).collect();
    let count = TexelLayout::new(&scene).count;
    // Blocks of four words, of sixteen, the last one partial; the fewest blocks possible; and one
    // buffer that just holds all words.
    for (limit, shift) in [
        (7, Some(2)),
        (31, Some(4)),
        (count - 1, Some((count - 1).ilog2())),
        (count, None),
    ] {
        let device = limited_to(&device, limit);
        let buffers = SceneBuffers::new(&device, &scene).unwrap();
        assert_eq!(buffers.texel_shift(), shift, "{limit} words");
        let room = SubpathRoom::new(&job, None, u64::MAX);
        let rest = JobBuffers::new(&device, &scene, &job, &LayerLayout::default(), &room).unwrap();
        let constants = Specialization {
            texel_shift: shift.unwrap_or(NONE),
            ..Specialization::default()
        };
        let generation = device
            .info
            .caps
            .pipeline
            .then_some(kernel!(Generation "texels.rgen"));
        for kernel in Some(kernel!(Compute "texels.comp"))
            .into_iter()
            .chain(generation)
        {
            let found = test_kernel::run(
                &device,
                (&buffers, &rest, &room),
                (kernel, &constants),
                inputs.as_flattened(),
                [2, 3],
            )
            .unwrap();
            assert!(found == expected, "{limit} words, {:?}", kernel.0);
        }
    }
    harness::assert_no_validation_messages();
}

#[test]
fn a_scene_with_texels_in_blocks_is_the_same_in_every_tracing_mode() {
    let device = or_return!(harness::device());
    if !device.info.caps.extended() {
        common::skipped(format_args!(
            "{} has no extended shaders",
            device.info.line()
        ));
        return;
    }
    let (scene, blocks) = (scene(), limited_to(&device, 15));
    let with = |name: &str| named_job(name, [48, 27], 4, 8);
    let kind = harness::fastest_to_compile(&device);
    let whole = render(&device, kind, &scene, &with("nee"), 4);
    let parts = render(&blocks, kind, &scene, &with("nee"), 4);
    assert!(whole == parts, "the bits differ from those with one buffer");
    compare(
        "texels in blocks",
        &parts,
        &common::render(&scene, with("nee"), 4),
    );
    let expected = common::render(&scene, with("bpt"), 4);
    for kind in supported_modes(&device)
        .into_iter()
        .filter(|other| *other != kind)
    {
        let found = render(&blocks, kind, &scene, &with("bpt"), 4);
        compare(
            &format!("texels in blocks by {}", kind.backend()),
            &found,
            &expected,
        );
    }
    harness::assert_no_validation_messages();
}

/// Returns a scene with floats instead of all texels of bytes.
fn with_floats(scene: &CompiledScene) -> Arc<CompiledScene> {
    let mut scene = scene.clone();
    for texture in &mut scene.textures {
        texture.texels = LinearTexels::Floats(texture.texels.iter().collect());
    }
    Arc::new(scene)
}

#[test]
fn texels_of_bytes_have_the_bits_of_floats() {
    let device = or_return!(harness::device());
    let both = scene();
    let mut bytes = (*both).clone();
    bytes.textures[1] = bytes.textures[2].clone();
    let kind = harness::fastest_to_compile(&device);
    let job = named_job("nee", [48, 27], 4, 8);
    for (name, scene) in [("bytes and floats", both), ("bytes", Arc::new(bytes))] {
        let found = render(&device, kind, &scene, &job, 4);
        let floats = render(&device, kind, &with_floats(&scene), &job, 4);
        assert!(
            found == floats,
            "{name}: the bits differ from those of floats"
        );
        compare(name, &found, &common::render(&scene, job.clone(), 4));
    }
    harness::assert_no_validation_messages();
}

#[test]
fn texels_that_do_not_fit_are_refused_with_both_sizes() {
    let device = or_return!(harness::device());
    let mut builder = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0);
    builder.texture(Texture::new(1024, 512, vec![[0.5; 3]; 1024 * 512]));
    let scene = builder
        .quad(
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
            grey(0.5),
        )
        .build();
    let refused = |device: Arc<Device>, found: &str| {
        let error = SceneBuffers::new(&device, &scene).err().unwrap();
        let message = error.to_string();
        assert!(matches!(error, VulkanError::TooLarge { .. }), "{error:?}");
        assert!(
            message.starts_with("the buffer `texels` needs 6 MiB") && message.contains(found),
            "{message}"
        );
        assert!(matches!(
            into_render_error(TracingMode::Compute, error),
            RenderError::Unsupported { .. }
        ));
    };
    let narrow = |limits: &mut Limits| (limits.storage_range, limits.texels) = (1 << 20, 1 << 20);
    // Blocks need extended shaders.
    let plain = |limits: &mut Limits, caps: &mut Caps| {
        narrow(limits);
        *caps = Caps {
            scalar_layout: true,
            ..Caps::default()
        };
    };
    refused(harness::changed(&device, plain), "offers 1 MiB: each array");
    let small = |limits: &mut Limits, _: &mut Caps| {
        narrow(limits);
        limits.heap = 3 << 20;
    };
    if device.info.caps.extended() {
        refused(harness::changed(&device, small), "offers 3 MiB: the scene");
        let blocks = SceneBuffers::new(
            &harness::changed(&device, |limits, _| narrow(limits)),
            &scene,
        )
        .unwrap();
        assert_eq!(
            blocks.texel_shift(),
            Some(18),
            "256 Ki words of four bytes in a MiB"
        );
    }
    harness::assert_no_validation_messages();
}
