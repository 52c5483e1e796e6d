//! Scenes of Mitsuba 3 in XML, and of Mitsuba 0.5 and 0.6, whose names (`toWorld`, `intIOR`) have
//! the same meaning.
//!
//! Conventions that affect the image:
//! - A camera looks along the +z axis of its `to_world` with +y up. `fov` is horizontal unless
//!   `fov_axis` differs.
//! - `max_depth` counts path edges; -1 is the greatest number supported here. Integrator, sampler
//!   and filter are set by the script.
//! - Meshes without normals get smooth ones, unless `face_normals` is set; the front of a face with
//!   normals is their side.
//! - Texture coordinates start at the top left of an image; those of OBJ files at the bottom left.
//! - A number as the spectrum of an emitter is light of equal energy, and D65 in version 0.6.
//! - Area lights emit on their front side and reflect like their surface; without one they are black.
//! - `dielectric`, `conductor`, `plastic` and their rough forms become materials of those models;
//!   `diffuse` becomes `lambert`.
//!
//! `docs/reference/formats.md` lists the supported properties of each plugin; everything else becomes a
//! [`Note`].

mod bsdf;
mod delay;
mod emitter;
mod sensor;
mod serialized;
mod shape;
mod sky;
mod supported;
mod texture;
mod tree;
mod values;

pub(super) use self::supported::SUPPORTED;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, Vec3};

use self::shape::{MeshLoader, NamedMaterials, SurfaceNeeds, TransformedShape};
use self::texture::TextureReader;
use self::tree::{Property, XmlObject};
use super::materials::Materials;
use super::{MissingTextures, SMALL_ENTITIES, Variables, default_scene, obj};
use crate::names::UniqueNames;
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::{
    EntityDesc, EnvironmentDesc, LightDesc, MAX_EDGES, MaterialDesc, Model, SceneDesc, ShapeDesc,
    Transform, mesh_hash,
};
use lumbre_light::scene::{Note, SceneError};

/// Default resolution of a film.
const DEFAULT_FILM: [u32; 2] = [768, 576];

/// Returns whether the first bytes of a file look like a scene in XML.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head);
    head.contains("<scene")
        && head
            .trim_start_matches('\u{feff}')
            .trim_start()
            .starts_with('<')
}

/// Loads a scene and everything that it refers to.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    load_with_variables(path, missing, &Variables::new())
}

/// Loads a scene with values for its variables, which `default` elements do not replace: what `-D`
/// does in Mitsuba.
pub(super) fn load_with_variables(
    path: &Path,
    missing: MissingTextures,
    variables: &Variables,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut notes = Vec::new();
    let (root, bytes) = tree::scene(path, variables, &mut notes)?;
    if root.class != "scene" {
        return Err(root.error(format!(
            "expected <scene>, found <{}>",
            values::truncated(&root.class)
        )));
    }
    let loader = MitsubaLoader {
        textures: TextureReader::new(missing),
        meshes: MeshLoader::default(),
        surfaces: BTreeMap::new(),
        colored: BTreeSet::new(),
        libraries: BTreeMap::new(),
        materials: Materials::default(),
        entities: Vec::new(),
        lights: Vec::new(),
        environment: None,
        names: UniqueNames::default(),
        notes,
        max_entities: bytes.saturating_add(SMALL_ENTITIES),
    };
    loader.scene(&root)
}

/// Greatest number of integrators inside one another.
const MAX_INTEGRATORS: usize = 8;
/// Edges of the paths of the integrator `direct`: to a surface, and from there to a light.
const DIRECT_EDGES: u32 = 2;

/// State while a scene is loaded.
struct MitsubaLoader {
    textures: TextureReader,
    meshes: MeshLoader,
    /// Name of the material of each surface, by the address of its object and whether it is inside of
    /// `twosided`.
    surfaces: BTreeMap<(*const XmlObject, bool), String>,
    /// Names of the materials whose base colour is that of vertices.
    colored: BTreeSet<String>,
    /// Materials of the material files of each OBJ file.
    libraries: BTreeMap<PathBuf, Rc<NamedMaterials>>,
    materials: Materials,
    entities: Vec<EntityDesc>,
    lights: Vec<LightDesc>,
    environment: Option<EnvironmentDesc>,
    names: UniqueNames,
    notes: Vec<Note>,
    /// Greatest number of entities.
    max_entities: usize,
}

