//! The hierarchies that `shaders/trace/bvh.glsl` walks: eight-wide nodes with compressed boxes [Ylitie et al. 2017, Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs], built as a run's `accel` says. One stands over the triangles that are no
//! copies, over spheres and over the boxes of copies; a mesh that stands in many places has one of its own, in its own space.
//! All lie behind one another in the same arrays, the scene's first.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;
use glam::Vec3;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::node::CwBvhNode;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use super::layout::{self, BVH_STACK};
use crate::render::cpu::accel::world;
use crate::render::cpu::build::Bounded;
use crate::render::cpu::packed::{cost, levels, packed};
use crate::render::entrance::{self, Entrance};
use crate::render::hierarchy::AccelSpec;
use crate::scene::CompiledScene;

/// A scene's hierarchies on a device.
pub struct Bvh {
    /// Nodes, 80 bytes each.
    pub nodes: Buffer,
    /// Primitive ids, in the order in which leaves name them.
    pub primitives: Buffer,
    /// How rays enter copies.
    pub entrances: Buffer,
    /// Number of nodes.
    pub node_count: usize,
    /// What a ray costs that meets the scene's box, by the surface area heuristic.
    pub cost: f64,
    /// Seconds spent building.
    pub build_s: f64,
}

impl Bvh {
    /// Builds the hierarchies of a scene and copies them to a device.
    ///
    /// # Errors
    /// When they are too deep for the shader's stack, or do not fit onto the device.
    pub fn new(device: &Arc<Device>, scene: &CompiledScene, spec: &AccelSpec) -> Result<Bvh, VulkanError> {
        let start = Instant::now();
        let trees = Trees::new(scene, spec);
        if trees.stack > BVH_STACK as usize {
            let needed = format!(
                "a traversal stack of {} entries for this scene's hierarchy; there are {BVH_STACK}",
                trees.stack
            );
            return Err(VulkanError::Lacks { device: device.info.line(), needed });
        }
        let build_s = start.elapsed().as_secs_f64();
        let none = vk::BufferUsageFlags::empty();
        Ok(Bvh {
            nodes: Buffer::with(device, "nodes", bytemuck::cast_slice::<_, [u32; 20]>(&trees.nodes), none)?,
            primitives: Buffer::with(device, "primitives of leaves", &trees.primitives, none)?,
            entrances: Buffer::with(device, "entrances of copies", &trees.entrances, none)?,
            node_count: trees.nodes.len(),
            cost: trees.cost,
            build_s,
        })
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.nodes.size + self.primitives.size + self.entrances.size
    }
}

/// The hierarchies of a scene as the device is to have them.
#[derive(Default)]
struct Trees {
    nodes: Vec<CwBvhNode>,
    primitives: Vec<u32>,
    entrances: Vec<layout::Entrance>,
    /// The most entries that a ray has on the stack.
    stack: usize,
    cost: f64,
}

impl Trees {
    fn new(scene: &CompiledScene, spec: &AccelSpec) -> Trees {
        let places = &scene.instances.places;
        let mut trees = Trees::default();
        let triangles = scene.world_triangles();
        let mut of = world(scene);
        let own = of.len();
        let meshes: Vec<CwBvh> = scene
            .instances
            .meshes
            .iter()
            .map(|mesh| {
                let own = &scene.triangles[mesh.triangles.start as usize..mesh.triangles.end as usize];
                packed(spec, &own.iter().map(Bounded::triangle).collect::<Vec<_>>(), spec.max_leaf)
            })
            .collect();
        of.extend(places.iter().map(|place| {
            let first = meshes[place.mesh as usize].nodes.first();
            let [low, high] = entrance::bounds(place, first.into_iter().flat_map(children));
            Bounded::boxed(low.into(), high.into())
        }));
        // A copy is dear to enter: each has its own box.
        let top = packed(spec, &of, if places.is_empty() { spec.max_leaf } else { 1 });
        trees.stack = levels(&top);
        let costs: Vec<f64> = meshes.iter().map(|mesh| cost(mesh, |_| 1.0)).collect();
        trees.cost = cost(&top, |i| match (i as usize).checked_sub(own) {
            Some(place) => costs[places[place].mesh as usize],
            None => 1.0,
        });
        // Ids count all triangles, those of shared meshes too, then spheres, then copies.
        trees.push(&top, |i| {
            if (i as usize) < triangles { i } else { i - triangles as u32 + scene.triangles.len() as u32 }
        });
        let roots: Vec<u32> = (meshes.iter().zip(&scene.instances.meshes))
            .map(|(tree, mesh)| trees.push(tree, |i| i + mesh.triangles.start))
            .collect();
        if let Some(deepest) = meshes.iter().map(levels).max() {
            // What waits beside a copy in its leaf, and the way back to the world.
            trees.stack += 2 + deepest;
        }
        trees.entrances = places
            .iter()
            .map(|place| {
                let aabb = meshes[place.mesh as usize].total_aabb;
                let Entrance { inverse, pivot } = Entrance::new(place, [aabb.min.into(), aabb.max.into()]);
                layout::Entrance {
                    inverse_x: inverse.x_axis.into(),
                    inverse_y: inverse.y_axis.into(),
                    inverse_z: inverse.z_axis.into(),
                    pivot_world: pivot[0].into(),
                    pivot_own: pivot[1].into(),
                    root: roots[place.mesh as usize],
                }
            })
            .collect();
        trees
    }

    /// Puts a tree behind the others, its primitives under their ids in the scene. Returns its first node.
    fn push(&mut self, tree: &CwBvh, id: impl Fn(u32) -> u32) -> u32 {
        let (first, primitives) = (self.nodes.len() as u32, self.primitives.len() as u32);
        self.nodes.extend(tree.nodes.iter().map(|node| CwBvhNode {
            child_base_idx: node.child_base_idx + first,
            primitive_base_idx: node.primitive_base_idx + primitives,
            ..*node
        }));
        self.primitives.extend(tree.primitive_indices.iter().map(|i| id(*i)));
        first
    }
}

/// The boxes of the children of a node.
fn children(node: &CwBvhNode) -> impl Iterator<Item = [Vec3; 2]> + '_ {
    let there = (0..8).filter(|child| !node.is_child_empty(*child));
    there.map(|child| node.child_aabb(child)).map(|aabb| [aabb.min.into(), aabb.max.into()])
}
