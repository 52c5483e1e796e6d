//! Textures of Mitsuba scenes: `bitmap` and `checkerboard`, and `scale` of version 0.6.

use std::rc::Rc;
use std::sync::Arc;

use glam::{Affine2, DAffine3, DVec3, Mat2, Vec2, Vec3};

use super::tree::{Property, XmlObject};
use crate::load::composed::{self, ImageTexture, TextureValue};
use crate::load::images::ImageCache;
use crate::load::{MissingTextures, with_lenient_hint};
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::{
    Lookup, MaterialDesc, NoInverse, Texels, TextureDesc, TextureFilter, TextureSlot, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// Greatest nesting depth of textures.
const MAX_NESTING: usize = 8;

impl ImageTexture {
    /// Sets the texture of a material's slot. A uniform scale and the offset of the first texture
    /// become the material's own; the rest of the map is stored with the texture.
    ///
    /// # Errors
    /// Fails if the map of the first texture is not invertible; the texture is then mapped like the
    /// first one.
    pub(super) fn apply_relative(
        self,
        m: &mut MaterialDesc,
        slot: TextureSlot,
    ) -> Result<(), NoInverse> {
        let scale = self.map.matrix2;
        let is_uniform = scale == Mat2::from_diagonal(Vec2::splat(scale.x_axis.x));
        if m.textures.is_empty() && is_uniform {
            (m.tiling, m.uv_offset) = (scale.x_axis.x, self.map.translation);
        }
        let tiling = Affine2::from_scale_angle_translation(Vec2::splat(m.tiling), 0.0, m.uv_offset);
        let map = Lookup::relative_to(tiling, self.map);
        let lookup = self.lookup(map.unwrap_or(None));
        m.set_mapped_texture(slot, self.image, lookup);
        map.map(|_| ())
    }
}

/// Reader of textures: the images read or generated so far.
pub(super) struct TextureReader {
    images: ImageCache,
    /// Policy for images that cannot be read.
    pub missing: MissingTextures,
}

impl TextureReader {
    /// Creates a reader that has read nothing yet.
    pub fn new(missing: MissingTextures) -> TextureReader {
        TextureReader {
            images: ImageCache::default(),
            missing,
        }
    }

    /// Converts a texture for a slot of numbers: Mitsuba decodes 8-bit texels from sRGB unless they
    /// are `raw`, while such slots use them as stored.
    pub fn linear(
        &mut self,
        o: &XmlObject,
        read: ImageTexture,
    ) -> Result<ImageTexture, SceneError> {
        match read.image.texels {
            Texels::Rgba8(_) => self.mapped(o, read, "linear", srgb_to_linear),
            Texels::RgbaF32(_) => Ok(read),
        }
    }

    /// Converts a texture to a height map: the luminance of its linear texels.
    pub fn heights(
        &mut self,
        o: &XmlObject,
        read: ImageTexture,
    ) -> Result<ImageTexture, SceneError> {
        let linear = self.linear(o, read)?;
        let image = self
            .images
            .heights(&linear.image)
            .map_err(|problem| o.error(problem))?;
        Ok(ImageTexture { image, ..linear })
    }

    /// Reverses the second component of the normals of a map.
    pub fn green_reversed(
        &mut self,
        o: &XmlObject,
        read: ImageTexture,
    ) -> Result<ImageTexture, SceneError> {
        let reverse = |[r, g, b, a]: [f32; 4]| [r, 1.0 - g, b, a];
        let image = self
            .images
            .derived(&read.image, "green reversed", reverse)
            .map_err(|problem| o.error(problem))?;
        Ok(ImageTexture { image, ..read })
    }

    /// Applies a function to every channel; `how` names it.
    pub fn mapped(
        &mut self,
        o: &XmlObject,
        read: ImageTexture,
        how: &str,
        f: fn(f32) -> f32,
    ) -> Result<ImageTexture, SceneError> {
        let image = self
            .images
            .derived(&read.image, how, |texel| texel.map(f))
            .map_err(|problem| o.error(problem))?;
        Ok(ImageTexture { image, ..read })
    }

    /// Reads a texture. Returns `None`, with a note, if it is not supported, or cannot be read and
    /// the policy allows it.
    pub fn read(
        &mut self,
        o: &Rc<XmlObject>,
        notes: &mut Vec<Note>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        self.nested(o, 0, notes)
    }

    /// Reads a texture that is inside a number of others.
    fn nested(
        &mut self,
        o: &Rc<XmlObject>,
        depth: usize,
        notes: &mut Vec<Note>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        if depth > MAX_NESTING {
            return Err(o.error(format!(
                "textures are nested more than {MAX_NESTING} levels deep"
            )));
        }
        match o.plugin.as_str() {
            "bitmap" => {
                let map = uv_map(o)?;
                self.bitmap(o, map, notes)
            }
            "checkerboard" => self.checkerboard(o, depth, notes),
            "scale" if o.legacy => {
                let Some(inside) = o.children("texture").next() else {
                    notes.push(o.note("a `scale` without a texture is not supported; ignored"));
                    return Ok(None);
                };
                let factor = o.color("scale")?.unwrap_or(Vec3::ONE);
                let Some(read) = self.nested(inside, depth + 1, notes)? else {
                    return Ok(None);
                };
                let zero = TextureValue::Constant(Vec3::ZERO);
                let factor = TextureValue::Constant(factor);
                self.mixed(o, [zero, factor, TextureValue::Image(read)], notes)
            }
            other => {
                let shown = super::values::truncated(other);
                notes.push(o.note(format!("the texture `{shown}` is not supported; ignored")));
                o.mark_all_read();
                Ok(None)
            }
        }
    }

    /// Reads a `checkerboard`, whose colours may be textures.
    fn checkerboard(
        &mut self,
        o: &XmlObject,
        depth: usize,
        notes: &mut Vec<Note>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        let mut colors = [0.4, 0.2].map(|grey| TextureValue::Constant(Vec3::splat(grey)));
        for (color, key) in colors.iter_mut().zip(["color0", "color1"]) {
            if let Some(Property::Object(t)) = o.property(key) {
                if let Some(image) = self.nested(t, depth + 1, notes)? {
                    *color = TextureValue::Image(image);
                }
            } else if let Some(given) = o.color(key)? {
                *color = TextureValue::Constant(given);
            }
        }
        let fields = composed::checkerboard(&mut self.images, uv_map(o)?);
        let fields = TextureValue::Image(fields.map_err(|problem| o.error(problem))?);
        let [first, second] = colors;
        self.mixed(o, [second, first, fields], notes)
    }

    /// Returns the image of `a (1 - t) + b t` of textures `[a, b, t]`.
    fn mixed(
        &mut self,
        o: &XmlObject,
        values: [TextureValue; 3],
        notes: &mut Vec<Note>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        let note = &mut |message| notes.push(o.note(message));
        match composed::mixed(&mut self.images, values, note) {
            Ok(TextureValue::Image(image)) => Ok(Some(image)),
            Ok(TextureValue::Constant(_)) => Ok(None),
            Err(problem) => Err(o.error(problem)),
        }
    }

    /// Reads a `bitmap`.
    fn bitmap(
        &mut self,
        o: &XmlObject,
        map: Affine2,
        notes: &mut Vec<Note>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        let Some(file) = o.text("filename")? else {
            return Err(o.error("a bitmap needs a `filename`"));
        };
        let decoding = decoding(o)?;
        let filter = match o.text("filter_type")? {
            Some("nearest") => TextureFilter::Nearest,
            None | Some("bilinear" | "trilinear" | "ewa") => TextureFilter::Bilinear,
            Some(_) => {
                notes.push(o.note("this `filter_type` is not supported; `bilinear` is used"));
                TextureFilter::Bilinear
            }
        };
        let both = wrap_mode(o, "wrap_mode", Wrap::Repeat, notes)?;
        let wrap = [
            wrap_mode(o, "wrap_mode_u", both, notes)?,
            wrap_mode(o, "wrap_mode_v", both, notes)?,
        ];
        o.mark_read(&["format", "accel", "cache", "max_anisotropy"]);
        Ok(self
            .image(o, file, decoding, notes)?
            .map(|image| ImageTexture {
                image,
                wrap,
                filter,
                map,
            }))
    }

    /// Returns the image of a file beside the scene. Texels that are not in sRGB are converted to
    /// floats, which no slot decodes.
    pub fn image(
        &mut self,
        o: &XmlObject,
        file: &str,
        decoding: Decoding,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let path = o.find_file(file);
        let image = match self.images.load(&path, notes) {
            Ok(image) => image,
            Err(e) if self.missing == MissingTextures::Note => {
                notes.push(o.note(format!("{e}; the texture is ignored")));
                return Ok(None);
            }
            Err(e) => return Err(with_lenient_hint(o.error(e.to_string()))),
        };
        let eight_bits = matches!(image.texels, Texels::Rgba8(_));
        let decoded = match decoding {
            Decoding::Srgb => return Ok(Some(image)),
            Decoding::Gamma(gamma) if gamma != 1.0 && eight_bits => {
                let power = |[r, g, b, a]: [f32; 4]| {
                    let [r, g, b] = [r, g, b].map(|x| x.powf(gamma));
                    [r, g, b, a]
                };
                self.images
                    .derived(&image, &format!("gamma {gamma}"), power)
            }
            Decoding::Gamma(_) => self.images.derived(&image, "raw", |texel| texel),
        };
        decoded.map(Some).map_err(|problem| o.error(problem))
    }
}

/// Decoding of the 8-bit texels of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Decoding {
    /// They are in sRGB where a slot holds colours.
    Srgb,
    /// They are powers with this exponent of the texels as stored; 1 is linear.
    Gamma(f32),
}

