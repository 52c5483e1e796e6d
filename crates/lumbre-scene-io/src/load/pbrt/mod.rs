//! Scenes of pbrt, versions 4 and 3.
//!
//! Conventions that affect the image:
//! - Camera space has x to the right, y up and z forward. With a camera that only moves and turns,
//!   the world is left-handed, and the world here is its mirror image: x is negated in the
//!   transform of every object. `Scale -1 1 1` before the camera makes the world right-handed, and
//!   nothing is negated.
//! - `fov` is that of the smaller side of the image.
//! - The front of a triangle is the side of its normals, or of the cross product of its edges in
//!   the coordinates of the file. Texture coordinates start at the bottom left of an image.
//! - `maxdepth` counts scattering events; a path has one edge more. Integrator, sampler and filter
//!   are set by the script.
//! - In version 4 lights are normalised as its `scale` and `power` define; exposure time and ISO of
//!   the film, and `scale` in version 3, become a factor on all lights.
//!
//! `docs/reference/formats.md` lists the supported directives; everything else becomes a [`Note`].

mod area;
mod camera;
mod decoding;
mod directives;
mod environment;
mod light;
mod material;
mod material_source;
mod names;
mod params;
mod pattern;
mod scoped;
mod shape;
mod spectrum;
mod state;
mod supported;
mod texture;
mod token;
mod version;

pub(crate) use self::environment::to_equal_area as environment_square;
pub(super) use self::supported::SUPPORTED;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3};

use self::light::{AreaSource, Areas, LightReader, SceneLight};
use self::material_source::MaterialSource;
use self::params::Params;
use self::scoped::Scoped;
use self::shape::{LoadedShape, ShapeLoader, ShapeOptions};
use self::spectrum::Spectra;
use self::state::{MaterialRef, State};
use self::texture::{TextureContext, TextureReader};
use self::version::Version;
use super::materials::Materials;
use super::{MissingTextures, SMALL_ENTITIES, default_scene};
use crate::load::composed::TextureValue;
use crate::names::UniqueNames;
use lumbre_light::scene::desc::{
    EntityDesc, EnvironmentDesc, LightDesc, MAX_EDGES, SceneDesc, ShapeDesc, Transform,
};
use lumbre_light::scene::{Note, SceneError};

/// Default `maxdepth` of the integrators.
const DEFAULT_MAX_DEPTH: u32 = 5;

/// Returns whether the first bytes of a file look like a scene of pbrt.
pub(super) fn sniff(head: &[u8]) -> bool {
    let starts = [
        "LookAt ",
        "Camera \"",
        "Film \"",
        "Integrator \"",
        "Sampler \"",
        "WorldBegin",
    ];
    String::from_utf8_lossy(head).lines().any(|line| {
        starts
            .iter()
            .any(|start| line.trim_start().starts_with(start))
    })
}

/// Loads a scene and everything that it refers to.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    directives::read(path, missing)
}

/// A shape of an object definition, in the space of the object.
struct ObjectShape {
    shape: ShapeDesc,
    to_object: DAffine3,
    material: String,
    stem: String,
}

/// A `Camera` directive and the map from camera space to the file's world.
struct CameraSource {
    class: String,
    params: Params,
    to_world: DAffine3,
}

/// The light and the alpha of a shape, kept so that no other has the same address.
type Addressed = (Option<Rc<AreaSource>>, Option<TextureValue>);

/// State while a scene is loaded.
struct Loader {
    version: Version,
    /// Folder of the main file, that all names of files are relative to.
    folder: PathBuf,
    textures: TextureReader,
    shapes: ShapeLoader,
    /// Materials by name in the file.
    named: Scoped<Rc<MaterialSource>>,
    /// Converted materials by the address of their source, which is kept.
    converted: BTreeMap<usize, (Rc<MaterialSource>, String)>,
    /// Material of shapes without one.
    default_material: Option<String>,
    /// Copies of materials with the light and the alpha of a shape, by material and the addresses of
    /// both, which are kept.
    variants: BTreeMap<(String, usize, String), (String, Addressed)>,
    materials: Materials,
    objects: BTreeMap<String, Vec<ObjectShape>>,
    entities: Vec<EntityDesc>,
    lights: Vec<LightDesc>,
    environment: Option<EnvironmentDesc>,
    camera: Option<CameraSource>,
    film: Option<Params>,
    max_depth: u32,
    /// Map from the world of the file to that of the scene.
    world: DAffine3,
    /// Factor of the film on all light.
    exposure: f32,
    names: UniqueNames,
    notes: Vec<Note>,
    /// Greatest number of entities.
    max_entities: usize,
}

