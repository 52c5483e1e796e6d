//! Surfaces with all effects of textures, and their BSDFs.

use std::sync::Arc;

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Distribution, Formulas, Interface, Lookup, MaskMode, Material, Model, NONE, RoughnessTexels,
    Texture, UvMap, Wrap,
};
use lumbre_light::scene::desc::TextureFilter;
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::surface::{Surface, coverage, is_masked_out};
use lumbre_render::Job;

use super::{CLOSE, RandomInputs, SAME};
use crate::common::{SceneBuilder, WHITE, job};
use crate::parity::{Near, Row, Twin};

/// Number of triangles; spheres follow them.
const TRIANGLES: u32 = 480;
const SPHERES: u32 = 24;

/// Returns a texture or none.
fn maybe(d: &mut RandomInputs, texture: u32) -> u32 {
    if d.word().is_multiple_of(4) {
        texture
    } else {
        NONE
    }
}

/// Returns a material with random parameters, mostly at the ends of their ranges.
fn material(d: &mut RandomInputs, textures: u32) -> Material {
    let model = match d.word() % 10 {
        0 | 1 => Model::Lambert,
        2 => Model::Conductor,
        3 => Model::Plastic,
        4 => Model::Dielectric,
        _ => Model::Disney,
    };
    let texture = |d: &mut RandomInputs| {
        let index = d.word() % textures;
        maybe(d, index)
    };
    Material {
        model,
        base_color: Vec3::from_array(std::array::from_fn(|_| d.part())),
        emission: if d.word().is_multiple_of(4) {
            Vec3::new(1.0, 2.0, 3.0)
        } else {
            Vec3::ZERO
        },
        roughness: [d.part(), d.between(0.0, 0.1)][d.word() as usize % 2],
        metallic: d.part(),
        opacity: d.part(),
        ior: [1.0, 1.001, 1.5, 2.5, 0.7][d.word() as usize % 5],
        subsurface: d.part(),
        specular_tint: d.part(),
        anisotropic: d.part(),
        anisotropic_direction: if d.word().is_multiple_of(3) {
            d.direction()
        } else {
            Vec3::ZERO
        },
        sheen: d.part(),
        sheen_tint: d.part(),
        clearcoat: d.part(),
        clearcoat_gloss: d.part(),
        normal_strength: d.between(0.2, 2.0),
        bump_height: d.between(-0.5, 0.5),
        mask_threshold: 0.4,
        mask_mode: if d.word().is_multiple_of(2) {
            MaskMode::Threshold
        } else {
            MaskMode::Blend
        },
        one_sided: d.word().is_multiple_of(2),
        shadow_terminator: d.word().is_multiple_of(2),
        base_color_texture: texture(d),
        emission_texture: texture(d),
        mask_texture: texture(d),
        roughness_texture: texture(d),
        metallic_texture: texture(d),
        opacity_texture: texture(d),
        anisotropic_texture: texture(d),
        normal_texture: texture(d),
        bump_texture: texture(d),
        tiling: UvMap {
            scale: [1.0, 3.5, -2.0][d.word() as usize % 3],
            offset: Vec2::new(d.between(-2.0, 2.0), d.between(-2.0, 2.0)),
        },
        interface: interface(d),
        ..WHITE
    }
}

/// Returns every seventh material as a translucent sheet, every eleventh as a rough diffuse surface,
/// and every third by the formulas of Mitsuba, with numbers that they have already. Roughness
/// textures of every fifth have alpha.
fn with_models(i: u32, mut m: Material) -> Material {
    if i.is_multiple_of(5) {
        m.roughness_texels = RoughnessTexels::Alpha;
    }
    if i.is_multiple_of(3) {
        m.formulas = Formulas::Mitsuba;
        m.interface.transmittance = Some(std::array::from_fn(|k| m.sheen / (k + 1) as f32));
    }
    if i.is_multiple_of(11) {
        return Material {
            model: Model::OrenNayar,
            ..m
        };
    }
    if !i.is_multiple_of(7) {
        return m;
    }
    Material {
        model: Model::Translucent,
        transmittance: m.interface.specular,
        transmittance_texture: m.metallic_texture,
        ..m
    }
}

/// Returns the parameters of a single interface, including metals without an index.
fn interface(d: &mut RandomInputs) -> Interface {
    let mut three = |most: f32| Vec3::from_array(std::array::from_fn(|_| most * d.part()));
    let (specular, eta, k) = (three(1.0), three(3.0), three(6.0));
    Interface {
        specular,
        eta,
        k,
        distribution: Distribution::ALL[d.word() as usize % 2],
        thin: d.word().is_multiple_of(4),
        nonlinear: d.word().is_multiple_of(2),
        internal_reflectance: d.part(),
        transmittance: None,
    }
}

