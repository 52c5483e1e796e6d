//! Textures: `constant`, `scale`, `mix` and `imagemap`, and the patterns of [`super::pattern`].
//!
//! Texture coordinates are those of the mesh, and v points up in images, as here.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};

use super::decoding::{Decoding, decoding};
use super::params::{Param, Params};
use super::scoped::Scoped;
use super::spectrum::{Spectra, Use};
use super::token::truncated;
use crate::load::beside;
use crate::load::composed::{self, ImageTexture, TextureValue};
use crate::load::images::{ImageCache, mean_texel};
use crate::load::{MissingTextures, with_lenient_hint};
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::{
    MaterialDesc, Texels, TextureDesc, TextureFilter, TextureSlot, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

impl ImageTexture {
    /// Sets the texture of a material's slot.
    pub(super) fn apply_to(self, m: &mut MaterialDesc, slot: TextureSlot) {
        let lookup = self.lookup((self.map != Affine2::IDENTITY).then_some(self.map));
        m.set_mapped_texture(slot, self.image, lookup);
    }
}

/// Filters of images. Those that average over the footprint of a ray are bilinear here; the mean
/// over the samples of a pixel averages over the footprint.
const FILTERS: [(&str, TextureFilter); 5] = [
    ("bilinear", TextureFilter::Bilinear),
    ("point", TextureFilter::Nearest),
    ("trilinear", TextureFilter::Bilinear),
    ("ewa", TextureFilter::Bilinear),
    ("EWA", TextureFilter::Bilinear),
];

/// Wrap modes of images.
const WRAPS: [(&str, Wrap); 2] = [("repeat", Wrap::Repeat), ("clamp", Wrap::Clamp)];

/// Reader of textures: those defined so far, and their images.
pub(super) struct TextureReader {
    pub(super) images: ImageCache,
    missing: MissingTextures,
    /// Textures of numbers by name.
    numbers: Scoped<TextureValue>,
    /// Textures of colours by name.
    colors: Scoped<TextureValue>,
}

/// Values that the names of textures had when a directive was read: of numbers and of colours.
pub(super) type Captured = BTreeMap<String, [Option<TextureValue>; 2]>;

/// Context of reading a texture.
pub(super) struct TextureContext<'a> {
    pub spectra: &'a Spectra,
    pub notes: &'a mut Vec<Note>,
}

impl TextureReader {
    /// Creates a reader that has read nothing yet.
    pub fn new(missing: MissingTextures) -> TextureReader {
        TextureReader {
            images: ImageCache::default(),
            missing,
            numbers: Scoped::default(),
            colors: Scoped::default(),
        }
    }

    /// Returns marks of the names of textures.
    pub fn marks(&self) -> [usize; 2] {
        [self.numbers.mark(), self.colors.mark()]
    }

    /// Restores the names of textures to those at marks.
    pub fn restore(&mut self, [numbers, colors]: [usize; 2]) {
        self.numbers.restore(numbers);
        self.colors.restore(colors);
    }

    /// Returns the textures that parameters refer to.
    pub fn captured(&self, params: &Params) -> Captured {
        let values = |name: &String| {
            let tables = [&self.numbers, &self.colors];
            (name.clone(), tables.map(|table| table.get(name).cloned()))
        };
        params.texture_names().map(values).collect()
    }

    /// Reads a `Texture` directive.
    pub fn define(
        &mut self,
        name: &str,
        ty: &str,
        class: &str,
        params: &Params,
        c: &mut TextureContext<'_>,
    ) -> Result<(), SceneError> {
        let of_color = match ty {
            "float" => false,
            "spectrum" | "color" => true,
            other => {
                return Err(params.error(format!(
                    "the type of a texture is `float` or `spectrum`, found `{}`",
                    truncated(other)
                )));
            }
        };
        let value = self.read(class, params, of_color, c)?;
        params.note_unread(c.notes);
        let table = if of_color {
            &mut self.colors
        } else {
            &mut self.numbers
        };
        table.insert(name.to_owned(), value);
        Ok(())
    }

