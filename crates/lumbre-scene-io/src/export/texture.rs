//! Export of textures: as PNG if 8 bits are exact, else as OpenEXR.

use std::collections::BTreeMap;

use exr::prelude::{
    Encoding, Image as ExrImage, Layer, LayerAttributes, SpecificChannels, WritableImage,
};
use glam::{Affine2, DAffine3, Vec2, Vec3};
use image::ExtendedColorType;

use super::output_folder::OutputFolder;
use crate::export::xml::Xml;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::compile::Curve;
use lumbre_light::scene::desc::{
    Lookup, MaterialDesc, RoughnessTexels, Texels, TextureDesc, TextureFilter, TextureSlot, Wrap,
};

/// Conversion of a texture's texels for a parameter of a surface or light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TexelConversion {
    /// Colours times a factor, each at most 1.
    Color(Vec3),
    /// Radiance: colours times a factor.
    Light(Vec3),
    /// Square root of colours times a factor, each at most 1.
    SquareRoot(Vec3),
    /// Red channel, clamped to 0..=1.
    Number,
    /// Red channel without a limit on its range.
    Height,
    /// Square of the red channel.
    Square,
    /// Square root of the red channel.
    Root,
    /// One minus the red channel.
    OneMinus,
    /// One if the red channel is at least this value, else zero.
    Threshold(f32),
    /// Normal, with its slope scaled by a factor and its second component reversed.
    Normal(f32),
    /// Normal, with its slope scaled by a factor.
    NormalUp(f32),
}

impl TexelConversion {
    /// Returns the conversion of a roughness texture to what the texels of another one mean.
    pub fn of_roughness(from: RoughnessTexels, to: RoughnessTexels) -> TexelConversion {
        match (from, to) {
            (RoughnessTexels::Roughness, RoughnessTexels::Alpha) => TexelConversion::Square,
            (RoughnessTexels::Alpha, RoughnessTexels::Roughness) => TexelConversion::Root,
            _ => TexelConversion::Number,
        }
    }

    /// Returns bits that identify the conversion.
    fn key(self) -> [u32; 4] {
        let color = |tag: u32, c: Vec3| [tag, c.x.to_bits(), c.y.to_bits(), c.z.to_bits()];
        match self {
            TexelConversion::Color(c) => color(0, c),
            TexelConversion::Light(c) => color(1, c),
            TexelConversion::SquareRoot(c) => color(2, c),
            TexelConversion::Number => [3, 0, 0, 0],
            TexelConversion::Square => [4, 0, 0, 0],
            TexelConversion::OneMinus => [5, 0, 0, 0],
            TexelConversion::Threshold(at) => [6, at.to_bits(), 0, 0],
            TexelConversion::Normal(by) => [7, by.to_bits(), 0, 0],
            TexelConversion::Height => [8, 0, 0, 0],
            TexelConversion::NormalUp(by) => [9, by.to_bits(), 0, 0],
            TexelConversion::Root => [10, 0, 0, 0],
        }
    }

    /// Returns whether 8-bit texels are decoded from sRGB.
    fn is_color(self) -> bool {
        matches!(
            self,
            TexelConversion::Color(_) | TexelConversion::Light(_) | TexelConversion::SquareRoot(_)
        )
    }

    /// Returns whether texels are written as stored.
    fn as_stored(self) -> bool {
        match self {
            TexelConversion::Color(c) | TexelConversion::Light(c) => c == Vec3::ONE,
            TexelConversion::Number | TexelConversion::Height => true,
            TexelConversion::NormalUp(by) => by == 1.0,
            _ => false,
        }
    }

    /// Converts a linear texel.
    fn apply(self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        let unit = |c: Vec3| c.clamp(Vec3::ZERO, Vec3::ONE);
        let c = Vec3::new(r, g, b);
        match self {
            TexelConversion::Color(by) => unit(unit(c) * by).to_array(),
            TexelConversion::Light(by) => (c.max(Vec3::ZERO) * by).to_array(),
            TexelConversion::SquareRoot(by) => unit(unit(c) * by).map(f32::sqrt).to_array(),
            TexelConversion::Number => [r.clamp(0.0, 1.0); 3],
            TexelConversion::Height => [r; 3],
            TexelConversion::Square => [r.clamp(0.0, 1.0).powi(2); 3],
            TexelConversion::Root => [r.clamp(0.0, 1.0).sqrt(); 3],
            TexelConversion::OneMinus => [1.0 - r.clamp(0.0, 1.0); 3],
            TexelConversion::Threshold(at) => [if r < at { 0.0 } else { 1.0 }; 3],
            TexelConversion::Normal(by) | TexelConversion::NormalUp(by) => {
                let n = unit(c) * 2.0 - 1.0;
                // The second component is along growing v, which grows from the top in Mitsuba.
                let up = matches!(self, TexelConversion::NormalUp(_));
                let y = if up { n.y } else { -n.y };
                // The same scale for all texels, so that interpolated normals keep their slope.
                (Vec3::new(n.x * by, y * by, n.z) / by.max(1.0) * 0.5 + 0.5).to_array()
            }
        }
    }
}