impl Loader {
    /// Creates a loader that has read nothing yet.
    fn new(version: Version, folder: PathBuf, missing: MissingTextures) -> Loader {
        Loader {
            version,
            folder,
            textures: TextureReader::new(missing),
            shapes: ShapeLoader::default(),
            named: Scoped::default(),
            converted: BTreeMap::new(),
            default_material: None,
            variants: BTreeMap::new(),
            materials: Materials::default(),
            objects: BTreeMap::new(),
            entities: Vec::new(),
            lights: Vec::new(),
            environment: None,
            camera: None,
            film: None,
            max_depth: DEFAULT_MAX_DEPTH,
            world: DAffine3::IDENTITY,
            exposure: 1.0,
            names: UniqueNames::default(),
            notes: Vec::new(),
            max_entities: SMALL_ENTITIES,
        }
    }

    /// Determines the handedness of the world and the exposure, when the world begins.
    fn begin_world(&mut self) -> Result<(), SceneError> {
        let mirrored = match &self.camera {
            None => true,
            Some(source) => {
                let left_handed = source.to_world.matrix3.determinant() > 0.0;
                left_handed != camera::mirrors(&source.class)
            }
        };
        if mirrored {
            let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
            self.world = DAffine3::from_mat3(mirror);
        }
        if let Some(camera) = self.camera.as_ref().filter(|_| mirrored) {
            self.notes.push(camera.params.note(
                "the world of the file is left-handed; here x is negated, which gives the same \
                picture",
            ));
        }
        let camera = self.camera.as_ref().map(|c| &c.params);
        self.exposure =
            camera::exposure(self.film.as_ref(), camera, self.version, &mut self.notes)?;
        Ok(())
    }

    /// Returns the scene after the last directive.
    fn finish(mut self) -> Result<(SceneDesc, Vec<Note>), SceneError> {
        let film = camera::film(self.film.as_ref())?;
        let camera = match &self.camera {
            Some(source) => {
                let to_world = self.world * source.to_world;
                camera::read(
                    &source.class,
                    &source.params,
                    &to_world,
                    &film,
                    &mut self.notes,
                )?
            }
            None => {
                self.notes.push(Note::new(
                    self.folder.clone(),
                    "Camera",
                    "the scene has no camera; one that frames the origin is used",
                ));
                default_scene::framing_camera(None)
            }
        };
        let resolution = camera::resolution(&film, &camera, &mut self.notes, self.film.as_ref());
        if let Some(film) = &self.film {
            film.note_unread(&mut self.notes);
        }
        let desc = SceneDesc {
            views: Vec::new(),
            resolution,
            max_depth: self.max_depth.saturating_add(1).min(MAX_EDGES),
            camera,
            materials: self.materials.into_vec().into(),
            entities: self.entities.into(),
            lights: self.lights,
            environment: self.environment,
        };
        Ok((desc, self.notes))
    }

    /// Returns the meaning of spectra in a state.
    fn spectra(&self, state: &State) -> Spectra {
        Spectra {
            version: self.version,
            color_space: state.color_space,
            folder: self.folder.clone(),
        }
    }

    /// Returns the name of a converted material.
    fn material(
        &mut self,
        source: &Rc<MaterialSource>,
        depth: usize,
    ) -> Result<String, SceneError> {
        let key = Rc::as_ptr(source) as usize;
        if let Some((_, name)) = self.converted.get(&key) {
            return Ok(name.clone());
        }
        let stem = if source.name.is_empty() {
            &source.class
        } else {
            &source.name
        };
        let name = self.names.allocate(stem);
        let material = material::read(source, &name, self, depth)?;
        self.materials.push(material);
        self.converted.insert(key, (source.clone(), name.clone()));
        Ok(name)
    }

    /// Returns the name of the material of a state.
    fn current_material(&mut self, state: &State, params: &Params) -> Result<String, SceneError> {
        match &state.material {
            MaterialRef::Own(source) => self.material(&source.clone(), 0),
            MaterialRef::Named(name) => {
                let source = self.named_material(name, params)?;
                self.material(&source, 0)
            }
            MaterialRef::None => {
                if let Some(name) = &self.default_material {
                    return Ok(name.clone());
                }
                let name = self.names.allocate("default");
                self.materials.push(material::default_material(&name));
                self.default_material = Some(name.clone());
                Ok(name)
            }
        }
    }