/// Returns a scene with one triangle or sphere of each of many materials.
fn many_materials() -> (Arc<CompiledScene>, Job) {
    let mut d = RandomInputs {
        count: 1 << 20,
        words: Vec::new(),
    };
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 60.0);
    for size in [[4, 3], [1, 1], [7, 2]] {
        let texels: Vec<[f32; 3]> = (0..size[0] * size[1])
            .map(|_| std::array::from_fn(|_| d.unit()))
            .collect();
        builder.texture(Texture::new(size[0], size[1], texels));
    }
    // The same textures again, with other transforms.
    let map = Affine2 {
        matrix2: Mat2::from_cols_array(&[0.8, -0.3, 0.4, 1.7]),
        translation: Vec2::new(0.3, -1.2),
    };
    let lookups = [
        Lookup {
            wrap: [Wrap::Mirror, Wrap::Clamp],
            filter: Default::default(),
            second: false,
            map: None,
        },
        Lookup {
            wrap: [Wrap::Repeat; 2],
            filter: TextureFilter::Nearest,
            second: true,
            map: Some(map),
        },
        Lookup {
            wrap: [Wrap::Clamp, Wrap::Mirror],
            filter: Default::default(),
            second: true,
            map: Some(map),
        },
    ];
    builder = builder.with(|s| {
        for (i, lookup) in lookups.into_iter().enumerate() {
            s.textures.push(Texture {
                lookup,
                ..s.textures[i].clone()
            });
        }
    });
    for i in 0..TRIANGLES {
        let corners = [(); 3].map(|()| d.vector(2.0));
        let uvs = [(); 3].map(|()| Vec2::new(d.between(-1.5, 1.5), d.between(-1.5, 1.5)));
        let m = with_models(i, material(&mut d, 6));
        builder = builder.triangle(corners, uvs, m);
    }
    for i in 0..SPHERES {
        let (center, radius) = (d.vector(2.0), d.between(0.1, 2.0));
        let m = with_models(i, material(&mut d, 6));
        builder = builder.sphere(center, radius, m);
    }
    let scene = builder.with(|s| {
        for normals in s.normals.make_smooth() {
            *normals = normals.map(|n| (n + d.vector(0.7)).normalize_or(n));
        }
        s.tangents = (0..TRIANGLES)
            .map(|_| {
                [(); 3].map(|()| {
                    d.direction().extend(if d.word().is_multiple_of(2) {
                        1.0
                    } else {
                        -1.0
                    })
                })
            })
            .collect();
        s.tangents[5] = [Vec4::ZERO; 3];
        s.second_uvs = (0..TRIANGLES)
            .map(|_| [(); 3].map(|()| Vec2::new(d.between(-1.5, 1.5), d.unit())))
            .collect();
        s.colors = (0..TRIANGLES)
            .map(|_| [(); 3].map(|()| Vec3::new(d.unit(), d.unit(), d.unit())))
            .collect();
    });
    (scene.build(), job([8, 8], 3, 1))
}

/// Appends the words of a hit and an outgoing direction: primitive, uv, origin, dir, t, wi.
fn put_hit(scene: &CompiledScene, d: &mut RandomInputs) {
    let primitive = d.word() % (TRIANGLES + SPHERES);
    let (v, w) = (d.unit(), d.unit());
    let uv = if v + w > 1.0 {
        [1.0 - v, 1.0 - w]
    } else {
        [v, w]
    };
    let (dir, t, wi) = (d.direction(), d.between(0.1, 3.0), d.direction());
    let origin = match primitive.checked_sub(TRIANGLES) {
        Some(i) => {
            let ball = &scene.spheres[i as usize];
            ball.center + d.direction() * ball.radius - dir * t
        }
        None => d.vector(2.0),
    };
    d.put_word(primitive);
    d.put(uv);
    d.put(origin.to_array());
    d.put(dir.to_array());
    d.put([t]);
    d.put(wi.to_array());
}

fn take_hit(row: &mut Row) -> (Ray, Hit, Vec3) {
    let primitive = row.word();
    let uv = row.floats();
    let ray = Ray {
        origin: Vec3::from_array(row.floats()),
        dir: Vec3::from_array(row.floats()),
    };
    let [t] = row.floats();
    (
        ray,
        Hit {
            t,
            primitive,
            instance: NONE,
            uv,
        },
        Vec3::from_array(row.floats()),
    )
}

/// Returns rows of a hit, a direction, a mode and three sample numbers. Every other direction is
/// sampled from the BSDF, since others rarely hit a narrow lobe.
fn scattering() -> Vec<u32> {
    let (scene, _) = many_materials();
    RandomInputs::rows(9000, |d, i| {
        let start = d.words.len();
        put_hit(&scene, d);
        let mode = d.word() % 2;
        let numbers = [d.unit(), d.unit(), d.unit()];
        d.put_word(mode);
        d.put(numbers);
        if i.is_multiple_of(2) {
            let mut row = Row::new(&d.words[start..]);
            let (ray, hit, _) = take_hit(&mut row);
            let bsdf = Bsdf::new(&Surface::at(&scene, &ray, &hit), &scene.textures);
            if let Some(s) = bsdf.sample(
                -ray.dir,
                numbers[0],
                [numbers[1], numbers[2]],
                mode_of(mode),
            ) {
                d.words[start + 10..start + 13].copy_from_slice(&s.wi.to_array().map(f32::to_bits));
            }
        }
    })
}

