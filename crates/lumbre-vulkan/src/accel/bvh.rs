//! Device BVHs that `shaders/trace/bvh.glsl` traverses: eight-wide nodes with compressed boxes
//! [Ylitie et al. 2017, Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs],
//! built according to a run's `accel`. The scene's tree covers triangles outside instances, spheres
//! and the boxes of instances; each shared mesh has a tree of its own, in its own space. All trees
//! are stored in the same arrays, the scene's first.

use std::sync::Arc;
use std::time::Instant;

use ash::vk;
use glam::Vec3;

use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout;
use crate::layout::BVH_STACK;
use crate::memory::buffer::Buffer;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Instance;
use lumbre_render::cpu::bvh::accel::world_primitives;
use lumbre_render::cpu::bvh::build_primitive::BuildPrimitive;
use lumbre_render::cpu::bvh::packed;
use lumbre_render::cpu::bvh::packed::{CwBvh, CwBvhNode, build_packed};
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::instance_transform;
use lumbre_render::instance_transform::InstanceTransform;

/// BVHs of a scene on a device.
pub struct DeviceBvh {
    /// Nodes of all trees, 80 bytes each.
    pub nodes: Buffer,
    /// Primitive indices, in the order in which leaves refer to them.
    pub primitives: Buffer,
    /// Transforms of rays into the spaces of instances.
    pub transforms: Buffer,
    /// Number of nodes of all trees.
    pub node_count: usize,
    /// Expected cost of a ray that meets the scene's box, by the surface area heuristic.
    pub cost: f64,
    /// Build time in seconds.
    pub build_s: f64,
}

impl DeviceBvh {
    /// Builds the BVHs of a scene and copies them to a device.
    ///
    /// # Errors
    /// Returns an error if they are too deep for the shader's stack, or do not fit onto the device.
    pub fn new(
        device: &Arc<Device>,
        scene: &CompiledScene,
        spec: &AccelSpec,
    ) -> Result<DeviceBvh, VulkanError> {
        let start = Instant::now();
        let fits = |trees: &SceneTrees| trees.stack <= BVH_STACK as usize;
        let mut trees = SceneTrees::new(scene, spec);
        if let Some(shallow) = spec.shallow().filter(|_| !fits(&trees)) {
            trees = SceneTrees::new(scene, &shallow);
        }
        if !fits(&trees) {
            let needed = format!(
                "this scene's BVH: it needs a traversal stack of {} entries (at most {BVH_STACK})",
                trees.stack
            );
            return Err(VulkanError::Lacks {
                device: device.info.line(),
                needed,
            });
        }
        let build_s = start.elapsed().as_secs_f64();
        let none = vk::BufferUsageFlags::empty();
        Ok(DeviceBvh {
            nodes: Buffer::with(
                device,
                "nodes",
                bytemuck::cast_slice::<_, [u32; 20]>(&trees.nodes),
                none,
            )?,
            primitives: Buffer::with(device, "leaf primitives", &trees.primitives, none)?,
            transforms: Buffer::with(device, "instance transforms", &trees.transforms, none)?,
            node_count: trees.nodes.len(),
            cost: trees.cost,
            build_s,
        })
    }

    /// Returns their size on the device in bytes.
    pub fn bytes(&self) -> u64 {
        self.nodes.size + self.primitives.size + self.transforms.size
    }
}

/// BVHs of a scene in the device's format, on the host.
#[derive(Default)]
struct SceneTrees {
    nodes: Vec<CwBvhNode>,
    primitives: Vec<u32>,
    transforms: Vec<layout::InstanceTransform>,
    /// Maximum number of stack entries of a ray.
    stack: usize,
    cost: f64,
}

