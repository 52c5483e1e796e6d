//! The directives of a file and of those that it includes, in order.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DAffine3, DVec3};

use super::light::AreaSource;
use super::material_source::MaterialSource;
use super::names::NameMarks;
use super::params::Params;
use super::spectrum::ColorSpace;
use super::state::{MaterialRef, State, TARGETS, look_at, matrix, rotation};
use super::token::{Lexer, Place, Token, truncated};
use super::version::Version;
use super::{CameraSource, Loader};
use crate::load::beside;
use crate::load::{MissingTextures, canonical, read_file};
use lumbre_light::scene::desc::{MAX_EDGES, SceneDesc};
use lumbre_light::scene::{Note, SceneError};

/// Greatest size of a file in bytes.
const MAX_BYTES: u64 = 1 << 29;
/// Greatest depth of files that include each other.
const MAX_INCLUDES: usize = 32;
/// Greatest ratio of the text that is read, with every repetition, to the size of all different
/// files.
const MAX_REPETITION: usize = 64;
/// Size of the text that is allowed for files of any size, in bytes.
const SMALL_TEXT: usize = 1 << 20;

/// Greatest number of defaults that `Attribute` sets for one kind of directive.
const MAX_DEFAULTS: usize = 256;

/// A file that is being read.
struct OpenFile {
    lexer: Lexer,
    path: PathBuf,
    /// State to be restored at the end of an imported file, and the number of blocks open before.
    imported: Option<(State, usize)>,
}

/// A block that is open: its directive, and the state before it.
struct Block {
    name: &'static str,
    state: State,
    /// Marks of the names of textures and materials before it.
    names: NameMarks,
    place: Place,
}

/// Reader of directives.
struct DirectiveReader {
    loader: Loader,
    files: Vec<OpenFile>,
    texts: BTreeMap<PathBuf, Rc<str>>,
    /// Size of all different files, and of all text that is read.
    sizes: [usize; 2],
    state: State,
    blocks: Vec<Block>,
    /// Coordinate systems by name.
    systems: BTreeMap<String, DAffine3>,
    /// Object that is being defined.
    object: Option<String>,
    in_world: bool,
}

/// Reads a scene.
pub(super) fn read(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let mut reader = DirectiveReader {
        loader: Loader::new(Version::V4, folder, missing),
        files: Vec::new(),
        texts: BTreeMap::new(),
        sizes: [0; 2],
        state: State::default(),
        blocks: Vec::new(),
        systems: BTreeMap::new(),
        object: None,
        in_world: false,
    };
    let text = reader.open(path, None).map_err(|(e, _)| e)?;
    reader.loader.version = Version::of(&text);
    reader.all()?;
    if !reader.in_world {
        return Err(SceneError::malformed(
            path,
            "end",
            "the file has no `WorldBegin`: it is not a whole scene",
        ));
    }
    if let Some(block) = reader.blocks.last() {
        let message = format!("{} has no end", block.name);
        reader.loader.notes.push(block.place.note(message));
    }
    reader.loader.finish()
}

impl DirectiveReader {
    /// Opens a file; the following tokens are read from it. An error is returned with whether it is
    /// one of the file itself.
    fn open(
        &mut self,
        path: &Path,
        imported: Option<(State, usize)>,
    ) -> Result<Rc<str>, (SceneError, bool)> {
        let key = canonical(path);
        let text = match self.texts.get(&key) {
            Some(text) => text.clone(),
            None => {
                let bytes = read_file(path, MAX_BYTES).map_err(|e| (e, true))?;
                let text: Rc<str> = String::from_utf8_lossy(&bytes).into();
                self.sizes[0] += text.len();
                self.texts.insert(key.clone(), text.clone());
                text
            }
        };
        self.sizes[1] = self.sizes[1].saturating_add(text.len());
        self.loader.max_entities = self.sizes[0].saturating_add(super::SMALL_ENTITIES);
        self.files.push(OpenFile {
            lexer: Lexer::new(path.into(), text.clone()),
            path: key,
            imported,
        });
        Ok(text)
    }

    /// Reads all directives.
    fn all(&mut self) -> Result<(), SceneError> {
        while let Some(file) = self.files.last_mut() {
            let Some(token) = file.lexer.next()? else {
                if let Some((state, blocks)) = self.files.pop().and_then(|file| file.imported) {
                    self.state = state;
                    self.blocks.truncate(blocks);
                }
                continue;
            };
            let Token::Word(name) = token else {
                return Err(file.lexer.unexpected("a directive", &token));
            };
            let place = file.lexer.place();
            let done = self.transform(&name, &place)?
                || self.block(&name, &place)?
                || self.option(&name, &place)?
                || self.content(&name, &place)?;
            if !done {
                let token = Token::Word(name);
                return Err(self.lexer(&place)?.unexpected("a directive", &token));
            }
        }
        Ok(())
    }

