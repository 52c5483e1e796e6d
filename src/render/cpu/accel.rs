//! The bounding volume hierarchy of the CPU backend: what it is made of and how it is put together. The loop that runs
//! through it is in `traverse`.
//!
//! A binary tree ([`super::build`]) is collapsed into nodes of eight children whose boxes are tested at once, and leaves
//! of blocks of eight primitives that are tested at once ([`super::wide`]). A mesh that is kept once has a tree of its
//! own, and each of its copies is a leaf of the scene's ([`super::copies`]).

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3A;

use super::build::{self, Bounded};
use super::compressed::Compressed;
use super::copies::{self, Place};
use super::lanes::{Isa, LANES};
use super::wide::{Block, Item, LEAF, Node, Root, Wide};
use crate::render::hierarchy::{AccelSpec, Builder};
use crate::scene::CompiledScene;
use crate::scene::compile::{MAX_PRIMITIVES, NONE};

/// Entries of the traversal stack. A tree of eight-wide nodes needs seven for each level; [`Accel::build`] refuses what
/// does not fit, which only a contrived scene reaches.
pub(super) const STACK: usize = 256;

/// Scenes of no more primitives are one leaf: testing all of them costs less than finding out which.
pub(super) const ONE_LEAF: usize = 5 * LANES;

/// A scene's hierarchy.
pub struct Accel {
    /// The scene whose primitives hits name: without copies where the builder knows none.
    pub(super) scene: Arc<CompiledScene>,
    /// Where rays begin: a node or a leaf, as in [`Node::child`].
    pub(super) root: u32,
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) places: Vec<Place>,
    /// The tree of `obvhs`, where that is to be traversed.
    pub(super) compressed: Option<Compressed>,
    pub(super) masked: bool,
    pub(super) isa: Isa,
    cost: f64,
    /// Seconds spent building.
    pub build_s: f64,
}

/// Why a hierarchy cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unusable {
    /// The traversal stack does not hold it.
    #[error("the scene's hierarchy is {levels} levels deep, more than the traversal stack holds")]
    TooDeep {
        /// Levels of eight-wide nodes.
        levels: usize,
    },
    /// A builder without copies would need a triangle for each of them.
    #[error("without shared meshes the scene has {count} triangles and spheres, more than {MAX_PRIMITIVES}")]
    TooMany {
        /// How many.
        count: usize,
    },
}

impl Accel {
    /// Builds the hierarchy of a scene, to be traversed with the widest vectors that the processor has.
    ///
    /// # Errors
    /// When it is too deep to be traversed.
    pub fn build(scene: Arc<CompiledScene>) -> Result<Accel, Unusable> {
        Accel::build_as(scene, &AccelSpec::default(), Isa::detect())
    }

    /// The same by a builder and for a set of instructions, one of [`Isa::available`]; for another the portable ones are
    /// used. Whatever they are, hits have the same bits: of two at the same distance it is the one with the lesser ids.
    ///
    /// # Errors
    /// When it is too deep to be traversed, or of too many triangles where the builder knows no copies.
    pub fn build_as(scene: Arc<CompiledScene>, spec: &AccelSpec, isa: Isa) -> Result<Accel, Unusable> {
        let start = Instant::now();
        let alone = matches!(spec.builder, Builder::None | Builder::Cwbvh) && !scene.instances.places.is_empty();
        let scene = if alone {
            Arc::new(scene.flattened(MAX_PRIMITIVES).map_err(|count| Unusable::TooMany { count })?)
        } else {
            scene
        };
        let mut accel = Accel {
            masked: scene.materials.iter().any(|m| m.mask_texture != NONE),
            root: LEAF,
            nodes: Vec::new(),
            blocks: Vec::new(),
            places: Vec::new(),
            compressed: None,
            isa: if Isa::available().contains(&isa) { isa } else { Isa::Portable },
            cost: 0.0,
            build_s: 0.0,
            scene,
        };
        if spec.builder == Builder::Cwbvh {
            accel.compress(spec)?;
        } else {
            accel.grow(spec)?;
        }
        accel.build_s = start.elapsed().as_secs_f64();
        Ok(accel)
    }

