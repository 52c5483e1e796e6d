//! Textures: `bitmap` and `checkerboard`.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use glam::{Affine2, DAffine3, Mat2, Vec2, Vec3};

use super::tree::{Item, Object};
use crate::scene::compile::srgb_to_linear;
use crate::scene::desc::{Lookup, MaterialDesc, NoInverse, Texels, TextureDesc, TextureSlot, Wrap};
use crate::scene::load::images::Pictures;
use crate::scene::load::{Missing, missing_texture};
use crate::scene::{Note, SceneError};

/// Side of the picture of a checkerboard in texels: edges are blurred over a 128th of a field.
const BOARD: u32 = 256;
/// How many of them with different colours a scene may have: each takes a megabyte.
const MAX_BOARDS: usize = 64;

/// A texture as Mitsuba sees it: coordinates start at the top left, before `to_uv`.
pub(super) struct Read {
    /// The image.
    pub image: Arc<TextureDesc>,
    to_uv: DAffine3,
    wrap: Wrap,
}

impl Read {
    /// Puts the picture into a slot of a material. A factor and an offset of the first texture become the material's own;
    /// whatever else `to_uv` says is the texture's.
    ///
    /// # Errors
    /// Where the first texture was laid so that no other one can be laid beside it: this one lies as that one then.
    pub fn lay(self, m: &mut MaterialDesc, slot: TextureSlot) -> Result<(), NoInverse> {
        let (to, t) = (self.to_uv.matrix3.as_mat3(), self.to_uv.translation.as_vec3());
        // For coordinates that start at the bottom left: with v = 1 - v' on both sides of u' = a u + b v + tx,
        // v' = c u + d v + ty.
        let (a, b, c, d) = (to.x_axis.x, to.y_axis.x, to.x_axis.y, to.y_axis.y);
        let even = b == 0.0 && c == 0.0 && (a - d).abs() <= 1e-6 * a.abs();
        let own = Affine2 {
            matrix2: Mat2::from_cols_array(&[a, -c, -b, if even { a } else { d }]),
            translation: Vec2::new(b + t.x, 1.0 - d - t.y),
        };
        if m.textures.is_empty() && even {
            (m.tiling, m.uv_offset) = (a, own.translation);
        }
        let tiling = Affine2::from_scale_angle_translation(Vec2::splat(m.tiling), 0.0, m.uv_offset);
        m.set_texture(slot, Some(self.image));
        let map = Lookup::beside(tiling, own);
        m.set_lookup(slot, Lookup { wrap: [self.wrap; 2], second: false, map: map.unwrap_or(None) });
        map.map(|_| ())
    }
}

/// The images that were read or made.
pub(super) struct Textures {
    pictures: Pictures,
    /// Checkerboards by the bits of their colours.
    boards: BTreeMap<[u32; 6], Arc<TextureDesc>>,
    missing: Missing,
}

impl Textures {
    /// None yet.
    pub fn new(missing: Missing) -> Textures {
        Textures { pictures: Pictures::default(), boards: BTreeMap::new(), missing }
    }

    /// The same texels for a role in which they are numbers: Mitsuba decodes them from sRGB unless they are `raw`, and
    /// here such roles take them as stored.
    pub fn linear(&mut self, o: &Object, read: Read) -> Result<Read, SceneError> {
        match read.image.texels {
            Texels::Rgba8(_) => self.mapped(o, read, "linear", srgb_to_linear),
            Texels::RgbaF32(_) => Ok(read),
        }
    }

    /// As heights: the luminance of linear texels.
    pub fn heights(&mut self, o: &Object, read: Read) -> Result<Read, SceneError> {
        let linear = self.linear(o, read)?;
        let image = self.pictures.heights(&linear.image).map_err(|problem| o.error(problem))?;
        Ok(Read { image, ..linear })
    }

    /// With a function of every channel, which `how` names.
    pub fn mapped(&mut self, o: &Object, read: Read, how: &str, f: fn(f32) -> f32) -> Result<Read, SceneError> {
        let image = self.pictures.made(&read.image, how, |texel| texel.map(f)).map_err(|problem| o.error(problem))?;
        Ok(Read { image, ..read })
    }

