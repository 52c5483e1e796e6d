//! Shared parts of the BSDF tests: a grid of materials, and directions from normal to grazing.

use glam::Vec3;
use lumbre_light::math::Frame;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::scene::compile::{
    Distribution, Formulas, Interface, Material, Model, NONE, Uv, diffuse_reflectance,
};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::surface::Surface;
use lumbre_render::lobe::cells::SphereCells;

use crate::common::WHITE;

/// A normal that lies along no axis.
pub const NORMAL: Vec3 = Vec3::new(0.36, 0.48, 0.8);

/// A direction of anisotropy that is not orthogonal to the normal.
const TANGENT: Vec3 = Vec3::new(0.9, -0.2, 0.4);

/// The Disney material with every parameter at its default, and a colour.
pub const DISNEY: Material = Material {
    model: Model::Disney,
    base_color: Vec3::new(0.8, 0.5, 0.2),
    ..WHITE
};

/// Roughness from the narrowest lobe that is not a Dirac to the widest.
pub const ROUGHNESS: [f32; 4] = [0.01, 0.1, 0.5, 1.0];

/// Returns the point of a surface whose shading normal is the geometric one.
pub fn surface(material: &Material) -> Surface<'_> {
    Surface {
        position: Vec3::ZERO,
        n_geometric: NORMAL,
        extent: 1.0,
        n_shading: NORMAL,
        tangent: TANGENT,
        uv: Uv::zero(),
        tint: Vec3::ONE,
        materials: [material],
        emitter: NONE,
        terminator: None,
    }
}

/// Returns the BSDF at that point.
pub fn bsdf(material: &Material) -> Bsdf {
    Bsdf::new(&surface(material), &[])
}

/// Returns a direction by its cosine with the normal and its azimuth.
pub fn direction(cos: f32, azimuth: f32) -> Vec3 {
    let r = (1.0 - cos * cos).sqrt();
    Frame::from_normal(NORMAL).to_world(Vec3::new(r * azimuth.cos(), r * azimuth.sin(), cos))
}

/// Returns normal, oblique and grazing directions, from the front and from behind.
pub fn outgoing() -> [Vec3; 5] {
    [
        direction(1.0, 0.0),
        direction(0.6, 0.7),
        direction(0.06, 2.0),
        direction(-0.7, 4.0),
        direction(-0.15, 5.5),
    ]
}

/// Mixture of the dielectric, refractive and metallic lobes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mix {
    Opaque,
    Metal,
    Glass,
    All,
}

/// Returns six materials of a mixture for every roughness: plain, anisotropic, with a satin coat,
/// with a glossy coat, cloth with an index of refraction below one, and a tinted one with a coat by
/// the formulas of Mitsuba.
pub fn grid(mix: Mix) -> Vec<Material> {
    let [metallic, opacity] = match mix {
        Mix::Opaque => [0.0, 1.0],
        Mix::Metal => [1.0, 1.0],
        Mix::Glass => [0.0, 0.0],
        Mix::All => [0.3, 0.5],
    };
    let mut all = Vec::new();
    for roughness in ROUGHNESS {
        let plain = Material {
            metallic,
            opacity,
            roughness,
            ..DISNEY
        };
        all.push(plain);
        all.push(Material {
            anisotropic: 1.0,
            ior: 2.5,
            ..plain
        });
        all.push(Material {
            clearcoat: 1.0,
            clearcoat_gloss: 0.0,
            anisotropic: 0.6,
            ..plain
        });
        all.push(Material {
            clearcoat: 1.0,
            clearcoat_gloss: 1.0,
            ior: 1.2,
            ..plain
        });
        all.push(Material {
            subsurface: 0.7,
            sheen: 1.0,
            sheen_tint: 0.5,
            specular_tint: 0.8,
            ior: 0.7,
            ..plain
        });
        all.push(Material {
            formulas: Formulas::Mitsuba,
            clearcoat: 1.0,
            clearcoat_gloss: 0.5,
            specular_tint: 0.8,
            ..plain
        });
    }
    all
}

/// Returns the grid for every mixture.
pub fn grids() -> Vec<Material> {
    [Mix::Opaque, Mix::Metal, Mix::Glass, Mix::All]
        .into_iter()
        .flat_map(grid)
        .collect()
}

