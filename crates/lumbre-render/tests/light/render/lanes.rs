//! Surfaces, their textures, and lights have the same bits in vectors of every width.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3, Mat3, Vec2, Vec3, Vec4};
use lumbre_light::math::real::{Double, Mask, Vector};
use lumbre_light::math::simd::{Lanes, SimdKernel, Width, dispatch, map_array, padded};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Instance, Instances, Lookup, MaskMode, Material, Model, NONE, RoughnessTexels, SharedMesh,
    Texture, UvMap, Wrap,
};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::integrator::bdpt::weights::LightEnd;
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::ray::{Hit, Ray, RayHits};
use lumbre_light::transport::surface::{ShadingParameters, Surface, SurfaceTraits};

use crate::common::{SceneBuilder, WHITE, grey, light};
use crate::render::lights_density::uniform;
use crate::render::wavefront_fixtures::DISNEY;

/// Number of hits on every primitive: full vectors, and a rest.
const HITS: u32 = 37;

/// Appends the bits of every component.
fn push<R: Lanes<N>, const N: usize>(numbers: &mut Vec<[f32; N]>, vector: R::Vec3) {
    numbers.extend([vector.x().store(), vector.y().store(), vector.z().store()]);
}

/// Returns the bits of the numbers of the first `count` lanes, one list per lane.
fn bits<const N: usize>(numbers: &[[f32; N]], count: usize) -> impl Iterator<Item = Vec<u32>> {
    (0..count).map(move |lane| numbers.iter().map(|row| row[lane].to_bits()).collect())
}

/// Everything that a surface and its material parameters consist of, as bits, for each hit. All
/// hits are on one primitive.
#[derive(Clone, Copy)]
struct Surfaces<'a> {
    scene: &'a CompiledScene,
    hits: &'a [(Ray, Hit)],
}

impl SimdKernel for Surfaces<'_> {
    type Output = Vec<Vec<u32>>;

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) -> Vec<Vec<u32>> {
        let scene = self.scene;
        let (
            _,
            Hit {
                primitive,
                instance,
                ..
            },
        ) = self.hits[0];
        let row = scene.material_of(primitive, instance);
        let traits = SurfaceTraits::new(scene, primitive, instance, row);
        let mut found = Vec::new();
        for group in self.hits.chunks(N) {
            let lanes: [(Ray, Hit); N] = padded(group);
            let vector = |of: fn(&(Ray, Hit)) -> Vec3| {
                let v = map_array(lanes, |lane| of(&lane));
                R::Vec3::new(
                    R::load(&map_array(v, |v| v.x)),
                    R::load(&map_array(v, |v| v.y)),
                    R::load(&map_array(v, |v| v.z)),
                )
            };
            let hits = RayHits::<R, N> {
                origin: vector(|(ray, _)| ray.origin),
                dir: vector(|(ray, _)| ray.dir),
                t: R::load(&map_array(lanes, |(_, hit)| hit.t)),
                uv: [
                    R::load(&map_array(lanes, |(_, hit)| hit.uv[0])),
                    R::load(&map_array(lanes, |(_, hit)| hit.uv[1])),
                ],
                primitives: [primitive; N],
                instances: [instance; N],
            };
            let s = Surface::at_hits(scene, &traits, &hits, [row; N]);
            let p = ShadingParameters::new(&s, &scene.textures, traits.textured);
            let mut numbers = Vec::new();
            for v in [s.position, s.n_geometric, s.n_shading, s.tangent, s.tint] {
                push::<R, N>(&mut numbers, v);
            }
            push::<R, N>(&mut numbers, p.base_color);
            push::<R, N>(&mut numbers, s.emitted(&scene.textures, -hits.dir));
            numbers.extend([p.roughness, p.metallic, p.opacity].map(R::store));
            numbers.push(R::store_words(s.emitter).map(f32::from_bits));
            for dir in [hits.dir, -hits.dir] {
                push::<R, N>(&mut numbers, s.spawn(dir).origin);
            }
            let (one, zero) = (R::splat(1.0), R::splat(0.0));
            if let Some(offset) = s.terminator {
                numbers.push(R::select(offset.exists, one, zero).store());
                let lifted = R::Vec3::select(offset.exists, offset.lifted_point, s.position);
                push::<R, N>(&mut numbers, lifted);
            } else {
                numbers.push(zero.store());
                push::<R, N>(&mut numbers, s.position);
            }
            numbers.push(R::select(s.ends_paths(), one, zero).store());
            found.extend(bits(&numbers, group.len()));
        }
        found
    }
}

