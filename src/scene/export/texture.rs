//! Textures as files: PNG where eight bits say it all, OpenEXR where they do not.

use std::collections::BTreeMap;

use exr::prelude::{Encoding, Image as ExrImage, Layer, LayerAttributes, SpecificChannels, WritableImage};
use glam::{Affine2, DAffine3, Vec2, Vec3};
use image::ExtendedColorType;

use super::Folder;
use crate::scene::SceneError;
use crate::scene::compile::srgb_to_linear;
use crate::scene::desc::{Lookup, MaterialDesc, Texels, TextureDesc, TextureSlot, Wrap};
use crate::scene::export::xml::Xml;

/// What a surface wants of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Use {
    /// Its colours, each at most 1, times a factor.
    Color(Vec3),
    /// Light: its colours times a factor.
    Light(Vec3),
    /// The square root of its colours times a factor, each at most 1.
    Root(Vec3),
    /// Its red channel.
    Number,
    /// Its red channel, whatever its range.
    Height,
    /// The square of its red channel.
    Square,
    /// One minus its red channel.
    Rest,
    /// One where its red channel is at least this, else nothing.
    Step(f32),
    /// A normal whose slope is scaled.
    Normal(f32),
}

impl Use {
    /// Bits by which one use is told from another.
    fn key(self) -> [u32; 4] {
        let color = |tag: u32, c: Vec3| [tag, c.x.to_bits(), c.y.to_bits(), c.z.to_bits()];
        match self {
            Use::Color(c) => color(0, c),
            Use::Light(c) => color(1, c),
            Use::Root(c) => color(2, c),
            Use::Number => [3, 0, 0, 0],
            Use::Square => [4, 0, 0, 0],
            Use::Rest => [5, 0, 0, 0],
            Use::Step(at) => [6, at.to_bits(), 0, 0],
            Use::Normal(by) => [7, by.to_bits(), 0, 0],
            Use::Height => [8, 0, 0, 0],
        }
    }

    /// Whether eight bits are decoded from sRGB.
    fn is_color(self) -> bool {
        matches!(self, Use::Color(_) | Use::Light(_) | Use::Root(_))
    }

    /// Whether texels are used as they are stored.
    fn as_stored(self) -> bool {
        match self {
            Use::Color(c) | Use::Light(c) => c == Vec3::ONE,
            Use::Normal(by) => by == 1.0,
            Use::Number | Use::Height => true,
            _ => false,
        }
    }

    /// A linear texel in this use.
    fn apply(self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        let unit = |c: Vec3| c.clamp(Vec3::ZERO, Vec3::ONE);
        let c = Vec3::new(r, g, b);
        match self {
            Use::Color(by) => unit(unit(c) * by).to_array(),
            Use::Light(by) => (c.max(Vec3::ZERO) * by).to_array(),
            Use::Root(by) => unit(unit(c) * by).map(f32::sqrt).to_array(),
            Use::Number => [r.clamp(0.0, 1.0); 3],
            Use::Height => [r; 3],
            Use::Square => [r.clamp(0.0, 1.0).powi(2); 3],
            Use::Rest => [1.0 - r.clamp(0.0, 1.0); 3],
            Use::Step(at) => [if r < at { 0.0 } else { 1.0 }; 3],
            Use::Normal(by) => {
                let n = unit(c) * 2.0 - 1.0;
                // One scale for all texels, so that what lies between them is as steep.
                (Vec3::new(n.x * by, n.y * by, n.z) / by.max(1.0) * 0.5 + 0.5).to_array()
            }
        }
    }
}

/// The textures that were written.
#[derive(Default)]
pub(super) struct Textures {
    files: BTreeMap<([u8; 32], [u32; 4]), String>,
}

impl Textures {
    /// Writes the texture in a slot of a material, once for each use, and names it in the document as `name`, laid as the
    /// material says. Without a texture nothing is written.
    pub fn write(
        &mut self,
        xml: &mut Xml,
        name: &str,
        material: &MaterialDesc,
        slot: TextureSlot,
        of: Use,
        folder: &mut Folder,
    ) -> Result<(), SceneError> {
        let Some(image) = material.texture(slot) else { return Ok(()) };
        let file = self.file(image, of, folder)?;
        xml.open("texture", &[("type", "bitmap"), ("name", name)]);
        xml.value("string", "filename", &file);
        if !of.is_color() {
            xml.value("boolean", "raw", true);
        }
        let Lookup { wrap: [wrap, _], map, .. } = material.lookup(slot);
        if wrap != Wrap::Repeat {
            xml.value("string", "wrap_mode", wrap.word());
        }
        let (scale, offset) = (material.tiling, material.uv_offset);
        if let Some(map) = map {
            let whole = map * Affine2::from_scale_angle_translation(Vec2::splat(scale), 0.0, offset);
            let ([a, b, c, d], t) = (whole.matrix2.to_cols_array(), whole.translation);
            // Coordinates there start at the top left.
            let columns = [a, -b, 0.0, -c, d, 0.0, 0.0, 0.0, 1.0, c + t.x, 1.0 - d - t.y, 0.0];
            xml.place("to_uv", &DAffine3::from_cols_array(&columns.map(f64::from)));
        } else if (scale, offset.to_array()) != (1.0, [0.0; 2]) {
            // Coordinates there start at the top left: 1 - (s (1 - v) + y) = s v + (1 - s - y).
            let [s, x, y] = [scale, offset.x, 1.0 - scale - offset.y].map(|x| x.to_string());
            xml.open("transform", &[("name", "to_uv")]);
            xml.leaf("scale", &[("x", &s), ("y", &s)]);
            xml.leaf("translate", &[("x", &x), ("y", &y)]);
            xml.close();
        }
        xml.close();
        Ok(())
    }