    /// Returns the lexer of the current file.
    fn lexer(&mut self, place: &Place) -> Result<&mut Lexer, SceneError> {
        match self.files.last_mut() {
            Some(file) => Ok(&mut file.lexer),
            None => Err(place.error("the file ends early")),
        }
    }

    /// Reads the type of a directive and its parameters, with the defaults for a target.
    fn params(
        &mut self,
        directive: &str,
        target: &str,
        place: &Place,
    ) -> Result<(String, Params), SceneError> {
        let defaults = self.state.defaults_of(target);
        let lexer = self.lexer(place)?;
        let class = lexer.quoted("a type between quotation marks")?;
        let what = format!("{directive} \"{}\"", truncated(&class));
        let params = Params::read(lexer, what, place.clone())?;
        Ok((class, params.with_defaults(&defaults)))
    }

    /// Reads a transform; returns whether the directive is one.
    fn transform(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        let invalid = |what: &str| place.error(format!("`{name}`: {what}"));
        match name {
            "Identity" => self.state.set(DAffine3::IDENTITY),
            "Translate" => {
                let by = self.lexer(place)?.numbers::<3>(false)?;
                self.state.concat(DAffine3::from_translation(by.into()));
            }
            "Scale" => {
                let by = self.lexer(place)?.numbers::<3>(false)?;
                self.state.concat(DAffine3::from_scale(DVec3::from(by)));
            }
            "Rotate" => {
                let turn = rotation(self.lexer(place)?.numbers::<4>(false)?);
                let turn = turn.ok_or_else(|| invalid("the axis has no length"))?;
                self.state.concat(turn);
            }
            "LookAt" => {
                let view = look_at(&self.lexer(place)?.numbers::<9>(false)?);
                let view =
                    view.ok_or_else(|| invalid("the view has no direction, or up is along it"))?;
                self.state.concat(view);
            }
            "Transform" | "ConcatTransform" => {
                let map = matrix(&self.lexer(place)?.numbers::<16>(true)?);
                let map = map.ok_or_else(|| {
                    invalid("every fourth number must be 0, and the last one not")
                })?;
                if name == "Transform" {
                    self.state.set(map);
                } else {
                    self.state.concat(map);
                }
            }
            "CoordinateSystem" => {
                let system = self.lexer(place)?.quoted("a name")?;
                self.systems.insert(system, self.state.ctm);
            }
            "CoordSysTransform" => {
                let system = self.lexer(place)?.quoted("a name")?;
                match self.systems.get(&system) {
                    Some(map) => self.state.set(*map),
                    None => {
                        let shown = truncated(&system);
                        let message = format!("no coordinate system `{shown}` precedes; ignored");
                        self.loader.notes.push(place.note(message));
                    }
                }
            }
            _ => return self.motion(name, place),
        }
        Ok(true)
    }

    /// Reads a directive about motion during the exposure, which is not supported.
    fn motion(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        match name {
            "TransformTimes" => {
                self.lexer(place)?.numbers::<2>(false)?;
            }
            "ActiveTransform" => match self.lexer(place)?.required("`All`")? {
                Token::Word(word) => self.state.at_end = word == "EndTime",
                other => return Err(self.lexer(place)?.unexpected("`All`", &other)),
            },
            _ => return Ok(false),
        }
        self.loader
            .notes
            .push(place.note("motion is not supported; transforms of the start are used"));
        Ok(true)
    }

    /// Reads the begin or end of a block; returns whether the directive is one.
    fn block(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        let begin = match name {
            "AttributeBegin" => "AttributeBegin",
            "TransformBegin" => "TransformBegin",
            "ObjectBegin" => "ObjectBegin",
            "AttributeEnd" | "TransformEnd" | "ObjectEnd" => return self.end_block(name, place),
            _ => return Ok(false),
        };
        if begin == "ObjectBegin" {
            if self.object.is_some() {
                return Err(place.error("an object is defined inside of another one"));
            }
            let object = self.lexer(place)?.quoted("the name of an object")?;
            self.loader.objects.entry(object.clone()).or_default();
            self.object = Some(object);
        }
        self.blocks.push(Block {
            name: begin,
            state: self.state.clone(),
            names: self.loader.name_marks(),
            place: place.clone(),
        });
        Ok(true)
    }