impl MitsubaLoader {
    /// Loads the scene.
    fn scene(mut self, root: &Rc<XmlObject>) -> Result<(SceneDesc, Vec<Note>), SceneError> {
        root.mark_read(&["version"]);
        // Surfaces are read first, in the order of the file, so that their names are their ids.
        for o in root.children("bsdf") {
            self.surface(o, None, false)?;
        }
        for o in root.children("shape") {
            self.shape(o, &DAffine3::IDENTITY, 0)?;
        }
        for o in root.children("emitter") {
            // Shapes refer to area lights of the scene.
            if o.plugin == "area" && o.id.is_some() {
                continue;
            }
            self.emitter(o)?;
        }
        // Textures with an id are read where they are referenced.
        root.children("texture").for_each(drop);
        let (camera, resolution) = match root.children("sensor").next() {
            Some(o) => sensor::read(o, &self.entities, &mut self.notes)?,
            None => {
                self.notes.push(
                    root.note("the scene has no sensor; a camera that frames the origin is used"),
                );
                (default_scene::framing_camera(None), DEFAULT_FILM)
            }
        };
        if let Some(second) = root.children("sensor").nth(1) {
            self.notes
                .push(second.note("only the first sensor is used; this one is ignored"));
        }
        let max_depth = match root.children("integrator").next() {
            None => default_scene::DEFAULT_MAX_DEPTH,
            Some(o) => self.max_depth(o, 0)?,
        };
        let mut visited = BTreeSet::new();
        root.note_unused(&mut self.notes, &mut visited);
        let desc = SceneDesc {
            views: Vec::new(),
            resolution,
            max_depth,
            camera,
            materials: self.materials.into_vec().into(),
            entities: self.entities.into(),
            lights: self.lights,
            environment: self.environment,
        };
        Ok((desc, self.notes))
    }

    /// Reads the greatest number of path edges from the integrator, or from the one inside of it.
    fn max_depth(&mut self, o: &XmlObject, level: usize) -> Result<u32, SceneError> {
        o.mark_read(&["rr_depth", "strict_normals"]);
        if let Some(inside) = o.children("integrator").next() {
            if level == MAX_INTEGRATORS {
                let problem =
                    format!("integrators are nested more than {MAX_INTEGRATORS} levels deep");
                return Err(o.error(problem));
            }
            return self.max_depth(inside, level + 1);
        }
        if o.plugin == "direct" {
            return Ok(DIRECT_EDGES);
        }
        let depth = o.number("max_depth", -1.0)?;
        if depth < 0.0 {
            let message = format!(
                "unlimited path length is not supported; at most {MAX_EDGES} edges are used, and \
                 Russian roulette may end paths earlier"
            );
            self.notes.push(o.note(message));
            return Ok(MAX_EDGES);
        }
        Ok(depth.clamp(1.0, f64::from(MAX_EDGES)) as u32)
    }

    /// Returns the name of the material of a surface, which is converted once. `two_sided` is set inside
    /// of `twosided`.
    fn surface(
        &mut self,
        o: &Rc<XmlObject>,
        stem: Option<&str>,
        two_sided: bool,
    ) -> Result<String, SceneError> {
        // Surfaces with delays are always two-sided.
        let two_sided = two_sided || delay::is_delayed(o);
        let key = (Rc::as_ptr(o), two_sided);
        if let Some(known) = self.surfaces.get(&key) {
            return Ok(known.clone());
        }
        let name = self
            .names
            .allocate(o.id.as_deref().or(stem).unwrap_or("surface"));
        let inside = o
            .children("bsdf")
            .next()
            .filter(|inside| o.plugin == "twosided" && delay::is_delayed(inside));
        let materials = match inside {
            Some(delayed) => delay::read(self, &delayed.clone(), &name, true)?,
            None if delay::is_delayed(o) => delay::read(self, o, &name, two_sided)?,
            None => bsdf::read(o, &name, two_sided, self)?,
        };
        materials.into_iter().for_each(|m| self.materials.push(m));
        self.surfaces.insert(key, name.clone());
        Ok(name)
    }