/// Writer of textures: the files written so far.
#[derive(Default)]
pub(super) struct TextureWriter {
    files: BTreeMap<([u8; 32], [u32; 4]), String>,
}

impl TextureWriter {
    /// Writes the texture of a material's slot, once for each conversion, and refers to it as
    /// `name` in the document, with the material's mapping. Writes nothing if there is no texture.
    pub fn write(
        &mut self,
        xml: &mut Xml,
        name: &str,
        material: &MaterialDesc,
        slot: TextureSlot,
        conversion: TexelConversion,
        folder: &mut OutputFolder,
    ) -> Result<(), SceneError> {
        let Some(image) = material.texture(slot) else {
            return Ok(());
        };
        let file = self.file(image, conversion, folder)?;
        xml.open("texture", &[("type", "bitmap"), ("name", name)]);
        xml.value("string", "filename", &file);
        if !conversion.is_color() {
            xml.value("boolean", "raw", true);
        }
        let Lookup {
            wrap: [wrap, _],
            filter,
            map,
            ..
        } = material.lookup(slot);
        if wrap != Wrap::Repeat {
            xml.value("string", "wrap_mode", wrap.name());
        }
        if filter == TextureFilter::Nearest {
            xml.value("string", "filter_type", filter.name());
        }
        let (scale, offset) = (material.tiling, material.uv_offset);
        if let Some(map) = map {
            let map = map * Affine2::from_scale_angle_translation(Vec2::splat(scale), 0.0, offset);
            let ([a, b, c, d], t) = (map.matrix2.to_cols_array(), map.translation);
            // Mitsuba's coordinates start at the top left.
            let columns = [
                a,
                -b,
                0.0,
                -c,
                d,
                0.0,
                0.0,
                0.0,
                1.0,
                c + t.x,
                1.0 - d - t.y,
                0.0,
            ];
            xml.transform("to_uv", &DAffine3::from_cols_array(&columns.map(f64::from)));
        } else if (scale, offset.to_array()) != (1.0, [0.0; 2]) {
            // Mitsuba's coordinates start at the top left: 1 - (s (1 - v) + y) = s v + (1 - s - y).
            let [s, x, y] = [scale, offset.x, 1.0 - scale - offset.y].map(|x| x.to_string());
            xml.open("transform", &[("name", "to_uv")]);
            xml.leaf("scale", &[("x", &s), ("y", &s)]);
            xml.leaf("translate", &[("x", &x), ("y", &y)]);
            xml.close();
        }
        xml.close();
        Ok(())
    }

    /// Writes the map of an environment; returns its file.
    pub fn environment_map(
        &mut self,
        image: &TextureDesc,
        folder: &mut OutputFolder,
    ) -> Result<String, SceneError> {
        self.file(image, TexelConversion::Light(Vec3::ONE), folder)
    }

    /// Returns the file of a converted image, writing it if it is new.
    pub fn file(
        &mut self,
        image: &TextureDesc,
        conversion: TexelConversion,
        folder: &mut OutputFolder,
    ) -> Result<String, SceneError> {
        let key = (image.content_hash, conversion.key());
        if let Some(file) = self.files.get(&key) {
            return Ok(file.clone());
        }
        let (bytes, extension) =
            encode(image, conversion).map_err(|e| folder.unwritable(&image.file, e))?;
        let stem = image
            .file
            .file_stem()
            .map_or("texture".into(), |s| s.to_string_lossy().into_owned());
        let file = folder.write_unique("textures", &stem, extension, &bytes)?;
        self.files.insert(key, file.clone());
        Ok(file)
    }
}

/// Encodes a converted image; returns its bytes and the extension of the format.
fn encode(
    image: &TextureDesc,
    conversion: TexelConversion,
) -> Result<(Vec<u8>, &'static str), String> {
    let size = [image.width, image.height];
    if let (Texels::Rgba8(texels), true) = (&image.texels, conversion.as_stored()) {
        let (bytes, kind): (Vec<u8>, _) = match conversion {
            TexelConversion::Number | TexelConversion::Height => {
                (texels.iter().map(|t| t[0]).collect(), ExtendedColorType::L8)
            }
            _ => (
                texels.iter().flat_map(|t| [t[0], t[1], t[2]]).collect(),
                ExtendedColorType::Rgb8,
            ),
        };
        return png(size, &bytes, kind).map(|bytes| (bytes, "png"));
    }
    let curve = Curve::of(conversion.is_color());
    let decode = |x: u8| curve.decode(x);
    let texels: Vec<[f32; 3]> = match &image.texels {
        Texels::Rgba8(t) => t
            .iter()
            .map(|[r, g, b, _]| conversion.apply([*r, *g, *b].map(decode)))
            .collect(),
        Texels::RgbaF32(t) => t
            .iter()
            .map(|[r, g, b, _]| conversion.apply([*r, *g, *b]))
            .collect(),
    };
    openexr(size, &texels).map(|bytes| (bytes, "exr"))
}

