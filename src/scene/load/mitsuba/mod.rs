//! Scenes of Mitsuba 3 in XML; names of Mitsuba 0.5 and 0.6 (`toWorld`, `intIOR`) mean the same.
//!
//! Conventions, as far as they decide a picture:
//! - A camera looks along the +z axis of its `to_world` with +y up. `fov` is horizontal unless `fov_axis` says otherwise.
//! - `max_depth` counts path edges; -1 is the most that there are here. Integrator, sampler and filter are the script's.
//! - Meshes without normals get smooth ones, unless `face_normals`; the front of a face with normals is their side.
//! - Texture coordinates start at the top left of a picture; those of OBJ files at the bottom left.
//! - Area lights shine on their front side and reflect by their surface.
//! - `dielectric`, `conductor`, `plastic` and their rough forms are materials of those models; `diffuse` is `lambert`.
//!
//! What is read of each plugin stands in `docs/formats.md`; all else becomes a [`Note`].

mod bsdf;
mod delay;
mod emitter;
mod metals;
mod reads;
mod sensor;
mod shape;
mod texture;
mod tree;
mod values;

pub(super) use self::reads::READS;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{Affine3A, DAffine3, Mat3A, Vec3A};

use self::shape::{Meshes, Placed};
use self::texture::Textures;
use self::tree::{Item, Object};
use super::{Missing, bare, scn};
use crate::scene::desc::{EntityDesc, EnvironmentDesc, LightDesc, MAX_EDGES, MaterialDesc, SceneDesc, Transform};
use crate::scene::names::Names;
use crate::scene::{Note, SceneError};

/// The resolution of a film that says none.
const DEFAULT_FILM: [u32; 2] = [768, 576];

/// How many entities instances may make whatever the size of the file; one more for each byte of it.
const SMALL_ENTITIES: usize = 4096;

/// Whether the first bytes of a file look like a scene in XML.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head);
    head.contains("<scene") && head.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}

/// Reads a scene and everything that it names.
pub(super) fn load(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let (root, bytes) = tree::scene(path, &mut notes)?;
    if root.class != "scene" {
        return Err(root.error(format!("expected <scene>, found <{}>", values::shorten(&root.class))));
    }
    let builder = Builder {
        textures: Textures::new(missing),
        meshes: Meshes::default(),
        surfaces: BTreeMap::new(),
        materials: Vec::new(),
        entities: Vec::new(),
        lights: Vec::new(),
        environment: None,
        names: Names::default(),
        notes,
        most: bytes.saturating_add(SMALL_ENTITIES),
    };
    builder.scene(&root)
}

/// The path of a file that an object names.
fn beside(o: &Object, file: &str) -> PathBuf {
    o.file.parent().unwrap_or(Path::new("")).join(file.replace('\\', "/"))
}

/// In single precision.
fn affine(map: &DAffine3) -> Affine3A {
    Affine3A { matrix3: Mat3A::from(map.matrix3.as_mat3()), translation: Vec3A::from(map.translation.as_vec3()) }
}

struct Builder {
    textures: Textures,
    meshes: Meshes,
    /// Material and map of texture coordinates by surface, told apart by its address.
    surfaces: BTreeMap<*const Object, String>,
    materials: Vec<MaterialDesc>,
    entities: Vec<EntityDesc>,
    lights: Vec<LightDesc>,
    environment: Option<EnvironmentDesc>,
    names: Names,
    notes: Vec<Note>,
    /// Entities that there may be.
    most: usize,
}

impl Builder {
    fn scene(mut self, root: &Rc<Object>) -> Result<(SceneDesc, Vec<Note>), SceneError> {
        root.known(&["version"]);
        // Surfaces first and in the order of the file, so that their names stay what their ids are.
        for o in root.children("bsdf") {
            self.surface(o, None)?;
        }
        for o in root.children("shape") {
            self.shape(o, &DAffine3::IDENTITY, 0)?;
        }
        for o in root.children("emitter") {
            self.emitter(o)?;
        }
        // Textures with an id are read where they are named.
        root.children("texture").for_each(drop);
        let (camera, resolution) = match root.children("sensor").next() {
            Some(o) => sensor::read(o, &mut self.notes)?,
            None => {
                self.notes.push(root.note("it has no sensor: a camera that frames the origin is used"));
                (bare::framing_camera(None), DEFAULT_FILM)
            }
        };
        if let Some(second) = root.children("sensor").nth(1) {
            self.notes.push(second.note("the first sensor is used: this one is left out"));
        }
        let max_depth = match root.children("integrator").next() {
            None => scn::DEFAULT_MAX_DEPTH,
            Some(o) => self.max_depth(o)?,
        };
        let mut seen = BTreeSet::new();
        root.note_unread(&mut self.notes, &mut seen);
        let desc = SceneDesc {
            views: Vec::new(),
            resolution,
            max_depth,
            camera,
            materials: self.materials,
            entities: self.entities,
            lights: self.lights,
            environment: self.environment,
        };
        Ok((desc, self.notes))
    }