/// Returns a map with random texels, repeated, mirrored or clamped.
fn map(i: u32, wrap: [Wrap; 2]) -> Texture {
    let texels: Vec<[f32; 3]> = (0..15)
        .map(|k| [0, 1, 2].map(|c| 0.1 + 0.8 * uniform(k, 40 + 3 * i + c)[0]))
        .collect();
    Texture {
        lookup: Lookup {
            wrap,
            ..Lookup::default()
        },
        ..Texture::new(5, 3, texels)
    }
}

/// Returns materials: plain; with every texture; with a normal map, a bump map, both; with a
/// direction of anisotropy and its map; with a terminator offset; emissive.
fn materials(builder: &mut SceneBuilder) -> [Material; 16] {
    let [a, b, c] = [
        map(0, [Wrap::Repeat; 2]),
        map(1, [Wrap::Mirror, Wrap::Clamp]),
        map(2, [Wrap::Clamp, Wrap::Mirror]),
    ]
    .map(|texture| builder.texture(texture));
    let second = builder.texture(Texture {
        lookup: Lookup {
            second: true,
            map: Some(glam::Affine2::from_angle(0.4)),
            ..Lookup::default()
        },
        ..map(3, [Wrap::Repeat; 2])
    });
    let tiled = Material {
        tiling: UvMap {
            scale: 1.7,
            offset: Vec2::new(0.3, -0.2),
        },
        ..DISNEY
    };
    let textured = Material {
        base_color_texture: a,
        roughness_texture: second,
        metallic_texture: b,
        opacity_texture: c,
        ..tiled
    };
    let sheet = Material {
        model: Model::Translucent,
        transmittance: Vec3::new(0.2, 0.3, 0.4),
        ..tiled
    };
    let bent = Material {
        normal_texture: a,
        normal_strength: 0.7,
        ..tiled
    };
    let bumpy = Material {
        bump_texture: second,
        bump_height: 0.3,
        ..tiled
    };
    let brushed = Material {
        anisotropic: 0.6,
        ..tiled
    };
    [
        DISNEY,
        textured,
        Material {
            roughness_texels: RoughnessTexels::Alpha,
            ..textured
        },
        sheet,
        Material {
            base_color_texture: a,
            ..sheet
        },
        Material {
            transmittance_texture: c,
            ..sheet
        },
        Material {
            model: Model::OrenNayar,
            roughness_texture: c,
            ..tiled
        },
        bent,
        bumpy,
        Material {
            bump_texture: a,
            ..bent
        },
        brushed,
        Material {
            anisotropic_direction: Vec3::new(0.2, 0.5, -0.1),
            ..brushed
        },
        Material {
            anisotropic_texture: b,
            ..brushed
        },
        Material {
            shadow_terminator: true,
            ..DISNEY
        },
        Material {
            emission_texture: a,
            ..light(3.0)
        },
        Material {
            model: Model::Lambert,
            emission: Vec3::ONE,
            ..WHITE
        },
    ]
}

/// Returns a scene with a triangle, two instances of a triangle, and a sphere of each material.
fn surfaces() -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::Z * 5.0, Vec3::ZERO, 60.0);
    let materials = materials(&mut builder);
    for (i, m) in (0u32..).zip(materials) {
        let at = |k: u32| {
            let u = uniform(10 * i + k, 41);
            Vec3::new(u[0], u[1], u[2]) * 4.0 - 2.0
        };
        let uvs = [3, 4, 5].map(|k| at(k).truncate());
        builder = builder.triangle([at(0), at(1), at(2)], uvs, m);
    }
    for m in materials {
        builder = builder.sphere(Vec3::new(0.3, -0.2, 0.5), 0.8, m);
    }
    builder.with(share_triangles).build()
}

