//! The hierarchy that `shaders/trace/bvh.glsl` walks: eight-wide nodes with compressed boxes [Ylitie et al. 2017, Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs], built by `obvhs` over triangles and spheres alike.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use crate::scene::CompiledScene;

/// Entries of the traversal stack in the shader, one for each level.
const STACK: usize = 32;

/// A scene's hierarchy on a device.
pub struct Bvh {
    /// Nodes, 80 bytes each.
    pub nodes: Buffer,
    /// Primitive ids, in the order in which leaves name them.
    pub primitives: Buffer,
    /// Number of nodes.
    pub node_count: usize,
    /// Seconds spent building.
    pub build_s: f64,
}

impl Bvh {
    /// Builds the hierarchy of a scene and copies it to a device.
    ///
    /// # Errors
    /// When it is too deep for the shader's stack, or does not fit onto the device.
    pub fn new(device: &Arc<Device>, scene: &CompiledScene) -> Result<Bvh, VulkanError> {
        let start = Instant::now();
        let bvh = build(scene);
        let levels = levels(&bvh);
        if levels > STACK {
            return Err(VulkanError::Lacks {
                device: device.info.line(),
                needed: format!("a traversal stack of {levels} entries for this scene's hierarchy; there are {STACK}"),
            });
        }
        let build_s = start.elapsed().as_secs_f64();
        let none = vk::BufferUsageFlags::empty();
        Ok(Bvh {
            nodes: Buffer::with(device, "nodes", bytemuck::cast_slice::<_, [u32; 20]>(&bvh.nodes), none)?,
            primitives: Buffer::with(device, "primitives of leaves", &bvh.primitive_indices, none)?,
            node_count: bvh.nodes.len(),
            build_s,
        })
    }
}

fn build(scene: &CompiledScene) -> CwBvh {
    let spheres = scene.spheres.iter().map(|s| {
        let (c, r) = (Vec3A::from(s.center), Vec3A::splat(s.radius));
        Aabb::new(c - r, c + r)
    });
    let triangles = scene.triangles.iter().map(|t| Aabb::from_points(&t.map(Vec3A::from)));
    let boxes: Vec<Aabb> = triangles.chain(spheres).collect();
    if boxes.is_empty() {
        return CwBvh::default();
    }
    build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
}

/// Levels of nodes. A ray leaves at most one entry on the stack for each.
fn levels(bvh: &CwBvh) -> usize {
    let mut open: Vec<(usize, usize)> = bvh.nodes.first().map(|_| (0, 1)).into_iter().collect();
    let mut deepest = 0;
    while let Some((node, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &bvh.nodes[node];
        let children = node.imask.count_ones() as usize;
        open.extend((0..children).map(|i| (node.child_base_idx as usize + i, level + 1)));
    }
    deepest
}