impl SceneTrees {
    fn new(scene: &CompiledScene, spec: &AccelSpec) -> SceneTrees {
        let placements = &scene.instances.placements;
        let mut trees = SceneTrees::default();
        let triangles = scene.world_triangles();
        let mut primitives = world_primitives(scene);
        let in_world = primitives.len();
        let meshes: Vec<CwBvh> = scene
            .instances
            .meshes
            .iter()
            .map(|mesh| {
                let (start, end) = (mesh.triangles.start as usize, mesh.triangles.end as usize);
                let triangles = &scene.triangles[start..end];
                let boxes: Vec<_> = triangles.iter().map(BuildPrimitive::triangle).collect();
                build_packed(spec, triangles, &boxes, spec.max_leaf)
            })
            .collect();
        primitives.extend(placements.iter().map(|placement| {
            let first = meshes[placement.mesh as usize].nodes.first();
            let [low, high] =
                instance_transform::world_bounds(placement, first.into_iter().flat_map(children));
            BuildPrimitive::from_box(low.into(), high.into())
        }));
        // An instance is expensive to enter, so each has its own box.
        let flat = placements.is_empty();
        let max_leaf = if flat { spec.max_leaf } else { 1 };
        let top = build_packed(spec, &scene.triangles[..triangles], &primitives, max_leaf);
        trees.stack = packed::levels(&top);
        let costs: Vec<f64> = meshes
            .iter()
            .map(|mesh| packed::cost(mesh, |_| 1.0))
            .collect();
        trees.cost = packed::cost(&top, |i| match (i as usize).checked_sub(in_world) {
            Some(placement) => costs[placements[placement].mesh as usize],
            None => 1.0,
        });
        // Primitive indices count all triangles, including those of shared meshes, then spheres,
        // then instances.
        trees.push(&top, |i| {
            if (i as usize) < triangles {
                i
            } else {
                i - triangles as u32 + scene.triangles.len() as u32
            }
        });
        let roots: Vec<u32> = (meshes.iter().zip(&scene.instances.meshes))
            .map(|(tree, mesh)| trees.push(tree, |i| i + mesh.triangles.start))
            .collect();
        if let Some(deepest) = meshes.iter().map(packed::levels).max() {
            // One entry for the rest of the instance's leaf, and one to return to world space.
            trees.stack += 2 + deepest;
        }
        trees.transforms = placements
            .iter()
            .map(|placement| {
                let mesh = placement.mesh as usize;
                instance_transform_row(placement, &meshes[mesh], roots[mesh])
            })
            .collect();
        trees
    }

    /// Appends a tree, mapping its primitives to their indices in the scene. Returns its first
    /// node.
    fn push(&mut self, tree: &CwBvh, id: impl Fn(u32) -> u32) -> u32 {
        let (first, primitives) = (self.nodes.len() as u32, self.primitives.len() as u32);
        self.nodes.extend(tree.nodes.iter().map(|node| CwBvhNode {
            child_base_idx: node.child_base_idx + first,
            primitive_base_idx: node.primitive_base_idx + primitives,
            ..*node
        }));
        self.primitives
            .extend(tree.primitive_indices.iter().map(|i| id(*i)));
        first
    }
}

/// Returns the transform of an instance of a mesh, whose tree begins at `root`.
fn instance_transform_row(
    instance: &Instance,
    mesh: &CwBvh,
    root: u32,
) -> layout::InstanceTransform {
    let aabb = mesh.total_aabb;
    let InstanceTransform { inverse, pivot } =
        InstanceTransform::new(instance, [aabb.min.into(), aabb.max.into()]);
    layout::InstanceTransform {
        inverse_x: inverse.x_axis.into(),
        inverse_y: inverse.y_axis.into(),
        inverse_z: inverse.z_axis.into(),
        pivot_world: pivot[0].into(),
        pivot_own: pivot[1].into(),
        root,
    }
}

/// Iterates over the boxes of a node's children.
fn children(node: &CwBvhNode) -> impl Iterator<Item = [Vec3; 2]> + '_ {
    let there = (0..8).filter(|child| !node.is_child_empty(*child));
    there
        .map(|child| node.child_aabb(child))
        .map(|aabb| [aabb.min.into(), aabb.max.into()])
}