    fn compress(&mut self, spec: &AccelSpec) -> Result<(), Unusable> {
        let compressed = Compressed::new(&self.scene, spec);
        self.cost = compressed.cost();
        let levels = compressed.levels();
        self.compressed = Some(compressed);
        if levels > Compressed::STACK { Err(Unusable::TooDeep { levels }) } else { Ok(()) }
    }

    fn grow(&mut self, spec: &AccelSpec) -> Result<(), Unusable> {
        let scene = Arc::clone(&self.scene);
        let mut wide = Wide::default();
        let meshes: Vec<Root> = scene
            .instances
            .meshes
            .iter()
            .map(|m| shared(&scene, m.triangles.start, m.triangles.end, spec, &mut wide))
            .collect();
        let mut of = world(&scene);
        let own = of.len();
        for instance in &scene.instances.places {
            let mesh = &meshes[instance.mesh as usize];
            let root = (mesh.index & LEAF == 0).then(|| &wide.nodes[mesh.index as usize]);
            of.push(copies::bounded(instance, mesh, root));
            self.places.push(Place::new(instance, mesh));
        }
        let triangles = scene.world_triangles();
        let item = |i: u32| {
            let i = i as usize;
            if i < triangles {
                Item::Triangle(i as u32, scene.triangles[i])
            } else if i < own {
                Item::Sphere((i - triangles + scene.triangles.len()) as u32)
            } else {
                let place = i - own;
                Item::Copy(place as u32, meshes[scene.instances.places[place].mesh as usize].cost)
            }
        };
        if of.is_empty() {
            return Ok(());
        }
        let max_leaf = if self.places.is_empty() { spec.max_leaf } else { 1 };
        let one_leaf = AccelSpec { builder: Builder::None, ..*spec };
        let spec = if self.places.is_empty() && of.len() <= ONE_LEAF { &one_leaf } else { spec };
        let root = wide.grow(&build::binary(spec, &of, max_leaf), &of, &item);
        let below = self.scene.instances.places.iter().map(|place| meshes[place.mesh as usize].levels).max();
        let levels = root.levels + below.unwrap_or(0);
        // One more for the way back from a copy.
        if levels * (LANES - 1) + 2 > STACK {
            return Err(Unusable::TooDeep { levels });
        }
        (self.root, self.cost) = (root.index, root.cost);
        (self.nodes, self.blocks) = (wide.nodes, wide.blocks);
        Ok(())
    }

    /// Whether every ray is tested with every primitive.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn is_one_leaf(&self) -> bool {
        self.root & LEAF != 0 && self.places.is_empty() && self.compressed.is_none()
    }

    /// Number of eight-wide nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len() + self.compressed.as_ref().map_or(0, Compressed::node_count)
    }

    /// Bytes of nodes, primitives and copies as traversal reads them.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.places.as_slice())
            + self.compressed.as_ref().map_or(0, |c| c.bytes(&self.scene))
    }

    /// What the surface area heuristic says that a ray costs which meets the scene's box: the nodes that it visits plus the
    /// primitives that it is tested with.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// The instructions that traverse it.
    pub fn isa(&self) -> Isa {
        self.isa
    }
}

/// What stands in the world for itself: triangles, then spheres.
pub(in crate::render) fn world(scene: &CompiledScene) -> Vec<Bounded> {
    let triangles = scene.triangles[..scene.world_triangles()].iter().map(Bounded::triangle);
    let spheres = scene.spheres.iter().map(|s| {
        let (c, r) = (Vec3A::from(s.center), Vec3A::splat(s.radius));
        Bounded::boxed(c - r, c + r)
    });
    triangles.chain(spheres).collect()
}

/// The tree of a shared mesh.
fn shared(scene: &CompiledScene, start: u32, end: u32, spec: &AccelSpec, wide: &mut Wide) -> Root {
    let triangles = &scene.triangles[start as usize..end as usize];
    let of: Vec<Bounded> = triangles.iter().map(Bounded::triangle).collect();
    let item = |i: u32| Item::Triangle(start + i, triangles[i as usize]);
    wide.grow(&build::binary(spec, &of, spec.max_leaf), &of, &item)
}