/// Returns one-sided materials of all models: mixtures that also refract, and opaque ones.
pub fn one_sided() -> Vec<Material> {
    let mut all = grid(Mix::All);
    all.extend(grid(Mix::Opaque).into_iter().step_by(7));
    all.extend(interfaces().into_iter().step_by(5));
    all.extend(sheets().into_iter().filter(|m| m.model == Model::OrenNayar));
    for opacity in [0.4, 1.0] {
        all.push(Material {
            model: Model::Lambert,
            metallic: 0.3,
            opacity,
            ..DISNEY
        });
    }
    all.iter_mut().for_each(|m| m.one_sided = true);
    all
}

/// Returns metals, plastic and glass of both distributions, anisotropic and isotropic. `opacity`
/// has no effect in these models; glass has 0, by which the tests recognise transmission.
pub fn interfaces() -> Vec<Material> {
    let mut all = Vec::new();
    for (distribution, roughness) in [Distribution::Ggx, Distribution::Beckmann]
        .into_iter()
        .flat_map(|d| ROUGHNESS.map(|r| (d, r)))
    {
        let interface = Interface {
            distribution,
            eta: Vec3::new(0.2, 0.92, 1.1),
            k: Vec3::new(3.9, 2.45, 2.14),
            ..Interface::PLAIN
        };
        let plain = Material {
            roughness,
            interface,
            ..DISNEY
        };
        all.push(Material {
            model: Model::Conductor,
            anisotropic: 0.8,
            ..plain
        });
        let internal_reflectance = 1.0 - (1.0 - diffuse_reflectance(1.5)) / 2.25;
        let interface = Interface {
            nonlinear: true,
            internal_reflectance,
            specular: Vec3::splat(0.7),
            ..interface
        };
        let transmittance = [0.3, 1.5, 1.2, 1.0, 0.8, 0.5, 0.3, 0.2, 0.1, 0.1, 0.05, 0.02];
        for transmittance in [None, Some(transmittance)] {
            all.push(Material {
                model: Model::Plastic,
                interface: Interface {
                    transmittance,
                    ..interface
                },
                ..plain
            });
        }
        all.push(Material {
            model: Model::Dielectric,
            opacity: 0.0,
            ..plain
        });
        all.push(Material {
            model: Model::Dielectric,
            opacity: 0.0,
            ior: 0.7,
            ..plain
        });
    }
    all
}

/// Returns diffuse surfaces of all models but `lambert`: translucent sheets of both lobes and of
/// each alone, and rough surfaces.
pub fn sheets() -> Vec<Material> {
    let (reflects, transmits) = (Vec3::new(0.5, 0.3, 0.1), Vec3::new(0.1, 0.2, 0.6));
    let pairs = [
        (reflects, transmits),
        (reflects, Vec3::ZERO),
        (Vec3::ZERO, transmits),
    ];
    let sheet = |(base_color, transmittance)| Material {
        model: Model::Translucent,
        base_color,
        transmittance,
        ior: 1.0,
        ..DISNEY
    };
    let rough = |roughness| Material {
        model: Model::OrenNayar,
        roughness,
        ior: 1.0,
        ..DISNEY
    };
    let sheets = pairs.map(sheet).into_iter();
    sheets.chain([0.0, 0.3, 1.0].map(rough)).collect()
}

/// Returns four numbers in `[0, 1)` for a sample of a test.
pub fn uniform(i: u32, test: u32) -> [f32; 4] {
    pcg4d([i, test, 42, 43]).map(unit)
}

/// Returns the directional albedo of the lobes with a density: the integral of value times cosine
/// for light from `wo`, which refraction does not scale.
pub fn albedo(material: &Material, wo: Vec3) -> [f64; 3] {
    let b = bsdf(material);
    let cells = SphereCells::for_lobes(material, NORMAL, wo).integrate(|wi| {
        (b.eval(wo, wi, TransportMode::Importance) * wi.dot(NORMAL).abs())
            .as_dvec3()
            .to_array()
    });
    std::array::from_fn(|k| cells.iter().map(|c| c[k]).sum())
}
