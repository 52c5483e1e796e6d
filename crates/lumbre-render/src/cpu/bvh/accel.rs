//! Builds and owns the hierarchy of a scene. The traversal loop is in [`super::traverse`].
//!
//! A binary tree ([`super::build`]) is collapsed into nodes of eight children and blocks of eight
//! primitives, which are tested at once ([`super::bvh8`]). A shared mesh has a tree of its own, and
//! each of its instances is a leaf of the scene's tree ([`super::instances`]). The builder `cwbvh`
//! uses [`super::packed`] and [`super::compressed`] instead.
//!
//! Invariants: the tree is shallow enough for the traversal stack, and the instruction set is one
//! that the processor has.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3A;

use super::build_primitive::BuildPrimitive;
use super::bvh8::{Block, BuildItem, Bvh8, INSTANCE, LEAF, Node, TreeRoot};
use super::chunks::TreeItems;
use super::compressed;
use super::instances;
use super::instances::MeshInstance;
use super::packed;
use super::packed::{CwBvh, build_packed};
use super::progress::BuildProgress;
use super::simd::{Isa, LANES};
use crate::hierarchy::{AccelSpec, Builder};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{MAX_PRIMITIVES, NONE};

/// Number of entries of the traversal stack. A tree of eight-wide nodes needs seven per level, so
/// 36 levels fit; [`Accel::build`] rejects deeper trees.
pub(crate) const STACK: usize = 256;

/// Hierarchy of a scene.
pub struct Accel {
    /// Scene that primitive indices of hits refer to: flattened if the builder does not support
    /// instances.
    pub(crate) scene: Arc<CompiledScene>,
    /// Settings with which the tree was built.
    pub(crate) spec: AccelSpec,
    /// Root node or leaf, as in [`Node::child`].
    pub(crate) root: u32,
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) instances: Vec<MeshInstance>,
    /// Compressed tree, which is traversed instead of `nodes` if the builder is `cwbvh`.
    pub(crate) compressed: Option<CwBvh>,
    /// Whether any material has a mask.
    pub(crate) masked: bool,
    /// Instruction set that traversal uses.
    pub(crate) isa: Isa,
    /// Result of [`Accel::cost`].
    cost: f64,
    /// Time to build the hierarchy, in seconds.
    pub build_s: f64,
}

/// Reason why a hierarchy cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccelError {
    /// The tree is deeper than the traversal stack allows.
    #[error(
        "the scene's hierarchy is {levels} levels deep, more than the traversal stack allows; set \
         `builder = \"median\"` or a lower `max_depth` in `accel`"
    )]
    TooDeep {
        /// Number of levels of eight-wide nodes.
        levels: usize,
    },
    /// The builder does not support instances, and the flattened scene has too many primitives.
    #[error(
        "this `accel` builder does not support instances, and without them the scene has {count} \
         triangles and spheres, more than {MAX_PRIMITIVES}"
    )]
    TooMany {
        /// Number of triangles and spheres of the flattened scene.
        count: usize,
    },
}

impl Accel {
    /// Builds the hierarchy of a scene with the default settings, for the widest instruction set of
    /// the processor.
    ///
    /// # Errors
    /// Returns an error if the tree is too deep for the traversal stack.
    pub fn build(scene: Arc<CompiledScene>) -> Result<Accel, AccelError> {
        Accel::build_as(scene, &AccelSpec::default(), Isa::detect())
    }

    /// Builds the hierarchy of a scene with the given settings, or with [`AccelSpec::shallow`] if
    /// its tree is too deep for the traversal stack. `isa` should be one of
    /// [`Isa::available`]; any other is replaced by the portable one. Hits have the same bits with
    /// all of them.
    ///
    /// # Errors
    /// Returns an error if the tree is too deep for the traversal stack and there is no shallow one,
    /// or the flattened scene has too many primitives.
    pub fn build_as(
        scene: Arc<CompiledScene>,
        spec: &AccelSpec,
        isa: Isa,
    ) -> Result<Accel, AccelError> {
        let start = Instant::now();
        let progress = BuildProgress::default();
        let log = |line: &str| tracing::info!("{line}");
        let built = progress.watch(scene.primitive_count(), &log, || {
            match (
                Accel::build_tree(&scene, spec, isa, &progress),
                spec.shallow(),
            ) {
                (Err(AccelError::TooDeep { .. }), Some(shallow)) => {
                    Accel::build_tree(&scene, &shallow, isa, &progress)
                }
                (built, _) => built,
            }
        });
        let mut accel = built?;
        accel.build_s = start.elapsed().as_secs_f64();
        Ok(accel)
    }