fn mode_of(word: u32) -> TransportMode {
    if word == 0 {
        TransportMode::Radiance
    } else {
        TransportMode::Importance
    }
}

/// Tolerance of a few roundings of numbers of a few units.
const ROUGHLY: Near = Near::Float {
    absolute: 1e-5,
    relative: 1e-5,
};

/// The surface at a hit, with all effects of textures.
pub const SURFACE: Twin = Twin {
    name: "surface",
    kernel: kernel!(Generation "surface.rgen"),
    scene: many_materials,
    in_words: 13,
    inputs: || {
        let (scene, _) = many_materials();
        RandomInputs::rows(6000, |d, _| put_hit(&scene, d))
    },
    original: |scene, _, row| {
        let (ray, hit, wi) = take_hit(row);
        let s = Surface::at(scene, &ray, &hit);
        row.push(scene.material_of(hit.primitive, NONE));
        row.push(s.emitter);
        row.push(u32::from(s.terminator.is_some()));
        for v in [s.position, s.n_geometric, s.n_shading, s.tangent] {
            row.push_floats(v.to_array());
        }
        row.push_floats(s.uv.first);
        row.push_floats(
            s.terminator
                .map_or(Vec3::ZERO, |o| o.lifted_point)
                .to_array(),
        );
        row.push_floats(s.base_color(&scene.textures).to_array());
        row.push_floats(s.emitted(&scene.textures, -ray.dir).to_array());
        row.push_floats(s.spawn(wi).origin.to_array());
        row.push_floats([coverage(&scene.textures, s.materials[0], s.uv)]);
        row.push(u32::from(is_masked_out(scene, &ray, &hit)));
    },
    near: &[
        SAME, SAME, SAME, CLOSE, CLOSE, CLOSE, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY,
        ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, CLOSE, CLOSE, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY,
        ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, ROUGHLY, SAME,
    ],
    max_outliers: 0.0005,
    why: "positions and colours are sums of three products; normals of thin triangles lose digits \
          to cancellation, and one rounding may decide a mask or a side",
};

const STEEP: Near = Near::Float {
    absolute: 1e-5,
    relative: 2e-3,
};

/// Values and densities of BSDFs.
pub const BSDF: Twin = Twin {
    name: "bsdf",
    kernel: kernel!(Generation "bsdf.rgen"),
    scene: many_materials,
    in_words: 17,
    inputs: scattering,
    original: |scene, _, row| {
        let (ray, hit, wi) = take_hit(row);
        let mode = mode_of(row.word());
        let bsdf = Bsdf::new(&Surface::at(scene, &ray, &hit), &scene.textures);
        let value = bsdf.evaluate(-ray.dir, wi, mode);
        row.push(u32::from(bsdf.has_density()));
        row.push_floats(value.f.to_array());
        row.push_floats([value.pdf_w, value.reverse_pdf_w]);
        row.push_floats(bsdf.eval(-ray.dir, wi, mode).to_array());
        row.push_floats([bsdf.pdf_w(-ray.dir, wi)]);
    },
    near: &[
        SAME, STEEP, STEEP, STEEP, STEEP, STEEP, STEEP, STEEP, STEEP, STEEP,
    ],
    max_outliers: 0.0005,
    why: "in the narrowest lobes one rounding of a direction changes the density by a thousandth, \
          and at grazing angles one rounding decides the side of a direction",
};

const DIRECTION: Near = Near::Float {
    absolute: 2e-4,
    relative: 0.0,
};
const WEIGHT: Near = Near::Float {
    absolute: 1e-3,
    relative: 5e-3,
};

/// Directions sampled from BSDFs.
pub const BSDF_SAMPLE: Twin = Twin {
    name: "bsdf_sample",
    kernel: kernel!(Generation "bsdf_sample.rgen"),
    scene: many_materials,
    in_words: 17,
    inputs: scattering,
    original: |scene, _, row| {
        let (ray, hit, _) = take_hit(row);
        let mode = mode_of(row.word());
        let [u, v, w] = row.floats();
        let bsdf = Bsdf::new(&Surface::at(scene, &ray, &hit), &scene.textures);
        let sample = bsdf.sample(-ray.dir, u, [v, w], mode);
        row.push(u32::from(sample.is_some()));
        row.push(u32::from(sample.is_some_and(|s| s.delta)));
        row.push_floats(sample.map_or(Vec3::ZERO, |s| s.wi).to_array());
        row.push_floats(sample.map_or(Vec3::ZERO, |s| s.weight).to_array());
        row.push_floats(sample.map_or([0.0; 2], |s| [s.pdf_w, s.eta]));
    },
    near: &[
        SAME, SAME, DIRECTION, DIRECTION, DIRECTION, WEIGHT, WEIGHT, WEIGHT, WEIGHT, CLOSE,
    ],
    max_outliers: 0.0005,
    why: "a direction contains the square root of one minus a function of sample numbers: where \
          it is near zero, a rounding error becomes its square root; densities of narrow lobes \
          are steep about the direction",
};