/// Gives triangles bent normals, colours, tangents and second texture coordinates, and adds two
/// instances of all of them as one shared mesh.
fn share_triangles(s: &mut CompiledScene) {
    let count = s.triangles.len();
    let random = |i: usize, k: u32| {
        let u = uniform(i as u32, k);
        Vec3::new(u[0], u[1], u[2])
    };
    for (i, normals) in s.normals.make_smooth().iter_mut().enumerate() {
        for (k, n) in normals.iter_mut().enumerate() {
            *n = (*n + 0.6 * (random(i, 50 + k as u32) - 0.5)).normalize_or(*n);
        }
    }
    let corners = |k: u32| (0..count).map(move |i| [0, 1, 2].map(|c| random(i, k + c)));
    s.colors = corners(60).collect();
    s.second_uvs = corners(63).map(|c| c.map(|v| v.truncate() * 3.0)).collect();
    let tangent = |v: Vec3| {
        let sign = if v.x > 0.5 { 1.0 } else { -1.0 };
        (v - 0.5).normalize_or_zero().extend(sign)
    };
    s.tangents = corners(66).map(|c| c.map(tangent)).collect();
    // A triangle without tangents keeps its shading normal.
    s.tangents[2] = [Vec4::ZERO; 3];
    s.triangles.extend_from_within(..);
    s.attributes.extend_from_within(..);
    s.normals.make_smooth().extend_from_within(..);
    s.uvs.extend_from_within(..);
    s.colors.extend_from_within(..);
    s.second_uvs.extend_from_within(..);
    s.tangents.extend_from_within(..);
    let mut emissive = Vec::new();
    for i in count..2 * count {
        s.attributes[i].material = (i - count) as u32;
        if s.attributes[i].emitter != NONE {
            s.attributes[i].emitter = emissive.len() as u32;
            emissive.push(i as u32);
        }
    }
    let linear = DMat3::from_quat(DQuat::from_rotation_x(0.7))
        * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 0.5));
    let first = s.emitters.len() as u32;
    let placements = (0..2u32).map(|i| Instance {
        mesh: 0,
        to_world: DAffine3::from_mat3_translation(linear, DVec3::X * f64::from(i)),
        normal_to_world: Mat3::from_cols_array(
            &linear
                .inverse()
                .transpose()
                .to_cols_array()
                .map(|x| x as f32),
        ),
        materials: i * count as u32,
        emitters: first + i * emissive.len() as u32,
        flattened_start: (1 + i) * count as u32,
    });
    s.instances = Instances {
        placements: placements.collect(),
        // The second instance has the materials in reverse.
        materials: (0..count as u32).chain((0..count as u32).rev()).collect(),
        meshes: vec![SharedMesh {
            triangles: count as u32..2 * count as u32,
            emissive,
        }],
    };
}

/// Returns random hits on a primitive, from both sides.
fn hits_on(primitive: u32, instance: u32) -> Vec<(Ray, Hit)> {
    let hit = |i: u32| {
        let (u, v) = (uniform(i, 70), uniform(i, 71));
        let dir = uniform_sphere([u[0], u[1]]);
        let origin = Vec3::new(u[2], u[3], v[0]) * 3.0 - 1.5;
        let [b, c] = if v[1] + v[2] > 1.0 {
            [1.0 - v[1], 1.0 - v[2]]
        } else {
            [v[1], v[2]]
        };
        let hit = Hit {
            t: 0.1 + v[3],
            primitive,
            instance,
            uv: [b, c],
        };
        (Ray { origin, dir }, hit)
    };
    (0..HITS).map(hit).collect()
}

#[test]
fn surfaces_have_the_same_bits_in_every_width() {
    let scene = surfaces();
    let world = scene.world_triangles() as u32;
    let triangles = scene.triangles.len() as u32;
    let spheres = triangles..scene.primitive_count() as u32;
    let instanced = (0..2).flat_map(|i| (world..triangles).map(move |p| (p, i)));
    let own = (0..world).chain(spheres).map(|p| (p, NONE));
    let mut terminators = 0;
    for (primitive, instance) in own.chain(instanced) {
        let hits = hits_on(primitive, instance);
        let kernel = Surfaces {
            scene: &scene,
            hits: &hits,
        };
        let scalar = dispatch(Width::ONE, kernel);
        for width in Width::all() {
            let found = dispatch(width, kernel);
            for (i, (found, scalar)) in found.iter().zip(&scalar).enumerate() {
                assert_eq!(
                    found,
                    scalar,
                    "{} lanes, primitive {primitive} of {instance}, hit {i}",
                    width.lanes()
                );
            }
        }
        for ((ray, hit), scalar) in hits.iter().zip(&scalar) {
            let s = Surface::at(&scene, ray, hit);
            terminators += usize::from(s.terminator.is_some());
            let start = [s.position, s.n_geometric, s.n_shading, s.tangent, s.tint];
            let start = start.iter().flat_map(|v| v.to_array().map(f32::to_bits));
            assert!(start.eq(scalar[..15].iter().copied()), "{hit:?}");
            let color = s.base_color(&scene.textures).to_array().map(f32::to_bits);
            assert_eq!(color[..], scalar[15..18], "{hit:?}");
        }
    }
    assert!(terminators > 20, "{terminators}");
}

/// Samples of lights, their densities and their emission, as bits, for each row of random numbers.
struct LightSamples<'a> {
    scene: &'a CompiledScene,
    lights: &'a Lights,
    /// Whether the light is selected at random; otherwise each in turn.
    select: bool,
}