    /// Reads a texture of a class.
    fn read(
        &mut self,
        class: &str,
        params: &Params,
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let one = Vec3::ONE;
        match class {
            "constant" => self.value(params, "value", of_color, one, c),
            "scale" => {
                let v4 = params.get("tex").is_some() || params.get("scale").is_some();
                let names = if v4 {
                    ["tex", "scale"]
                } else {
                    ["tex1", "tex2"]
                };
                let a = self.value(params, names[0], of_color, one, c)?;
                let b = self.value(params, names[1], of_color && !v4, one, c)?;
                self.mixed(params, [TextureValue::Constant(Vec3::ZERO), b, a], c)
            }
            "mix" => {
                let a = self.value(params, "tex1", of_color, Vec3::ZERO, c)?;
                let b = self.value(params, "tex2", of_color, one, c)?;
                let amount = self.value(params, "amount", false, Vec3::splat(0.5), c)?;
                self.mixed(params, [a, b, amount], c)
            }
            "imagemap" => self.image_map(params, of_color, c),
            other => self.pattern(other, params, of_color, c),
        }
    }

    /// Returns a parameter of colours or numbers, which may be a texture.
    pub fn value(
        &mut self,
        params: &Params,
        name: &str,
        of_color: bool,
        default: Vec3,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        match params.get(name) {
            None => Ok(TextureValue::Constant(default)),
            Some(p) => self.value_of(p, of_color, Use::Reflectance, c.spectra),
        }
    }

    /// Returns the value of a parameter.
    pub fn value_of(
        &self,
        p: &Param,
        of_color: bool,
        purpose: Use,
        spectra: &Spectra,
    ) -> Result<TextureValue, SceneError> {
        if p.ty == "texture" {
            let [name] = p.texts()? else {
                return Err(p.error("expected the name of one texture"));
            };
            let table = if of_color {
                &self.colors
            } else {
                &self.numbers
            };
            let value = table.get(name).cloned();
            return value.ok_or_else(|| unknown(p, name, of_color));
        }
        if of_color {
            return spectra.color(p, purpose).map(TextureValue::Constant);
        }
        match p.numbers()? {
            [x] => Ok(TextureValue::Constant(Vec3::splat(*x as f32))),
            other => Err(p.error(format!("expected one number, found {}", other.len()))),
        }
    }

    /// Returns `a (1 - t) + b t` of textures `[a, b, t]`.
    pub(super) fn mixed(
        &mut self,
        params: &Params,
        values: [TextureValue; 3],
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let note = &mut |message| c.notes.push(params.note(message));
        composed::mixed(&mut self.images, values, note).map_err(|problem| params.error(problem))
    }

    /// Applies a function to the linear texels of an image; `how` names it.
    pub fn mapped(
        &mut self,
        params: &Params,
        from: ImageTexture,
        how: &str,
        f: impl Fn([f32; 4]) -> [f32; 4],
    ) -> Result<ImageTexture, SceneError> {
        let coded = matches!(from.image.texels, Texels::Rgba8(_));
        let image = self.images.derived(&from.image, how, |texel| {
            f(if coded {
                texel.map(srgb_to_linear)
            } else {
                texel
            })
        });
        Ok(ImageTexture {
            image: image.map_err(|problem| params.error(problem))?,
            ..from
        })
    }

    /// Returns the mapping of a texture; `None` if it is not that of the mesh's coordinates.
    pub(super) fn mapping(params: &Params) -> Result<Option<Affine2>, SceneError> {
        let scale = DEFAULTS.map(|(name, default)| params.number(name, default));
        let [su, sv, du, dv] = scale;
        let (scale, delta) = (
            Vec2::new(su? as f32, sv? as f32),
            Vec2::new(du? as f32, dv? as f32),
        );
        let map = Affine2::from_scale_angle_translation(scale, 0.0, delta);
        if !map.is_finite() {
            return Err(params.error("the mapping is not finite in single precision"));
        }
        let is_uv = matches!(params.text("mapping")?, None | Some("uv"));
        Ok(is_uv.then_some(map))
    }