    /// Ends a block. In version 3 `TransformEnd` restores the transform only, and the other blocks
    /// also restore the names of textures and materials.
    fn end_block(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        let stem = name.trim_end_matches("End");
        let first = self.files.last().and_then(|f| f.imported.as_ref());
        let floor = first.map_or(0, |(_, blocks)| *blocks);
        let matching = self.blocks.len() > floor;
        let Some(block) = self
            .blocks
            .pop()
            .filter(|b| matching && b.name.starts_with(stem))
        else {
            return Err(place.error(format!("`{name}` without a matching `{stem}Begin`")));
        };
        if stem == "Object" {
            self.object = None;
        }
        let version3 = self.loader.version == Version::V3;
        if stem == "Transform" && version3 {
            self.state.ctm = block.state.ctm;
            return Ok(true);
        }
        if version3 {
            self.loader.restore_names(block.names);
        }
        self.state = block.state;
        Ok(true)
    }

    /// Reads a `Camera`.
    fn camera(&mut self, place: &Place) -> Result<(), SceneError> {
        let (class, params) = self.params("Camera", "", place)?;
        let ctm = self.state.ctm;
        if ctm.matrix3.determinant().abs() < 1e-30 {
            return Err(params.error("the transform is not invertible"));
        }
        let to_world = ctm.inverse();
        self.systems.insert("camera".to_owned(), to_world);
        self.loader.camera = Some(CameraSource {
            class,
            params,
            to_world,
        });
        Ok(())
    }