impl SimdKernel for LightSamples<'_> {
    type Output = Vec<Vec<u32>>;

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) -> Vec<Vec<u32>> {
        let LightSamples { scene, lights, .. } = self;
        let rows: Vec<u32> = (0..12 * 37).collect();
        let mut found = Vec::new();
        for group in rows.chunks(N) {
            let ids: [u32; N] = padded(group);
            let number = |k: u32, c: usize| R::load(&map_array(ids, |i| uniform(i, k)[c]));
            let (u, v) = (
                [number(80, 0), number(80, 1)],
                [number(80, 2), number(80, 3)],
            );
            let six = R::splat(6.0);
            let three = R::splat(3.0);
            let from = R::Vec3::new(
                number(81, 0) * six - three,
                number(81, 1) * six - three,
                number(81, 2) * six - three,
            );
            let all = R::Mask::splat(true);
            let selected = if self.select {
                lights.select::<R, N>(number(81, 3), all)
            } else {
                let count = lights.count() as u32;
                lights.with_indices::<R, N>(map_array(ids, |i| i % count), all)
            };
            let zero = R::splat(0.0);
            let black = R::Vec3::broadcast(Vec3::ZERO);
            let mut numbers = vec![selected.probability.store()];
            let d = selected.sample_direct(scene, from, u);
            let some = d.arrives();
            numbers.push(R::select(some, d.pdf_w, zero).store());
            numbers.push(R::select(some, d.distance, zero).store());
            for w in [d.wi, d.radiance, d.point.position, d.point.normal] {
                push::<R, N>(&mut numbers, R::Vec3::select(some, w, black));
            }
            let at = [d.point.position, d.point.normal];
            let pdf_w = selected.pdf_direct_w(from, at[0], at[1]);
            numbers.push(R::select(some, pdf_w, zero).store());
            let end = LightEnd::new(&selected, at, -d.wi, [from, d.wi]);
            for term in [end.start, end.direct, end.next] {
                let low = R::select(some, term_as_number::<R, N>(term), zero);
                numbers.push(low.store());
            }
            let e = selected.sample_emission(scene, u, v);
            let some = e.starts();
            numbers.extend([e.pdf_a, e.pdf_w, e.cos].map(|x| R::select(some, x, zero).store()));
            for w in [e.dir, e.radiance, e.point.position, e.point.normal] {
                push::<R, N>(&mut numbers, R::Vec3::select(some, w, black));
            }
            let emitted = selected.emitted(scene, &e.point, e.dir);
            push::<R, N>(&mut numbers, R::Vec3::select(some, emitted, black));
            found.extend(bits(&numbers, group.len()));
        }
        found
    }
}

/// Rounds double-precision numbers.
fn term_as_number<R: Lanes<N>, const N: usize>(term: R::Double) -> R {
    term.single()
}

#[test]
fn lights_have_the_same_bits_in_every_width() {
    let cone = |edge| ConeDesc {
        beam_deg: 25.0,
        cutoff_deg: 70.0,
        edge,
    };
    for sky in [None, Some(map(5, [Wrap::Repeat; 2]))] {
        let mut builder = SceneBuilder::new(Vec3::Z * 5.0, Vec3::ZERO, 60.0);
        let emission_texture = builder.texture(map(4, [Wrap::Repeat; 2]));
        let textured = Material {
            emission_texture,
            mask_texture: emission_texture,
            mask_mode: MaskMode::Blend,
            ..light(4.0)
        };
        let scene = builder
            .quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X, Vec3::Z, light(3.0))
            .quad(Vec3::new(1.0, 2.0, -1.0), Vec3::X, Vec3::Z, textured)
            .quad(Vec3::NEG_Y * 3.0, Vec3::X, Vec3::Y, grey(0.5))
            .sphere(Vec3::new(1.0, 2.0, 3.0), 0.5, textured)
            .sphere(Vec3::new(-1.0, -1.0, 0.0), 0.2, light(9.0))
            .point(Vec3::Y, Vec3::ONE)
            .spot(Vec3::X, Vec3::NEG_Y, Vec3::ONE, cone(ConeEdge::Linear))
            .spot(Vec3::Z, Vec3::NEG_Y, Vec3::ONE, cone(ConeEdge::Smooth))
            .goniometric(Vec3::NEG_X, Vec3::ONE, map(6, [Wrap::Repeat; 2]), 50.0)
            .directional(Vec3::new(0.3, -1.0, 0.2), Vec3::ONE)
            .environment(sky, Vec3::new(0.5, 0.6, 0.7), 30.0)
            .build();
        let lights = Lights::new(&scene);
        for select in [true, false] {
            let samples = || LightSamples {
                scene: &scene,
                lights: &lights,
                select,
            };
            let scalar = dispatch(Width::ONE, samples());
            for width in Width::all() {
                let found = dispatch(width, samples());
                for (i, (found, scalar)) in found.iter().zip(&scalar).enumerate() {
                    assert_eq!(found, scalar, "{} lanes, sample {i}", width.lanes());
                }
            }
        }
    }
}