    /// Reads an `imagemap`.
    fn image_map(
        &mut self,
        params: &Params,
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let Some(file) = params.text("filename")? else {
            return Err(params.error("an image map needs a `filename`"));
        };
        params.mark_read(&["trilinear", "maxanisotropy"]);
        let filter = Self::word(params, "filter", &FILTERS, c)?;
        let wrap = Self::word(params, "wrap", &WRAPS, c)?;
        let map = Self::mapping(params)?;
        let scale = params.number("scale", 1.0)? as f32;
        let invert = params.flag("invert", false)?;
        let decode = decoding(params, file, c.spectra.version)?;
        let Some(image) = self.file(params, file, c)? else {
            return Ok(TextureValue::Constant(Vec3::splat(0.5)));
        };
        let plain = of_color && scale == 1.0 && !invert;
        let image = match (&image.texels, decode) {
            (Texels::RgbaF32(_), _) | (Texels::Rgba8(_), Decoding::Srgb) if plain => image,
            (texels, decode) => {
                let coded = matches!(texels, Texels::Rgba8(_));
                let how = format!("map {decode:?} {scale} {invert} {of_color}");
                let derived = self.images.derived(&image, &how, |texel| {
                    let mut rgb = [texel[0], texel[1], texel[2]];
                    if coded {
                        rgb = rgb.map(|x| decode.apply(x));
                    }
                    if !of_color {
                        rgb = [rgb.iter().sum::<f32>() / 3.0; 3];
                    }
                    let [r, g, b] = rgb.map(|x| {
                        let x = scale * x;
                        if invert { (1.0 - x).max(0.0) } else { x }
                    });
                    [r, g, b, 1.0]
                });
                derived.map_err(|problem| params.error(problem))?
            }
        };
        let Some(map) = map else {
            c.notes.push(
                params.note("only the mapping `uv` is supported; the mean of the image is used"),
            );
            return Ok(TextureValue::Constant(mean_texel(&image, of_color)));
        };
        Ok(TextureValue::Image(ImageTexture {
            image,
            wrap: [wrap; 2],
            filter,
            map,
        }))
    }

    /// Returns what the words of a parameter mean. The first word is the default, the last one
    /// replaces unknown words, with a note.
    fn word<T: Copy>(
        params: &Params,
        name: &str,
        words: &[(&str, T)],
        c: &mut TextureContext<'_>,
    ) -> Result<T, SceneError> {
        let Some(found) = params.text(name)? else {
            return Ok(words[0].1);
        };
        if let Some((_, meaning)) = words.iter().find(|(word, _)| *word == found) {
            return Ok(*meaning);
        }
        let (last, meaning) = words[words.len() - 1];
        c.notes.push(params.note(format!(
            "the {name} `{}` is not supported; `{last}` is used",
            truncated(found)
        )));
        Ok(meaning)
    }

    /// Reads the image of a file. Returns `None`, with a note, if it cannot be read and the policy
    /// allows it.
    pub fn file(
        &mut self,
        params: &Params,
        file: &str,
        c: &mut TextureContext<'_>,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let path = beside(&c.spectra.folder, file);
        match self.images.load(&path, c.notes) {
            Ok(image) => Ok(Some(image)),
            Err(e) if self.missing == MissingTextures::Note => {
                c.notes
                    .push(params.note(format!("{e}; the texture is ignored")));
                Ok(None)
            }
            Err(e) => Err(with_lenient_hint(params.error(e))),
        }
    }

    /// Returns a normal map: the texels of a file, which are never decoded from sRGB.
    pub fn normal_map(
        &mut self,
        params: &Params,
        file: &str,
        c: &mut TextureContext<'_>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        Ok(self.file(params, file, c)?.map(|image| ImageTexture {
            image,
            wrap: [Wrap::Repeat; 2],
            filter: TextureFilter::Bilinear,
            map: Affine2::IDENTITY,
        }))
    }

    /// Returns the image of an area light, which covers the surface once.
    pub fn emission(
        &mut self,
        params: &Params,
        file: &str,
        c: &mut TextureContext<'_>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        let image = self.normal_map(params, file, c)?;
        Ok(image.map(|image| ImageTexture {
            wrap: [Wrap::Clamp; 2],
            ..image
        }))
    }
}

/// Names and defaults of the mapping of texture coordinates.
const DEFAULTS: [(&str, f64); 4] = [
    ("uscale", 1.0),
    ("vscale", 1.0),
    ("udelta", 0.0),
    ("vdelta", 0.0),
];

/// Creates the error about a parameter that refers to an unknown texture.
pub(super) fn unknown(p: &Param, name: &str, of_color: bool) -> SceneError {
    let kind = if of_color { "spectrum" } else { "float" };
    let shown = truncated(name);
    p.error(format!(
        "no `{kind}` texture with the name `{shown}` precedes"
    ))
}

/// Returns text that is equal for equal textures of a scene.
pub(super) fn key(value: &TextureValue) -> String {
    match value {
        TextureValue::Constant(c) => format!("{c}"),
        TextureValue::Image(image) => {
            let address = Arc::as_ptr(&image.image);
            format!(
                "{address:p} {:?} {:?} {}",
                image.wrap, image.filter, image.map
            )
        }
    }
}