    /// Adds the entity of a shape. `parent` is the transform of the instance that contains it.
    fn shape(
        &mut self,
        o: &Rc<XmlObject>,
        parent: &DAffine3,
        depth: usize,
    ) -> Result<(), SceneError> {
        match o.plugin.as_str() {
            // The shapes of a group are added by its instances.
            "shapegroup" => return Ok(()),
            "instance" => return self.instance(o, parent, depth),
            _ => {}
        }
        let stem = o.id.clone();
        let named = self.named_materials(o)?;
        // Where surfaces belong to faces, that of the whole shape has no name.
        let surface = if o.names_faces() {
            o.mark_read(&[""]);
            let mut surfaces = o.inside("bsdf");
            surfaces
                .find(|(name, _)| name.is_empty())
                .map(|(_, surface)| surface)
        } else {
            o.children("bsdf").next()
        };
        let surface = surface.cloned();
        let mut material = match &surface {
            Some(s) => self.surface(s, stem.as_deref(), false)?,
            None => String::new(),
        };
        let emits_texture =
            |light: &Rc<XmlObject>| as_texture(light.property("radiance")).is_some();
        let materials = &self.materials;
        let needs = SurfaceNeeds {
            oriented: o.children("emitter").any(emits_texture) || materials.is_oriented(&material),
            colors: [&material]
                .into_iter()
                .chain(named.values())
                .any(|name| materials.any_part(name, &|m| self.colored.contains(&m.name))),
            named: &named,
        };
        let Some(TransformedShape {
            shape,
            transform,
            stem: kind,
        }) = self.meshes.read(o, needs, &mut self.notes)?
        else {
            o.mark_all_read();
            return Ok(());
        };
        if self.entities.len() >= self.max_entities {
            return Err(o.error(format!(
                "instances create more than {} entities, too many for the size of the file",
                self.max_entities
            )));
        }
        let name = self.names.allocate(stem.as_deref().unwrap_or(&kind));
        let emitters: Vec<Rc<XmlObject>> = o.children("emitter").cloned().collect();
        if surface.is_none() {
            // In version 0.6 the boundary of a medium is no surface unless it has one.
            let bounds = o.legacy && o.inside("medium").next().is_some();
            material = self
                .names
                .allocate(if bounds { "boundary" } else { "grey" });
            let default = if bounds && emitters.is_empty() {
                bsdf::invisible(&material)
            } else {
                bsdf::default_surface(&material, !emitters.is_empty())
            };
            self.materials.push(default);
        }
        if let Some(light) = emitters.first() {
            material = self.area_light(light, &material, &name)?;
        }
        // Without a material of the whole shape those of its slots hold.
        let (shape, material) = match shape {
            ShapeDesc::Mesh(mut mesh) if mesh.slots.iter().any(|slot| !slot.is_empty()) => {
                if mesh.slots.iter().any(String::is_empty) {
                    let mesh = Arc::make_mut(&mut mesh);
                    let others = mesh.slots.iter_mut().filter(|slot| slot.is_empty());
                    others.for_each(|slot| slot.clone_from(&material));
                    mesh.content_hash = mesh_hash(mesh);
                }
                // Surfaces that no face names are noted as unused.
                let used = named.iter().filter(|(_, m)| mesh.slots.contains(m));
                used.for_each(|(name, _)| o.mark_read(&[name]));
                (ShapeDesc::Mesh(mesh), None)
            }
            shape => (shape, Some(material)),
        };
        self.entities.push(EntityDesc {
            name,
            transform: Transform::framed(*parent * transform),
            material,
            anisotropic_direction: None,
            shape,
        });
        Ok(())
    }

    /// Returns the materials of the faces of an OBJ file by the names that the file gives them, as
    /// version 0.6 finds them: those of its material files, replaced by the surfaces of the shape with
    /// these names; a surface without a name replaces all before it. Shapes that emit, and those of
    /// version 3, have none.
    fn named_materials(&mut self, o: &Rc<XmlObject>) -> Result<Rc<NamedMaterials>, SceneError> {
        if !o.names_faces() {
            return Ok(Rc::default());
        }
        o.mark_read(&["load_materials"]);
        let surfaces: Vec<_> = o.inside("bsdf").collect();
        if surfaces.is_empty() {
            return self.library(o);
        }
        let mut named = NamedMaterials::new();
        if surfaces.iter().all(|(name, _)| !name.is_empty()) {
            named.clone_from(&*self.library(o)?);
        }
        let mut own = BTreeSet::new();
        for (name, surface) in surfaces {
            if name.is_empty() {
                named.clear();
                continue;
            }
            if !own.insert(name) {
                let shown = values::truncated(name);
                let message =
                    format!("names of surfaces like `{shown}` differ only in their spelling");
                self.notes.push(o.note(message));
            }
            let material = self.surface(surface, Some(name), false)?;
            named.retain(|known, _| values::snake_case(known) != *name);
            named.insert(name.to_owned(), material);
        }
        Ok(Rc::new(named))
    }