    /// Reads a texture; `None` where it is not known, or cannot be read and that is allowed, with a note.
    pub fn read(&mut self, o: &Rc<Object>, notes: &mut Vec<Note>) -> Result<Option<Read>, SceneError> {
        let to_uv = o.map("to_uv")?;
        match o.kind.as_str() {
            "bitmap" => {
                let Some(file) = o.text("filename")? else { return Err(o.error("a bitmap needs a `filename`")) };
                let raw = o.flag("raw", false)?;
                if o.text("filter_type")?.is_some_and(|said| !["bilinear", "trilinear", "ewa"].contains(&said)) {
                    notes.push(o.note("textures are bilinear: `filter_type` is ignored"));
                }
                let wrap = match o.text("wrap_mode")? {
                    None => Wrap::Repeat,
                    Some(said) => Wrap::ALL.into_iter().find(|wrap| wrap.word() == said).unwrap_or_else(|| {
                        notes.push(o.note("known are `repeat`, `mirror` and `clamp`: `wrap_mode` is ignored"));
                        Wrap::Repeat
                    }),
                };
                o.known(&["format", "accel", "gamma", "cache", "max_anisotropy", "wrap_mode_u", "wrap_mode_v"]);
                Ok(self.image(o, file, raw, notes)?.map(|image| Read { image, to_uv, wrap }))
            }
            "checkerboard" => {
                let mut colors = [Vec3::splat(0.4), Vec3::splat(0.2)];
                for (color, key) in colors.iter_mut().zip(["color0", "color1"]) {
                    if let Some(Item::Object(_)) = o.item(key) {
                        notes.push(
                            o.note(format!("`{key}` of a checkerboard is a colour here, not a texture: ignored")),
                        );
                    } else if let Some(said) = o.color(key)? {
                        *color = said;
                    }
                }
                let key = [colors[0].to_array().map(f32::to_bits), colors[1].to_array().map(f32::to_bits)];
                let key = std::array::from_fn(|i| key[i / 3][i % 3]);
                if !self.boards.contains_key(&key) && self.boards.len() >= MAX_BOARDS {
                    return Err(o.error(format!("checkerboards of more than {MAX_BOARDS} pairs of colours")));
                }
                let image = self.boards.entry(key).or_insert_with(|| board(colors)).clone();
                Ok(Some(Read { image, to_uv, wrap: Wrap::Repeat }))
            }
            other => {
                let shown = super::values::shorten(other);
                notes.push(o.note(format!("the texture `{shown}` is not known: it is left out")));
                o.known(&o.items.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
                Ok(None)
            }
        }
    }

    /// The image of a file beside the scene; raw ones are made floats, which no role decodes from sRGB.
    pub fn image(
        &mut self,
        o: &Object,
        file: &str,
        raw: bool,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let path = super::beside(o, file);
        let image = match self.pictures.load(&path, notes) {
            Ok(image) => image,
            Err(e) if self.missing == Missing::Noted => {
                notes.push(o.note(format!("{e}: left out")));
                return Ok(None);
            }
            Err(e) => return Err(missing_texture(o.error(e.to_string()))),
        };
        if raw {
            return self.pictures.made(&image, "raw", |texel| texel).map(Some).map_err(|problem| o.error(problem));
        }
        Ok(Some(image))
    }
}

/// A board of 2 by 2 fields; the first colour has the corner where texture coordinates start.
fn board(colors: [Vec3; 2]) -> Arc<TextureDesc> {
    let field = |x: u32, y: u32| usize::from((x < BOARD / 2) != (y < BOARD / 2));
    let at = |i: u32| {
        let c = colors[field(i % BOARD, i / BOARD)];
        [c.x, c.y, c.z, 1.0]
    };
    Arc::new(TextureDesc::new("", BOARD, BOARD, Texels::RgbaF32((0..BOARD * BOARD).map(at).collect())))
}