    /// Adds a `Shape`, to the scene or to the object that is being defined.
    fn shape(
        &mut self,
        class: &str,
        params: &Params,
        state: &State,
        object: Option<&str>,
    ) -> Result<(), SceneError> {
        let base = self.current_material(state, params)?;
        let mut alpha = self.alpha(params, state)?;
        let area = self.area(params, state, object, &mut alpha);
        let two_sided = match &area {
            Some(source) => source.params.flag("twosided", false)?,
            None => false,
        };
        let textured_light = area
            .as_ref()
            .is_some_and(|a| a.params.get("filename").is_some());
        let options = ShapeOptions {
            reversed: state.reversed,
            oriented: textured_light
                || (two_sided && class == "sphere")
                || matches!(alpha, Some(TextureValue::Image(_)))
                || self.materials.is_oriented(&base),
            version: self.version,
        };
        let to_world = self.world * state.ctm;
        if !to_world.as_affine3a().is_finite() {
            return Err(params.error("the transform is not finite in single precision"));
        }
        let folder = self.folder.clone();
        let read = self.shapes.read(
            class,
            params,
            options,
            (&folder, &to_world),
            &mut self.notes,
        )?;
        let Some(LoadedShape {
            mut shape,
            own,
            stem,
        }) = read
        else {
            return Ok(());
        };
        params.note_unread(&mut self.notes);
        let placed = state.ctm * own;
        let material = match (&area, alpha) {
            (None, None) => base,
            (area, alpha) => {
                let to_world = self.world * placed;
                let areas = Areas::of(&shape, &to_world);
                if two_sided {
                    shape = area::two_sided(shape, &to_world);
                }
                self.variant(&base, area.as_ref(), alpha, areas, params)?
            }
        };
        let shape = ObjectShape {
            shape,
            to_object: placed,
            material,
            stem,
        };
        let Some(name) = object else {
            return self.entity(&shape, &DAffine3::IDENTITY, params);
        };
        self.objects.entry(name.to_owned()).or_default().push(shape);
        Ok(())
    }

    /// Adds the entity of a shape, whose object space is mapped to the world of the file.
    fn entity(
        &mut self,
        s: &ObjectShape,
        to_world: &DAffine3,
        params: &Params,
    ) -> Result<(), SceneError> {
        if self.entities.len() >= self.max_entities {
            return Err(params.error(format!(
                "instances create more than {} entities, too many for the size of the files",
                self.max_entities
            )));
        }
        let frame = self.world * *to_world * s.to_object;
        if !frame.as_affine3a().is_finite() {
            return Err(params.error("the transform is not finite in single precision"));
        }
        let name = self.names.allocate(&s.stem);
        self.entities.push(EntityDesc {
            name,
            transform: Transform::framed(frame),
            material: Some(s.material.clone()),
            anisotropic_direction: None,
            shape: s.shape.clone(),
        });
        Ok(())
    }

    /// Adds the shapes of an object at the place of an `ObjectInstance`.
    fn instance(&mut self, name: &str, params: &Params, state: &State) -> Result<(), SceneError> {
        let Some(shapes) = self.objects.remove(name) else {
            let shown = token::truncated(name);
            return Err(params.error(format!("no object with the name `{shown}` precedes")));
        };
        let added = shapes
            .iter()
            .try_for_each(|s| self.entity(s, &state.ctm, params));
        self.objects.insert(name.to_owned(), shapes);
        added
    }

    /// Adds a `LightSource`; of several environments the first is used.
    fn light(&mut self, class: &str, params: &Params, state: &State) -> Result<(), SceneError> {
        let to_world = self.world * state.ctm;
        if !to_world.as_affine3a().is_finite() {
            return Err(params.error("the transform is not finite in single precision"));
        }
        let infinite = class == "infinite" || class == "exinfinite";
        if infinite && self.environment.is_some() {
            self.notes
                .push(params.note("only the first environment is used; this one is ignored"));
            return Ok(());
        }
        let spectra = self.spectra(state);
        let mut reader = LightReader {
            spectra: &spectra,
            textures: &mut self.textures,
            notes: &mut self.notes,
            exposure: self.exposure,
        };
        match reader.read(class, params, &to_world)? {
            Some(SceneLight::Environment(environment)) => self.environment = Some(environment),
            Some(SceneLight::Light(kind, position)) => {
                let name = self.names.allocate(class);
                self.lights.push(LightDesc::placed(name, kind, position));
            }
            None => {}
        }
        Ok(())
    }

    /// Reads a `Texture`.
    fn texture(
        &mut self,
        name: &str,
        [ty, class]: [&str; 2],
        params: &Params,
        state: &State,
    ) -> Result<(), SceneError> {
        let spectra = self.spectra(state);
        let mut context = TextureContext {
            spectra: &spectra,
            notes: &mut self.notes,
        };
        self.textures.define(name, ty, class, params, &mut context)
    }
}