    /// Reads the material files of an OBJ file as version 0.6 does, unless `load_materials` is false:
    /// surfaces are diffuse on their front, with colours in sRGB, or glass, and emit nothing.
    fn library(&mut self, o: &XmlObject) -> Result<Rc<NamedMaterials>, SceneError> {
        if !o.flag("load_materials", true)? {
            return Ok(Rc::default());
        }
        let Some(file) = o.text("filename")? else {
            return Ok(Rc::default());
        };
        let path = o.find_file(file);
        if let Some(known) = self.libraries.get(&path) {
            return Ok(Rc::clone(known));
        }
        let missing = self.textures.missing;
        let read = obj::materials(&path, missing, &mut self.notes);
        let read = read.map_err(|e| o.error(e.to_string()))?;
        if !read.is_empty() {
            let message =
                "of the material files of an OBJ, highlights and metals of `illum` are left out";
            self.notes.push(o.note(message));
        }
        let mut named = NamedMaterials::new();
        for (name, m) in read {
            let allocated = self.names.allocate(&m.name);
            let glass = m.opacity == 0.0;
            self.materials.push(MaterialDesc {
                name: allocated.clone(),
                model: if glass { m.model } else { Model::Lambert },
                base_color: m.base_color.map(srgb_to_linear),
                emission: Vec3::ZERO,
                one_sided: !glass,
                ..m
            });
            named.insert(name, allocated);
        }
        let named = Rc::new(named);
        self.libraries.insert(path, Rc::clone(&named));
        Ok(named)
    }

    /// Returns the name of a copy of a material with the emission of an area light.
    fn area_light(
        &mut self,
        light: &Rc<XmlObject>,
        material: &str,
        shape: &str,
    ) -> Result<String, SceneError> {
        if light.plugin != "area" {
            return Err(light.error(format!(
                "the emitter of a shape must be `area`, found `{}`",
                values::truncated(&light.plugin)
            )));
        }
        let base = self.materials.get(material);
        let mut emissive = base
            .cloned()
            .unwrap_or_else(|| bsdf::default_surface(material, true));
        emissive.name = self.names.allocate(&format!("{shape}_light"));
        if !emissive.parts.is_empty() {
            (emissive.parts, emissive.weights) = (Vec::new(), Vec::new());
            emissive.by_side = false;
            emissive.emitter_reflects = false;
            self.notes.push(light.note(
                "a light on a blended surface reflects nothing here; in Mitsuba it reflects",
            ));
        }
        emitter::set_emission(&mut emissive, light, &mut self.textures, &mut self.notes)?;
        let name = emissive.name.clone();
        self.materials.push(emissive);
        Ok(name)
    }

    /// Adds the shapes of the group that an instance refers to.
    fn instance(
        &mut self,
        o: &Rc<XmlObject>,
        parent: &DAffine3,
        depth: usize,
    ) -> Result<(), SceneError> {
        if depth > 0 {
            return Err(o.error("instances of instances are not supported"));
        }
        let transform = *parent * o.transform("to_world")?;
        let Some(group) = o
            .children("shape")
            .find(|s| s.plugin == "shapegroup")
            .cloned()
        else {
            return Err(o.error("an instance needs a reference to a `shapegroup`"));
        };
        let shapes: Vec<Rc<XmlObject>> = group.children("shape").cloned().collect();
        shapes
            .iter()
            .try_for_each(|s| self.shape(s, &transform, depth + 1))
    }

    /// Adds a light or the environment; of several environments the first is used.
    fn emitter(&mut self, o: &Rc<XmlObject>) -> Result<(), SceneError> {
        const SECOND: &str = "only the first environment is used; this one is ignored";
        // A second sky would take long to compute.
        if self.environment.is_some() && matches!(o.plugin.as_str(), "sky" | "sun" | "sunsky") {
            self.notes.push(o.note(SECOND));
            o.mark_all_read();
            return Ok(());
        }
        match emitter::read(o, &mut self.textures, &mut self.notes)? {
            Some(emitter::SceneLight::Environment(environment)) if self.environment.is_none() => {
                self.environment = Some(environment);
            }
            Some(emitter::SceneLight::Environment(_)) => {
                self.notes.push(o.note(SECOND));
            }
            Some(emitter::SceneLight::Light(mut light)) => {
                light.name = self.names.allocate(o.id.as_deref().unwrap_or(&o.plugin));
                self.lights.push(light);
            }
            None => {}
        }
        Ok(())
    }
}

/// Returns the texture object of a property, if it is one.
fn as_texture(item: Option<&Property>) -> Option<&Rc<XmlObject>> {
    match item {
        Some(Property::Object(o)) if o.class == "texture" => Some(o),
        _ => None,
    }
}