    /// Builds the hierarchy with exactly these settings.
    fn build_tree(
        scene: &Arc<CompiledScene>,
        spec: &AccelSpec,
        isa: Isa,
        progress: &BuildProgress,
    ) -> Result<Accel, AccelError> {
        let flatten = matches!(spec.builder, Builder::None | Builder::Cwbvh)
            && !scene.instances.placements.is_empty();
        let scene = if flatten {
            Arc::new(
                scene
                    .flattened(MAX_PRIMITIVES)
                    .map_err(|count| AccelError::TooMany { count })?,
            )
        } else {
            Arc::clone(scene)
        };
        let mut accel = Accel {
            spec: *spec,
            masked: scene.materials.iter().any(|m| m.mask_texture != NONE),
            root: LEAF,
            nodes: Vec::new(),
            blocks: Vec::new(),
            instances: Vec::new(),
            compressed: None,
            isa: if Isa::available().contains(&isa) {
                isa
            } else {
                Isa::Portable
            },
            cost: 0.0,
            build_s: 0.0,
            scene,
        };
        if spec.builder == Builder::Cwbvh {
            progress.begin("compressed nodes");
            accel.build_compressed(spec)?;
        } else {
            accel.build_bvh8(spec, progress)?;
        }
        Ok(accel)
    }

    fn build_compressed(&mut self, spec: &AccelSpec) -> Result<(), AccelError> {
        let triangles = &self.scene.triangles[..self.scene.world_triangles()];
        let primitives = world_primitives(&self.scene);
        let tree = build_packed(spec, triangles, &primitives, spec.max_leaf);
        self.cost = packed::cost(&tree, |_| 1.0);
        let levels = packed::levels(&tree);
        self.compressed = Some(tree);
        if levels > compressed::MAX_LEVELS {
            Err(AccelError::TooDeep { levels })
        } else {
            Ok(())
        }
    }

    fn build_bvh8(&mut self, spec: &AccelSpec, progress: &BuildProgress) -> Result<(), AccelError> {
        let scene = Arc::clone(&self.scene);
        progress.begin("trees of shared meshes");
        let mut bvh8 = Bvh8::default();
        let meshes: Vec<TreeRoot> = scene
            .instances
            .meshes
            .iter()
            .map(|m| build_mesh(&scene, m.triangles.start, m.triangles.end, spec, &mut bvh8))
            .collect();
        let mut others: Vec<BuildPrimitive> = sphere_boxes(&scene).collect();
        for instance in &scene.instances.placements {
            let mesh = &meshes[instance.mesh as usize];
            let root = (mesh.index & LEAF == 0).then(|| &bvh8.nodes[mesh.index as usize]);
            others.push(instances::instance_bounds(instance, mesh, root));
            self.instances.push(MeshInstance::new(instance, mesh));
        }
        let triangles = &scene.triangles[..scene.world_triangles()];
        let item = |i: u32| {
            let i = i as usize;
            let Some(other) = i.checked_sub(triangles.len()) else {
                return BuildItem::Triangle(i as u32, triangles[i]);
            };
            match other.checked_sub(scene.spheres.len()) {
                None => BuildItem::Sphere((other + scene.triangles.len()) as u32),
                Some(instance) => BuildItem::Tree(
                    LEAF | INSTANCE | instance as u32,
                    meshes[scene.instances.placements[instance].mesh as usize].cost,
                ),
            }
        };
        let items = TreeItems {
            triangles,
            others: &others,
            item: &item,
        };
        if items.len() == 0 {
            return Ok(());
        }
        let one_leaf = self.instances.is_empty() && items.len() <= self.isa.one_leaf();
        let spec = top_level_spec(spec, self.instances.is_empty(), one_leaf);
        progress.begin("the tree of the scene");
        let root = items.add_to(&mut bvh8, &spec);
        let mesh_levels = self
            .scene
            .instances
            .placements
            .iter()
            .map(|place| meshes[place.mesh as usize].levels)
            .max();
        let levels = root.levels + mesh_levels.unwrap_or(0);
        // One more entry to return from an instance.
        if levels * (LANES - 1) + 2 > STACK {
            return Err(AccelError::TooDeep { levels });
        }
        (self.root, self.cost) = (root.index, root.cost);
        (self.nodes, self.blocks) = (bvh8.nodes, bvh8.blocks);
        if self.masked {
            self.mark_masked();
        }
        Ok(())
    }