    /// Reads a directive about the picture as a whole; returns whether it is one.
    fn option(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        match name {
            "Camera" => self.camera(place)?,
            "Film" => self.loader.film = Some(self.params(name, "", place)?.1),
            "PixelFilter" => {
                let (class, params) = self.params(name, "", place)?;
                self.loader.notes.push(params.note(format!(
                    "the script sets the filter: `filter = \"{}\"`",
                    if class == "sinc" { "lanczos" } else { &class }
                )));
            }
            "Integrator" | "SurfaceIntegrator" => {
                let (_, params) = self.params(name, "", place)?;
                if name == "SurfaceIntegrator" {
                    let message =
                        "a directive of version 2, whose scenes are read as those of version 3";
                    self.loader.notes.push(params.note(message));
                }
                self.loader.max_depth =
                    params.integer("maxdepth", super::DEFAULT_MAX_DEPTH, MAX_EDGES)?;
            }
            // These have no effect on the expected picture.
            "Sampler" | "Accelerator" => drop(self.params(name, "", place)?),
            "ColorSpace" => {
                let space = self.lexer(place)?.quoted("the name of a colour space")?;
                self.state.color_space = ColorSpace::from_name(&space).unwrap_or_else(|| {
                    let shown = truncated(&space);
                    let message =
                        format!("the colour space `{shown}` is not supported; sRGB is used");
                    self.loader.notes.push(place.note(message));
                    ColorSpace::Srgb
                });
            }
            "Option" => {
                let lexer = self.lexer(place)?;
                let declaration = lexer.quoted("an option")?;
                lexer.required("a value")?;
                let message = format!("the option `{}` is ignored", truncated(&declaration));
                self.loader.notes.push(place.note(message));
            }
            "WorldBegin" => {
                if std::mem::replace(&mut self.in_world, true) {
                    return Err(place.error("the world begins twice"));
                }
                self.state.set(DAffine3::IDENTITY);
                self.systems.insert("world".to_owned(), DAffine3::IDENTITY);
                self.loader.begin_world()?;
            }
            "WorldEnd" => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Reads a directive about the content of the world; returns whether it is one.
    fn content(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        match name {
            "Include" | "Import" => self.include(name == "Import", place)?,
            "ReverseOrientation" => self.state.reversed = !self.state.reversed,
            "Attribute" => self.attribute(place)?,
            "Material" | "MakeNamedMaterial" => self.material(name == "Material", place)?,
            "NamedMaterial" => {
                let material = self.lexer(place)?.quoted("the name of a material")?;
                self.state.material = self.loader.material_ref(material);
            }
            "Texture" => {
                let lexer = self.lexer(place)?;
                let (texture, ty) = (lexer.quoted("a name")?, lexer.quoted("`float`")?);
                let (class, params) = self.params(name, "texture", place)?;
                self.loader
                    .texture(&texture, [&ty, &class], &params, &self.state)?;
            }
            "MakeNamedMedium" => {
                let (_, params) = self.params(name, "", place)?;
                self.loader
                    .notes
                    .push(params.note("media are not supported; ignored"));
            }
            "MediumInterface" => {
                let lexer = self.lexer(place)?;
                lexer.quoted("the name of a medium")?;
                if let Some(Token::Quoted(_)) = lexer.peek()? {
                    lexer.next()?;
                }
                self.loader
                    .notes
                    .push(place.note("media are not supported; ignored"));
            }
            _ => return self.object(name, place),
        }
        Ok(true)
    }

    /// Reads a light, a shape or an instance; returns whether the directive is one.
    fn object(&mut self, name: &str, place: &Place) -> Result<bool, SceneError> {
        match name {
            "AreaLightSource" => {
                let (class, params) = self.params(name, "light", place)?;
                let spectra = self.loader.spectra(&self.state);
                let source = AreaSource {
                    class,
                    params,
                    spectra,
                };
                self.state.area_light = Some(Rc::new(source));
            }
            "LightSource" => {
                let (class, params) = self.params(name, "light", place)?;
                self.world_only(name, place)?;
                self.loader.light(&class, &params, &self.state)?;
            }
            "Shape" => {
                let (class, params) = self.params(name, "shape", place)?;
                self.world_only(name, place)?;
                let object = self.object.as_deref();
                self.loader.shape(&class, &params, &self.state, object)?;
            }
            "ObjectInstance" => {
                let object = self.lexer(place)?.quoted("the name of an object")?;
                self.world_only(name, place)?;
                if self.object.is_some() {
                    return Err(place.error("an object is used inside of a definition"));
                }
                let lexer = self.lexer(place)?;
                let params = Params::read(lexer, name.to_owned(), place.clone())?;
                self.loader.instance(&object, &params, &self.state)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Fails before the world has begun.
    fn world_only(&self, name: &str, place: &Place) -> Result<(), SceneError> {
        if self.in_world {
            return Ok(());
        }
        Err(place.error(format!("`{name}` precedes `WorldBegin`")))
    }

    /// Reads an `Include` or `Import`. An imported file leaves the graphics state as it was.
    fn include(&mut self, import: bool, place: &Place) -> Result<(), SceneError> {
        let name = self.lexer(place)?.quoted("the name of a file")?;
        let path = beside(&self.loader.folder, &name);
        if self.files.len() >= MAX_INCLUDES {
            return Err(place.error(format!(
                "files include each other more than {MAX_INCLUDES} levels deep"
            )));
        }
        let open: BTreeSet<&PathBuf> = self.files.iter().map(|file| &file.path).collect();
        if open.contains(&canonical(&path)) {
            return Err(place.error(format!("`{}` includes itself", truncated(&name))));
        }
        let imported = import.then(|| (self.state.clone(), self.blocks.len()));
        self.open(&path, imported)
            .map_err(|(e, _)| place.error(e.to_string()))?;
        let [distinct, all] = self.sizes;
        if all
            > distinct
                .saturating_mul(MAX_REPETITION)
                .saturating_add(SMALL_TEXT)
        {
            return Err(place.error("files are included too often for their size"));
        }
        Ok(())
    }

    /// Reads an `Attribute`: defaults for a kind of directive.
    fn attribute(&mut self, place: &Place) -> Result<(), SceneError> {
        let (target, params) = self.params("Attribute", "", place)?;
        match TARGETS.iter().position(|name| *name == target) {
            Some(i) => {
                let mut defaults = self.state.defaults[i].to_vec();
                let error = params.error(format!("more than {MAX_DEFAULTS} attributes of a kind"));
                defaults.extend(params.into_defaults());
                if defaults.len() > MAX_DEFAULTS {
                    return Err(error);
                }
                self.state.defaults[i] = Rc::new(defaults);
            }
            None => self
                .loader
                .notes
                .push(params.note("attributes of this kind have no effect")),
        }
        Ok(())
    }

    /// Reads a `Material`, or a `MakeNamedMaterial`, whose type is a parameter.
    fn material(&mut self, own: bool, place: &Place) -> Result<(), SceneError> {
        let directive = if own { "Material" } else { "MakeNamedMaterial" };
        let (first, params) = self.params(directive, "material", place)?;
        let class = if own {
            first.clone()
        } else {
            let ty = params.text("type")?;
            ty.ok_or_else(|| params.error("a named material needs a `type`"))?
                .to_owned()
        };
        let source = Rc::new(MaterialSource {
            name: if own { String::new() } else { first.clone() },
            class,
            spectra: self.loader.spectra(&self.state),
            textures: self.loader.textures.captured(&params),
            parts: self.loader.parts_of(&params),
            params,
        });
        if own {
            self.state.material = MaterialRef::Own(source);
        } else {
            self.loader.named.insert(first, source);
        }
        Ok(())
    }
}