    /// The file of the map of an environment.
    pub fn around(&mut self, image: &TextureDesc, folder: &mut Folder) -> Result<String, SceneError> {
        self.file(image, Use::Light(Vec3::ONE), folder)
    }

    fn file(&mut self, image: &TextureDesc, of: Use, folder: &mut Folder) -> Result<String, SceneError> {
        let key = (image.content_hash, of.key());
        if let Some(file) = self.files.get(&key) {
            return Ok(file.clone());
        }
        let (bytes, extension) = encode(image, of).map_err(|e| folder.unwritable(&image.file, e))?;
        let stem = image.file.file_stem().map_or("texture".into(), |s| s.to_string_lossy().into_owned());
        let file = folder.write("textures", &stem, extension, &bytes)?;
        self.files.insert(key, file.clone());
        Ok(file)
    }
}

/// The bytes of a picture in a use, and the extension of its format.
fn encode(image: &TextureDesc, of: Use) -> Result<(Vec<u8>, &'static str), String> {
    let size = [image.width, image.height];
    if let (Texels::Rgba8(texels), true) = (&image.texels, of.as_stored()) {
        let (bytes, kind): (Vec<u8>, _) = match of {
            Use::Number | Use::Height => (texels.iter().map(|t| t[0]).collect(), ExtendedColorType::L8),
            _ => (texels.iter().flat_map(|t| [t[0], t[1], t[2]]).collect(), ExtendedColorType::Rgb8),
        };
        return png(size, &bytes, kind).map(|bytes| (bytes, "png"));
    }
    let decode = |x: u8| if of.is_color() { srgb_to_linear(f32::from(x) / 255.0) } else { f32::from(x) / 255.0 };
    let texels: Vec<[f32; 3]> = match &image.texels {
        Texels::Rgba8(t) => t.iter().map(|[r, g, b, _]| of.apply([*r, *g, *b].map(decode))).collect(),
        Texels::RgbaF32(t) => t.iter().map(|[r, g, b, _]| of.apply([*r, *g, *b])).collect(),
    };
    openexr(size, &texels).map(|bytes| (bytes, "exr"))
}

fn png([width, height]: [u32; 2], bytes: &[u8], kind: ExtendedColorType) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut out);
    image::ImageEncoder::write_image(encoder, bytes, width, height, kind).map_err(|e| e.to_string())?;
    Ok(out)
}

fn openexr([width, height]: [u32; 2], texels: &[[f32; 3]]) -> Result<Vec<u8>, String> {
    let size = (width as usize, height as usize);
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = texels[at.y() * size.0 + at.x()];
        (r, g, b)
    });
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::scene::desc::texture_hash;

    fn texture(texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(1, 1, &texels);
        TextureDesc { file: PathBuf::from("t"), width: 1, height: 1, texels, content_hash }
    }

    fn read_back(image: &TextureDesc, of: Use) -> ([f32; 3], &'static str) {
        let (bytes, extension) = encode(image, of).unwrap();
        assert_eq!(encode(image, of).unwrap().0, bytes, "equal input gives equal bytes");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(format!("t.{extension}"));
        std::fs::write(&path, bytes).unwrap();
        match crate::scene::load::texture(&path, &mut Vec::new()).unwrap().texels {
            Texels::Rgba8(t) => ([t[0][0], t[0][1], t[0][2]].map(f32::from), extension),
            Texels::RgbaF32(t) => ([t[0][0], t[0][1], t[0][2]], extension),
        }
    }

    #[test]
    fn eight_bits_stay_as_stored_and_what_is_computed_is_float() {
        let t = texture(Texels::Rgba8(vec![[188, 255, 51, 255]]));
        assert_eq!(read_back(&t, Use::Color(Vec3::ONE)), ([188.0, 255.0, 51.0], "png"));
        assert_eq!(read_back(&t, Use::Number), ([188.0; 3], "png"));
        let (half, extension) = read_back(&t, Use::Color(Vec3::splat(0.5)));
        assert!((half[0] - 0.251_443).abs() < 1e-5 && half[1] == 0.5 && extension == "exr", "{half:?}");
        let red = 188.0f32 / 255.0;
        assert_eq!(read_back(&t, Use::Square).0, [red * red; 3]);
        assert_eq!(read_back(&t, Use::Rest).0, [1.0 - red; 3]);
        assert_eq!((read_back(&t, Use::Step(0.7)).0, read_back(&t, Use::Step(0.8)).0), ([1.0; 3], [0.0; 3]));
    }

    #[test]
    fn surfaces_get_at_most_all_light_and_lights_more() {
        let t = texture(Texels::RgbaF32(vec![[4.0, 0.25, -1.0, 1.0]]));
        assert_eq!(read_back(&t, Use::Color(Vec3::ONE)).0, [1.0, 0.25, 0.0]);
        assert_eq!(read_back(&t, Use::Light(Vec3::splat(2.0))).0, [8.0, 0.5, 0.0]);
        assert_eq!(read_back(&t, Use::Root(Vec3::ONE)).0, [1.0, 0.5, 0.0]);
    }

    #[test]
    fn a_normal_is_as_steep_as_asked_for() {
        let n = Vec3::new(0.6, 0.0, 0.8) * 0.5 + 0.5;
        let t = texture(Texels::RgbaF32(vec![[n.x, n.y, n.z, 1.0]]));
        for by in [2.0, 0.5] {
            let found = Vec3::from(read_back(&t, Use::Normal(by)).0) * 2.0 - 1.0;
            assert!((found.x / found.z - by * 0.75).abs() < 1e-5 && found.y.abs() < 1e-6, "{found}");
        }
    }
}