/// Encodes a PNG.
fn png(
    [width, height]: [u32; 2],
    bytes: &[u8],
    kind: ExtendedColorType,
) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut out);
    image::ImageEncoder::write_image(encoder, bytes, width, height, kind)
        .map_err(|e| e.to_string())?;
    Ok(out)
}

/// Encodes an OpenEXR image.
fn openexr([width, height]: [u32; 2], texels: &[[f32; 3]]) -> Result<Vec<u8>, String> {
    let size = (width as usize, height as usize);
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = texels[at.y() * size.0 + at.x()];
        (r, g, b)
    });
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        channels,
    );
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use lumbre_light::scene::desc::texture_hash;

    fn texture(texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(1, 1, &texels);
        TextureDesc {
            file: PathBuf::from("t"),
            width: 1,
            height: 1,
            texels,
            content_hash,
        }
    }

    fn read_back(image: &TextureDesc, conversion: TexelConversion) -> ([f32; 3], &'static str) {
        let (bytes, extension) = encode(image, conversion).unwrap();
        assert_eq!(
            encode(image, conversion).unwrap().0,
            bytes,
            "equal input gives equal bytes"
        );
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(format!("t.{extension}"));
        std::fs::write(&path, bytes).unwrap();
        match crate::load::texture(&path, &mut Vec::new()).unwrap().texels {
            Texels::Rgba8(t) => ([t[0][0], t[0][1], t[0][2]].map(f32::from), extension),
            Texels::RgbaF32(t) => ([t[0][0], t[0][1], t[0][2]], extension),
        }
    }

    #[test]
    fn eight_bit_texels_are_stored_unchanged_and_computed_ones_are_floats() {
        let t = texture(Texels::Rgba8(vec![[188, 255, 51, 255]].into()));
        assert_eq!(
            read_back(&t, TexelConversion::Color(Vec3::ONE)),
            ([188.0, 255.0, 51.0], "png")
        );
        assert_eq!(read_back(&t, TexelConversion::Number), ([188.0; 3], "png"));
        let (half, extension) = read_back(&t, TexelConversion::Color(Vec3::splat(0.5)));
        assert!(
            (half[0] - 0.251_443).abs() < 1e-5 && half[1] == 0.5 && extension == "exr",
            "{half:?}"
        );
        let red = 188.0f32 / 255.0;
        assert_eq!(read_back(&t, TexelConversion::Square).0, [red * red; 3]);
        assert_eq!(read_back(&t, TexelConversion::OneMinus).0, [1.0 - red; 3]);
        assert_eq!(
            (
                read_back(&t, TexelConversion::Threshold(0.7)).0,
                read_back(&t, TexelConversion::Threshold(0.8)).0
            ),
            ([1.0; 3], [0.0; 3])
        );
    }

    #[test]
    fn surfaces_are_clamped_to_one_and_lights_are_not() {
        let t = texture(Texels::RgbaF32(vec![[4.0, 0.25, -1.0, 1.0]]));
        assert_eq!(
            read_back(&t, TexelConversion::Color(Vec3::ONE)).0,
            [1.0, 0.25, 0.0]
        );
        assert_eq!(
            read_back(&t, TexelConversion::Light(Vec3::splat(2.0))).0,
            [8.0, 0.5, 0.0]
        );
        assert_eq!(
            read_back(&t, TexelConversion::SquareRoot(Vec3::ONE)).0,
            [1.0, 0.5, 0.0]
        );
    }

    #[test]
    fn normals_have_the_requested_slope() {
        let n = Vec3::new(0.6, 0.2, 0.8) * 0.5 + 0.5;
        let t = texture(Texels::RgbaF32(vec![[n.x, n.y, n.z, 1.0]]));
        for by in [2.0, 0.5] {
            let found = Vec3::from(read_back(&t, TexelConversion::Normal(by)).0) * 2.0 - 1.0;
            // Green points down in Mitsuba.
            assert!(
                (found.x / found.z - by * 0.75).abs() < 1e-5
                    && (found.y / found.z + by * 0.25).abs() < 1e-5,
                "{found}"
            );
        }
    }
}