/// Returns the decoding of an image: `raw`, or `gamma` of version 0.6, where 1 is linear and -1 is
/// that of the file.
pub(super) fn decoding(o: &XmlObject) -> Result<Decoding, SceneError> {
    let raw = o.flag("raw", false)?;
    let gamma = o.number("gamma", -1.0)?;
    if raw {
        return Ok(Decoding::Gamma(1.0));
    }
    if gamma <= 0.0 {
        return Ok(Decoding::Srgb);
    }
    if gamma > 100.0 {
        return Err(o.error(format!("`gamma` must be at most 100, found {gamma}")));
    }
    Ok(Decoding::Gamma(gamma as f32))
}

/// Returns the map of texture coordinates that start at the bottom left: `to_uv`, or factors and
/// offsets of version 0.6, where coordinates start at the top left.
fn uv_map(o: &XmlObject) -> Result<Affine2, SceneError> {
    let [u_scale, v_scale, u_offset, v_offset] = [
        ("uscale", 1.0),
        ("vscale", 1.0),
        ("uoffset", 0.0),
        ("voffset", 0.0),
    ]
    .map(|(name, default)| o.number(name, default));
    let scale = DVec3::new(u_scale?, v_scale?, 1.0);
    let offset = DVec3::new(u_offset?, v_offset?, 0.0);
    let own = DAffine3::from_translation(offset) * DAffine3::from_scale(scale);
    let to_uv = o.transform("to_uv")? * own;
    let (to, t) = (to_uv.matrix3.as_mat3(), to_uv.translation.as_vec3());
    // Substitute v = 1 - v' on both sides of u' = a u + b v + tx, v' = c u + d v + ty.
    let (a, b, c, d) = (to.x_axis.x, to.y_axis.x, to.x_axis.y, to.y_axis.y);
    let is_uniform = b == 0.0 && c == 0.0 && (a - d).abs() <= 1e-6 * a.abs();
    let map = Affine2 {
        matrix2: Mat2::from_cols_array(&[a, -c, -b, if is_uniform { a } else { d }]),
        translation: Vec2::new(b + t.x, 1.0 - d - t.y),
    };
    if !map.is_finite() {
        return Err(o.error("the transform of texture coordinates is not finite"));
    }
    Ok(map)
}

/// Reads the wrap mode of both coordinates or of one.
fn wrap_mode(
    o: &XmlObject,
    key: &str,
    default: Wrap,
    notes: &mut Vec<Note>,
) -> Result<Wrap, SceneError> {
    let Some(mode) = o.text(key)? else {
        return Ok(default);
    };
    Ok(Wrap::from_name(mode).unwrap_or_else(|| {
        notes.push(o.note(format!(
            "`{key}` must be `repeat`, `mirror` or `clamp`; `repeat` is used"
        )));
        Wrap::Repeat
    }))
}