    /// Marks the primitives whose material has a mask. The material of an instanced primitive
    /// depends on the instance, so all of those are marked.
    fn mark_masked(&mut self) {
        let scene = &self.scene;
        let instanced = scene.world_triangles()..scene.triangles.len();
        let has_mask = |primitive: u32| {
            let row = scene.material_of(primitive, NONE);
            scene.materials[row as usize].mask_texture != NONE
        };
        for block in &mut self.blocks {
            let occupied = block.primitives.iter().enumerate();
            block.masked = occupied
                .filter(|(_, primitive)| **primitive != NONE)
                .filter(|(_, i)| instanced.contains(&(**i as usize)) || has_mask(**i))
                .map(|(lane, _)| 1 << lane)
                .sum();
        }
    }

    /// Returns whether the hierarchy is a single leaf, so that every ray is tested with every
    /// primitive.
    pub(crate) fn is_one_leaf(&self) -> bool {
        self.root & LEAF != 0 && self.instances.is_empty() && self.compressed.is_none()
    }

    /// Returns the number of eight-wide nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len() + self.compressed.as_ref().map_or(0, |tree| tree.nodes.len())
    }

    /// Returns the size in bytes of the nodes, primitives and instances that traversal reads.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.instances.as_slice())
            + self.compressed.as_ref().map_or(0, |tree| {
                packed::bytes(tree)
                    + size_of_val(self.scene.triangles.as_slice())
                    + size_of_val(self.scene.spheres.as_slice())
            })
    }

    /// Returns the expected cost of a ray that meets the scene's box, by the surface area
    /// heuristic: visited nodes plus tested primitives.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// Returns the instruction set that traversal uses.
    pub fn isa(&self) -> Isa {
        self.isa
    }
}

/// Returns the boxes and centroids of the primitives outside instances: triangles, then spheres.
pub fn world_primitives(scene: &CompiledScene) -> Vec<BuildPrimitive> {
    let triangles = scene.triangles[..scene.world_triangles()]
        .iter()
        .map(BuildPrimitive::triangle);
    triangles.chain(sphere_boxes(scene)).collect()
}

/// Returns the boxes and centroids of the spheres.
fn sphere_boxes(scene: &CompiledScene) -> impl Iterator<Item = BuildPrimitive> {
    scene.spheres.iter().map(|s| {
        let (c, r) = (Vec3A::from(s.center), Vec3A::splat(s.radius));
        BuildPrimitive::from_box(c - r, c + r)
    })
}

/// Returns the settings of the scene's own tree, which may be a single leaf. With instances, every
/// leaf has one primitive or instance.
fn top_level_spec(spec: &AccelSpec, without_instances: bool, one_leaf: bool) -> AccelSpec {
    AccelSpec {
        builder: if one_leaf {
            Builder::None
        } else {
            spec.builder
        },
        max_leaf: if without_instances { spec.max_leaf } else { 1 },
        ..*spec
    }
}

/// Builds the tree of a shared mesh, whose triangles are `start..end`.
fn build_mesh(
    scene: &CompiledScene,
    start: u32,
    end: u32,
    spec: &AccelSpec,
    bvh8: &mut Bvh8,
) -> TreeRoot {
    let triangles = &scene.triangles[start as usize..end as usize];
    let items = TreeItems {
        triangles,
        others: &[],
        item: &|i| BuildItem::Triangle(start + i, triangles[i as usize]),
    };
    items.add_to(bvh8, spec)
}
