//! The surfaces that camera rays hit first, as layers show them. A composed material is used as a
//! whole.

use glam::Vec3;

use crate::cpu::bvh::intersect_lanes::load_rays;
use lumbre_light::film::layer::FirstHit;
use lumbre_light::math::real::Vector;
use lumbre_light::math::simd::{F32x8, Lanes, SimdKernel, Width, dispatch, map_array, padded};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::arrival::{Arrival, HitRecord, HitState, SurfaceClass};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::transport::surface::{Surface, SurfaceTraits};

/// First surfaces of the paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(crate) struct FirstHits {
    /// The surface of each path; `None` if it hits nothing.
    found: Vec<Option<FirstHit>>,
    /// The hit of each path; of no meaning if it hits nothing.
    hits: Vec<HitRecord>,
    /// Paths that hit surfaces of each class; empty between tiles.
    by_class: Vec<Vec<u32>>,
}

impl FirstHits {
    /// Removes all surfaces.
    pub fn clear(&mut self) {
        self.found.clear();
    }

    /// Finds the surface of each path, given the rays from the camera and their hits.
    pub fn find(
        &mut self,
        width: Width,
        context: &Context,
        rays: &[(Ray, f32)],
        hits: &[Option<Hit>],
    ) {
        let (scene, classes) = (context.scene, context.classes);
        self.found.resize(rays.len(), None);
        self.hits.resize(rays.len(), HitRecord::default());
        self.by_class.resize_with(classes.count(), Vec::new);
        for (path, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                let hit = HitState::whole(scene, hit);
                self.by_class[classes.index_of(scene, &hit)].push(path as u32);
                [self.hits[path]] = HitRecord::store::<f32, 1>(hit);
            }
        }
        for (class, paths) in self.by_class.iter_mut().enumerate() {
            dispatch(
                width,
                Find {
                    scene,
                    class: &classes[class],
                    paths,
                    rays,
                    hits: &self.hits,
                    found: &mut self.found,
                },
            );
            paths.clear();
        }
    }

    /// Returns the surface of a path; `None` if it hits nothing.
    pub fn of_path(&self, path: usize) -> Option<FirstHit> {
        self.found.get(path).copied().flatten()
    }
}

/// Returns the surface that a sample's camera ray hits, or `None`. Traces the ray again, since
/// techniques without steps do not report it.
pub(super) fn first_hit(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
) -> Option<FirstHit> {
    let scene = context.scene;
    let ray = context.camera.sample_ray(pixel, sampler);
    let hit = context.trace.closest(&ray, f32::INFINITY)?;
    let hit = HitState::whole(scene, &hit);
    let class = &context.classes[context.classes.index_of(scene, &hit)];
    let [found] = surfaces(scene, &Arrival::<f32, 1>::new(class, ray, &hit));
    Some(found)
}

/// Returns the properties of surfaces whose texture coordinates are read, even if no texture needs
/// them.
fn readable(scene: &CompiledScene, traits: SurfaceTraits) -> SurfaceTraits {
    SurfaceTraits {
        uv: true,
        second_uv: !traits.sphere && !scene.second_uvs.is_empty(),
        ..traits
    }
}

/// Kernel that finds the surfaces of one class.
struct Find<'a> {
    scene: &'a CompiledScene,
    class: &'a SurfaceClass,
    paths: &'a [u32],
    rays: &'a [(Ray, f32)],
    hits: &'a [HitRecord],
    found: &'a mut [Option<FirstHit>],
}

impl SimdKernel for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.paths.chunks(N) {
            let paths = map_array(padded::<u32, N>(group), |path| path as usize);
            let (origin, dir, _) = load_rays::<R, N>(&map_array(paths, |i| self.rays[i]));
            let ([x, y, z], [u, v, w]) = (origin, dir);
            let ray = Ray {
                origin: R::Vec3::new(x, y, z),
                dir: R::Vec3::new(u, v, w),
            };
            let hits = HitRecord::load::<R, N>(map_array(paths, |i| &self.hits[i]));
            let found = surfaces(self.scene, &Arrival::new(self.class, ray, &hits));
            for (path, found) in paths.iter().zip(found).take(group.len()) {
                self.found[*path] = Some(found);
            }
        }
    }
}

/// Returns the surfaces at which rays arrive.
#[inline(always)]
fn surfaces<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    arrival: &Arrival<R, N>,
) -> [FirstHit; N] {
    let traits = readable(scene, arrival.class.surface);
    let hits = &arrival.hits;
    let surface = Surface::at_hits(scene, &traits, hits, arrival.materials);
    let albedo = surface.base_color(&scene.textures);
    let behind = surface.n_geometric.dot(hits.dir).gt(R::splat(0.0));
    let normal = R::Vec3::select(behind, -surface.n_shading, surface.n_shading);
    let distance = (hits.origin - surface.position).length();
    let [u, v] = surface.uv.first;
    let (n, p, zero) = (normal, surface.position, R::splat(0.0));
    let looks = R::transpose_store([
        albedo.x(),
        albedo.y(),
        albedo.z(),
        n.x(),
        n.y(),
        n.z(),
        u,
        v,
    ]);
    let places = R::transpose_store([p.x(), p.y(), p.z(), distance, zero, zero, zero, zero]);
    let mut found = [FirstHit::default(); N];
    for (lane, found) in found.iter_mut().enumerate() {
        let F32x8([r, g, b, nx, ny, nz, u, v]) = looks[lane];
        let F32x8([x, y, z, distance, ..]) = places[lane];
        let [shape, primitive] = scene.entity_of(hits.primitives[lane], hits.instances[lane]);
        *found = FirstHit {
            albedo: Vec3::new(r, g, b),
            normal: Vec3::new(nx, ny, nz),
            distance,
            position: scene.described(Vec3::new(x, y, z)),
            uv: [u, v],
            shape,
            primitive,
        };
    }
    found
}