    fn max_depth(&mut self, o: &Object) -> Result<u32, SceneError> {
        o.known(&["rr_depth", "strict_normals"]);
        let depth = o.number("max_depth", -1.0)?;
        if depth < 0.0 {
            let message =
                format!("paths of any length are asked for: {MAX_EDGES} edges are the most; let roulette end them");
            self.notes.push(o.note(message));
            return Ok(MAX_EDGES);
        }
        Ok(depth.clamp(1.0, f64::from(MAX_EDGES)) as u32)
    }

    /// The material of a surface.
    fn surface(&mut self, o: &Rc<Object>, stem: Option<&str>) -> Result<String, SceneError> {
        if let Some(known) = self.surfaces.get(&Rc::as_ptr(o)) {
            return Ok(known.clone());
        }
        let name = self.names.give(o.id.as_deref().or(stem).unwrap_or("surface"));
        // Opaque surfaces reflect on both sides here.
        let inner =
            if o.kind == "twosided" { o.children("bsdf").next().filter(|b| delay::is_delayed(b)) } else { None };
        let material = match inner.cloned().or_else(|| delay::is_delayed(o).then(|| o.clone())) {
            Some(delayed) => delay::read(self, &delayed, &name)?,
            None => bsdf::read(o, &name, &mut self.textures, &mut self.notes)?,
        };
        self.materials.push(material);
        self.surfaces.insert(Rc::as_ptr(o), name.clone());
        Ok(name)
    }

    fn shape(&mut self, o: &Rc<Object>, around: &DAffine3, depth: usize) -> Result<(), SceneError> {
        match o.kind.as_str() {
            // Its shapes stand where instances say.
            "shapegroup" => return Ok(()),
            "instance" => return self.instance(o, around, depth),
            _ => {}
        }
        let stem = o.id.clone();
        let surface = o.children("bsdf").next().cloned();
        let mut material = match &surface {
            Some(s) => self.surface(s, stem.as_deref())?,
            None => String::new(),
        };
        let Some(Placed { shape, transform, stem: kind }) = self.meshes.read(o, &mut self.notes)? else {
            o.known(&o.items.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
            return Ok(());
        };
        if self.entities.len() >= self.most {
            return Err(o.error(format!("instances make more than {} entities, too many for the file", self.most)));
        }
        let name = self.names.give(stem.as_deref().unwrap_or(&kind));
        let emitters: Vec<Rc<Object>> = o.children("emitter").cloned().collect();
        if surface.is_none() {
            material = self.names.give("grey");
            self.materials.push(bsdf::plain(&material));
        }
        if let Some(light) = emitters.first() {
            if light.kind != "area" {
                return Err(light.error(format!("a shape shines as `area`, not as `{}`", values::shorten(&light.kind))));
            }
            let base = self.materials.iter().find(|m| m.name == material);
            let mut lit = base.cloned().unwrap_or_else(|| bsdf::plain(&material));
            lit.name = self.names.give(&format!("{name}_light"));
            emitter::shine(&mut lit, light, &mut self.textures, &mut self.notes)?;
            material = lit.name.clone();
            self.materials.push(lit);
        }
        self.entities.push(EntityDesc {
            name,
            transform: Transform::framed(affine(&(*around * transform))),
            material: Some(material),
            anisotropic_direction: None,
            shape,
        });
        Ok(())
    }

    fn instance(&mut self, o: &Rc<Object>, around: &DAffine3, depth: usize) -> Result<(), SceneError> {
        if depth > 0 {
            return Err(o.error("instances of instances are not possible"));
        }
        let place = *around * o.map("to_world")?;
        let Some(group) = o.children("shape").find(|s| s.kind == "shapegroup").cloned() else {
            return Err(o.error("an instance needs a reference to a `shapegroup`"));
        };
        let shapes: Vec<Rc<Object>> = group.children("shape").cloned().collect();
        shapes.iter().try_for_each(|s| self.shape(s, &place, depth + 1))
    }

    fn emitter(&mut self, o: &Rc<Object>) -> Result<(), SceneError> {
        match emitter::read(o, &mut self.textures, &mut self.notes)? {
            Some(emitter::Light::Around(environment)) if self.environment.is_none() => {
                self.environment = Some(environment);
            }
            Some(emitter::Light::Around(_)) => {
                self.notes.push(o.note("a scene has one environment, the first: this one is left out"));
            }
            Some(emitter::Light::Unbound(kind)) => {
                let name = self.names.give(o.id.as_deref().unwrap_or(&o.kind));
                self.lights.push(LightDesc { name, kind });
            }
            None => {}
        }
        Ok(())
    }
}

/// The texture of an item, if it is one.
fn texture_of(item: Option<&Item>) -> Option<&Rc<Object>> {
    match item {
        Some(Item::Object(o)) if o.class == "texture" => Some(o),
        _ => None,
    }
}
