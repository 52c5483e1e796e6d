//! Texture images: PNG, JPEG, BMP, TGA, WebP and Radiance HDR files through the `image` crate, and
//! OpenEXR, within limits on their size.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use image::{ColorType, DynamicImage, ImageDecoder, ImageReader, Limits};

use super::{canonical, openexr, primaries, read_file, unreadable};
use lumbre_light::math::luminance::luminance_f32;
use lumbre_light::scene::compile::Curve;
use lumbre_light::scene::desc::{Texels, TextureDesc};
use lumbre_light::scene::{Note, SceneError};

/// Greatest width or height of a texture in pixels.
const MAX_TEXTURE_SIDE: u32 = 16_384;
/// Greatest memory for decoding one texture, in bytes.
const MAX_TEXTURE_BYTES: u64 = 1 << 30;
/// Greatest ratio of a decoded texture to its file: twice what PNG, which has the best compression
/// of these formats, achieves for an image of one colour.
const MAX_GROWTH: u64 = 2048;
/// Memory for decoding a texture that is allowed for a file of any size, in bytes.
const SMALL_TEXTURE_BYTES: u64 = 16 << 20;

/// Returns the greatest memory for decoding a file of this size, in bytes.
fn decode_budget(file_bytes: usize) -> u64 {
    (file_bytes as u64)
        .saturating_mul(MAX_GROWTH)
        .saturating_add(SMALL_TEXTURE_BYTES)
        .min(MAX_TEXTURE_BYTES)
}

/// Greatest ratio of all derived images to the images that were read: deriving a float image from
/// an 8-bit one for every use multiplies its size by four.
const MAX_DERIVED_RATIO: u64 = 64;
/// Memory for derived images that is always allowed, in bytes.
const SMALL_DERIVED_BYTES: u64 = 256 << 20;

/// The images of one scene, each file read once, and images derived from them.
#[derive(Default)]
pub(super) struct ImageCache {
    /// Images by canonical path.
    files: BTreeMap<PathBuf, Arc<TextureDesc>>,
    /// Derived images by the content hash of their source and the name of the function.
    derived: BTreeMap<([u8; 32], String), Arc<TextureDesc>>,
    /// Size of all images read, in bytes.
    read_bytes: u64,
    /// Size of all derived images, in bytes.
    derived_bytes: u64,
}

impl ImageCache {
    /// Returns the image of a file, reading it like [`load`] unless it was read before.
    ///
    /// # Errors
    /// Fails like [`load`].
    pub fn load(
        &mut self,
        path: &Path,
        notes: &mut Vec<Note>,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        let key = canonical(path);
        if let Some(known) = self.files.get(&key) {
            return Ok(known.clone());
        }
        let texture = Arc::new(load(path, notes)?);
        self.read_bytes += texel_bytes(&texture.texels);
        self.files.insert(key, texture.clone());
        Ok(texture)
    }

    /// Decodes an image embedded in a file of `file_bytes` bytes; embedded images may overlap.
    ///
    /// # Errors
    /// Fails like [`load`], and if all embedded images together are too large for the file's size.
    pub fn load_embedded(
        &mut self,
        path: &Path,
        bytes: Vec<u8>,
        file_bytes: u64,
        notes: &mut Vec<Note>,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        let texture = Arc::new(decode(path, bytes, notes)?);
        self.read_bytes += texel_bytes(&texture.texels);
        if self.read_bytes
            > file_bytes
                .saturating_mul(MAX_GROWTH)
                .saturating_add(SMALL_TEXTURE_BYTES)
        {
            let problem = format!(
                "the embedded images decode to {} MiB, too much for the size of the file",
                self.read_bytes >> 20
            );
            return Err(SceneError::malformed(path, "images", problem));
        }
        Ok(texture)
    }

    /// Returns a float image derived from another one texel by texel, computing it unless it was
    /// derived before; `how` names the function.
    ///
    /// # Errors
    /// Returns a message if all derived images are too large for the images that were read.
    pub fn derived(
        &mut self,
        from: &TextureDesc,
        how: &str,
        f: impl Fn([f32; 4]) -> [f32; 4],
    ) -> Result<Arc<TextureDesc>, String> {
        let key = (from.content_hash, how.to_owned());
        let texels = || match &from.texels {
            Texels::Rgba8(t) => t
                .iter()
                .map(|p| f(p.map(|c| f32::from(c) / 255.0)))
                .collect(),
            Texels::RgbaF32(t) => t.iter().map(|p| f(*p)).collect(),
        };
        self.computed(key, (&from.file, [from.width, from.height]), texels)
    }

    /// Returns a float image of a size in which every texel is computed from the texels of two
    /// colour images at its place, linear. Nothing is interpolated.
    ///
    /// # Errors
    /// Fails like [`ImageCache::derived`].
    pub fn combined(
        &mut self,
        images: [&TextureDesc; 2],
        [width, height]: [u32; 2],
        how: &str,
        f: impl Fn([f32; 4], [f32; 4]) -> [f32; 4],
    ) -> Result<Arc<TextureDesc>, String> {
        let [first, second] = images;
        let how = format!("{how} {width} {height} {:?}", second.content_hash);
        let texel = |image: &TextureDesc, x: u32, y: u32| {
            let scaled = |at: u32, to: u32, of: u32| u64::from(at) * u64::from(to) / u64::from(of);
            let row = scaled(y, image.height, height) * u64::from(image.width);
            let at = (row + scaled(x, image.width, width)) as usize;
            match &image.texels {
                Texels::Rgba8(t) => {
                    let [r, g, b, a] = t[at];
                    let [r, g, b] = [r, g, b].map(|c| Curve::Srgb.decode(c));
                    [r, g, b, f32::from(a) / 255.0]
                }
                Texels::RgbaF32(t) => t[at],
            }
        };
        let row = |y| (0..width).map(move |x| [x, y]);
        let texels = || {
            let places = (0..height).flat_map(row);
            places
                .map(|[x, y]| f(texel(first, x, y), texel(second, x, y)))
                .collect()
        };
        self.computed(
            (first.content_hash, how),
            (&first.file, [width, height]),
            texels,
        )
    }

    /// Returns a float image whose texels are computed from their columns and rows, unless it was
    /// computed before; `how` names the function.
    ///
    /// # Errors
    /// Fails like [`ImageCache::derived`], and for values that are not finite.
    pub fn generated(
        &mut self,
        how: &str,
        file: &Path,
        [width, height]: [u32; 2],
        f: impl Fn(u32, u32) -> Vec3,
    ) -> Result<Arc<TextureDesc>, String> {
        let row = |y| (0..width).map(move |x| [x, y]);
        let places = (0..height).flat_map(row);
        let texels = || {
            places
                .map(|[x, y]| f(x, y).extend(1.0).to_array())
                .collect()
        };
        let image = self.computed(([0; 32], how.to_owned()), (file, [width, height]), texels)?;
        match &image.texels {
            Texels::RgbaF32(t) if t.as_flattened().iter().all(|x| x.is_finite()) => Ok(image),
            _ => Err("the computed image has values that are not finite".to_owned()),
        }
    }

    /// Returns a derived image by its key, computing its texels unless it was derived before.
    fn computed(
        &mut self,
        key: ([u8; 32], String),
        (file, [width, height]): (&Path, [u32; 2]),
        texels: impl FnOnce() -> Vec<[f32; 4]>,
    ) -> Result<Arc<TextureDesc>, String> {
        if let Some(known) = self.derived.get(&key) {
            return Ok(known.clone());
        }
        let bytes = self.derived_bytes + 16 * u64::from(width) * u64::from(height);
        let most = self.read_bytes.saturating_mul(MAX_DERIVED_RATIO);
        if bytes > most.saturating_add(SMALL_DERIVED_BYTES) {
            return Err(format!(
                "converted textures would take {} MiB, too much for the size of their images",
                bytes >> 20
            ));
        }
        self.derived_bytes = bytes;
        let texture = Arc::new(TextureDesc::new(
            file,
            width,
            height,
            Texels::RgbaF32(texels()),
        ));
        self.derived.insert(key, texture.clone());
        Ok(texture)
    }

    /// Returns a height map of one channel: coloured images are converted to luminance [ITU-R
    /// BT.709].
    ///
    /// # Errors
    /// Fails like [`ImageCache::derived`].
    pub fn heights(&mut self, image: &Arc<TextureDesc>) -> Result<Arc<TextureDesc>, String> {
        if is_grey(image) {
            return Ok(Arc::clone(image));
        }
        self.derived(image, "heights", |[r, g, b, _]| {
            let y = luminance_f32([r, g, b]);
            [y, y, y, 1.0]
        })
    }
}

/// Returns whether all texels of an image are grey.
pub(super) fn is_grey(image: &TextureDesc) -> bool {
    match &image.texels {
        Texels::Rgba8(t) => t.iter().all(|[r, g, b, _]| r == g && g == b),
        Texels::RgbaF32(t) => t.iter().all(|[r, g, b, _]| r == g && g == b),
    }
}

/// Returns the size of texels in bytes.
fn texel_bytes(texels: &Texels) -> u64 {
    match texels {
        Texels::Rgba8(t) => 4 * t.len() as u64,
        Texels::RgbaF32(t) => 16 * t.len() as u64,
    }
}

/// Reads an image file. Its format is recognised by its first bytes or, if they are ambiguous, by
/// its extension.
///
/// 8-bit channels are stored unchanged; Radiance HDR and OpenEXR files become floats. 16-bit
/// channels are rounded to 8 bits, with a [`Note`].
///
/// # Errors
/// Fails for a file that cannot be read, has no supported format, is damaged, or exceeds the limits
/// on its size.
pub fn load(path: &Path, notes: &mut Vec<Note>) -> Result<TextureDesc, SceneError> {
    decode(path, read_file(path, MAX_TEXTURE_BYTES)?, notes)
}

/// Decodes the bytes of an image like [`load`]. The path is for messages, and its extension
/// identifies formats without a signature.
///
/// # Errors
/// Fails like [`load`].
pub(super) fn decode(
    path: &Path,
    bytes: Vec<u8>,
    notes: &mut Vec<Note>,
) -> Result<TextureDesc, SceneError> {
    let malformed = |problem: String| {
        SceneError::malformed(
            path,
            "image",
            format!(
                "{problem} (supported: PNG, JPEG, BMP, TGA, WebP, HDR and EXR files of at most \
             {MAX_TEXTURE_SIDE} pixels per side)"
            ),
        )
    };
    if bytes.starts_with(&openexr::MAGIC) {
        return decode_exr(path, &bytes, notes).map_err(malformed);
    }
    let bytes = with_radiance_signature(bytes);
    let budget = decode_budget(bytes.len());
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| unreadable(path, e))?;
    if reader.format().is_none()
        && let Ok(format) = image::ImageFormat::from_path(path)
    {
        reader.set_format(format);
    }
    let mut limits = Limits::no_limits();
    limits.max_image_width = Some(MAX_TEXTURE_SIDE);
    limits.max_image_height = Some(MAX_TEXTURE_SIDE);
    limits.max_alloc = Some(budget);
    let failed = |e: image::ImageError| malformed(e.to_string());
    reader.limits(limits.clone());
    let mut decoder = reader.into_decoder().map_err(failed)?;
    limits.reserve(decoder.total_bytes()).map_err(failed)?;
    decoder.set_limits(limits).map_err(failed)?;
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    let has_floats = matches!(color, ColorType::Rgb32F | ColorType::Rgba32F);
    let texel_bytes = if has_floats { 16 } else { 4 };
    let texels = texel_bytes * u64::from(width) * u64::from(height);
    ensure_memory(width, height, decoder.total_bytes() + texels).map_err(malformed)?;
    let image = DynamicImage::from_decoder(decoder).map_err(failed)?;
    if width == 0 || height == 0 {
        return Err(malformed("the image has no pixels".to_owned()));
    }
    if has_floats {
        let texels = into_texels(image.into_rgba32f().into_raw());
        let texels = finite_texels(texels).map_err(malformed)?;
        return Ok(TextureDesc::new(path, width, height, texels));
    }
    if color.bytes_per_pixel() > color.channel_count() {
        notes.push(Note::new(
            path,
            "image",
            "the image has 16 bits per channel; they are rounded to 8",
        ));
    }
    let texels = Texels::Rgba8(shared_texels(image));
    Ok(TextureDesc::new(path, width, height, texels))
}

/// Signatures of Radiance HDR files: that of the format, which the decoder knows, and that of files
/// written by `rgbe.c`, OpenCV and others.
const RADIANCE_SIGNATURES: [&[u8]; 2] = [b"#?RADIANCE", b"#?RGBE"];

/// Replaces the second signature of Radiance HDR files by the first; nothing else differs.
fn with_radiance_signature(bytes: Vec<u8>) -> Vec<u8> {
    let [known, other] = RADIANCE_SIGNATURES;
    match bytes.strip_prefix(other) {
        Some(rest) if rest.first().is_some_and(u8::is_ascii_whitespace) => [known, rest].concat(),
        _ => bytes,
    }
}

/// Checks that the bytes for decoding an image are available: the decoded image and its texels. A
/// failed allocation inside a decoder would end the program.
fn ensure_memory(width: u32, height: u32, bytes: u64) -> Result<(), String> {
    let whole = usize::try_from(bytes).unwrap_or(usize::MAX);
    Vec::<u8>::new().try_reserve_exact(whole).map_err(|_| {
        format!(
            "an image of {width}x{height} pixels needs {} MiB of memory, which is not available",
            bytes >> 20
        )
    })
}

/// Decodes an OpenEXR image.
fn decode_exr(path: &Path, bytes: &[u8], notes: &mut Vec<Note>) -> Result<TextureDesc, String> {
    // A decoded pixel takes four floats.
    let max_pixels = (decode_budget(bytes.len()) / 16) as usize;
    let openexr::ExrTexture {
        image,
        one_of,
        converted,
    } = openexr::decode_texture(bytes, max_pixels)?;
    if converted {
        notes.push(Note::new(path, "image", primaries::CONVERTED));
    }
    if let Some(group) = one_of {
        let shown: String = group.chars().take(48).collect();
        notes.push(Note::new(
            path,
            "image",
            format!("of several groups of channels only `{shown}` is used"),
        ));
    }
    if image.width.max(image.height) > MAX_TEXTURE_SIDE {
        return Err(format!(
            "the image has {}x{} pixels",
            image.width, image.height
        ));
    }
    let texels = image
        .data
        .iter()
        .map(|[r, g, b]| [*r, *g, *b, 1.0])
        .collect();
    Ok(TextureDesc::new(
        path,
        image.width,
        image.height,
        finite_texels(texels)?,
    ))
}

/// Returns whether an image is a normal map rather than a height map: in more than half of it, the
/// channels mapped to -1..=1 are nearly a unit vector that points outwards, and are not grey.
pub(super) fn is_normal_map(image: &TextureDesc) -> bool {
    let Texels::Rgba8(texels) = &image.texels else {
        return false;
    };
    let step = texels.len().div_ceil(4096).max(1);
    let sampled = texels.iter().step_by(step);
    let normal = |[r, g, b, _]: &&[u8; 4]| {
        let n = Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b)) / 127.5 - 1.0;
        n.z > 0.2 && (n.length() - 1.0).abs() < 0.2 && !(r == g && g == b)
    };
    let count = sampled.clone().count();
    sampled.filter(normal).count() * 2 > count
}

/// Returns float texels, or a message if any value is not finite.
fn finite_texels(texels: Vec<[f32; 4]>) -> Result<Texels, String> {
    if texels.as_flattened().iter().all(|x| x.is_finite()) {
        return Ok(Texels::RgbaF32(texels));
    }
    Err("the image has values that are not finite".to_owned())
}

/// Returns the texels of an image, 8 bits per channel. Nothing beside the image and its texels is
/// allocated, unless its channels have 16 bits.
fn shared_texels(image: DynamicImage) -> Arc<[[u8; 4]]> {
    match image {
        DynamicImage::ImageLuma8(grey) => grey.iter().map(|&l| [l, l, l, 255]).collect(),
        DynamicImage::ImageLumaA8(grey) => {
            let (texels, _) = grey.as_chunks::<2>();
            texels.iter().map(|&[l, a]| [l, l, l, a]).collect()
        }
        DynamicImage::ImageRgb8(color) => {
            let (texels, _) = color.as_chunks::<3>();
            texels.iter().map(|&[r, g, b]| [r, g, b, 255]).collect()
        }
        image => into_texels(image.into_rgba8().into_raw()).into(),
    }
}

/// Returns the channels of an image as texels, without a copy.
fn into_texels<C: bytemuck::Pod>(channels: Vec<C>) -> Vec<[C; 4]> {
    bytemuck::allocation::cast_slice_box(channels.into_boxed_slice()).into_vec()
}

/// Returns the mean of the linear texels of an image. Those of 8 bits are decoded from sRGB if they are
/// `of_color`.
pub(crate) fn mean_texel(image: &TextureDesc, of_color: bool) -> Vec3 {
    let mut sum = [0.0f64; 3];
    let mut add = |texel: [f32; 3]| {
        sum.iter_mut()
            .zip(texel)
            .for_each(|(sum, x)| *sum += f64::from(x));
    };
    match &image.texels {
        Texels::Rgba8(t) => t.iter().for_each(|[r, g, b, _]| {
            add([*r, *g, *b].map(|x| Curve::of(of_color).decode(x)));
        }),
        Texels::RgbaF32(t) => t.iter().for_each(|[r, g, b, _]| add([*r, *g, *b])),
    }
    let count = f64::from(image.width) * f64::from(image.height);
    Vec3::from_array(sum.map(|x| (x / count.max(1.0)) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(texels: Vec<[u8; 4]>) -> Arc<TextureDesc> {
        Arc::new(TextureDesc::new(
            "t",
            texels.len() as u32,
            1,
            Texels::Rgba8(texels.into()),
        ))
    }

    #[test]
    fn height_maps_are_luminance_and_are_distinguished_from_normal_maps() {
        let grey = image(vec![[7, 7, 7, 255], [200, 200, 200, 255]]);
        assert!(Arc::ptr_eq(
            &ImageCache::default().heights(&grey).unwrap(),
            &grey
        ));
        let Texels::RgbaF32(t) = ImageCache::default()
            .heights(&image(vec![[255, 0, 51, 255]]))
            .unwrap()
            .texels
            .clone()
        else {
            panic!("floats expected")
        };
        assert!(
            (t[0][0] - 0.2126 - 0.0722 * 0.2).abs() < 1e-6 && t[0][0] == t[0][2],
            "{:?}",
            t[0]
        );
        let n = Vec3::new(0.48, -0.36, 0.8) * 127.5 + 127.5;
        let slanted = [n.x as u8, n.y as u8, n.z as u8, 255];
        assert!(is_normal_map(&image(vec![[128, 128, 255, 255], slanted])));
        // Every grey from black to white, one of which has length one, and the colours of bricks
        // and of a sky.
        assert!(!is_normal_map(&image(
            (0..=255).map(|c| [c, c, c, 255]).collect()
        )));
        assert!(!is_normal_map(&image(vec![[202, 202, 202, 255]; 4])));
        assert!(!is_normal_map(&image(vec![
            [150, 90, 60, 255],
            [160, 120, 100, 255]
        ])));
        assert!(!is_normal_map(&image(vec![[200, 220, 255, 255]; 4])));
        assert!(!is_normal_map(&image(Vec::new())));
    }

    fn write_png(path: &Path) {
        let mut image = image::RgbImage::new(3, 2);
        image.put_pixel(2, 0, image::Rgb([255, 128, 0]));
        image.save(path).unwrap();
    }

    #[test]
    fn eight_bit_texels_are_stored_unchanged_top_row_first() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        write_png(&path);
        let mut notes = Vec::new();
        let t = load(&path, &mut notes).unwrap();
        assert_eq!((t.width, t.height), (3, 2));
        let Texels::Rgba8(texels) = &t.texels else {
            panic!("eight bits expected")
        };
        assert_eq!(texels[2], [255, 128, 0, 255]);
        assert_eq!(texels[5], [0, 0, 0, 255]);
        assert!(notes.is_empty());
        let moved = dir.path().join("wrong_extension.jpg");
        std::fs::copy(&path, &moved).unwrap();
        assert_eq!(
            load(&moved, &mut notes).unwrap().content_hash,
            t.content_hash
        );
    }

    #[test]
    fn targa_files_are_recognised_by_their_extension() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.tga");
        // Uncompressed, 2 x 1, 24 bits, from the top: blue, green, red.
        let mut bytes = vec![0u8; 18];
        (bytes[2], bytes[12], bytes[14], bytes[16], bytes[17]) = (2, 2, 1, 24, 0x20);
        bytes.extend([0, 128, 255, 7, 8, 9]);
        std::fs::write(&path, bytes).unwrap();
        let Texels::Rgba8(texels) = load(&path, &mut Vec::new()).unwrap().texels else {
            panic!("eight bits expected")
        };
        assert_eq!(texels[..], [[255, 128, 0, 255], [9, 8, 7, 255]]);
    }

    #[test]
    fn high_dynamic_range_is_preserved_and_sixteen_bits_are_noted() {
        let dir = tempfile::tempdir().unwrap();
        let hdr = dir.path().join("a.hdr");
        let texels = [image::Rgb([4.0f32, 1.0, 0.25]), image::Rgb([0.0, 0.0, 0.0])];
        let file = std::fs::File::create(&hdr).unwrap();
        image::codecs::hdr::HdrEncoder::new(file)
            .encode(&texels, 2, 1)
            .unwrap();
        let mut notes = Vec::new();
        let t = load(&hdr, &mut notes).unwrap();
        let Texels::RgbaF32(texels) = &t.texels else {
            panic!("floats expected")
        };
        assert_eq!(texels[0], [4.0, 1.0, 0.25, 1.0]);
        assert!(notes.is_empty());
        // The signature of `rgbe.c` and others.
        let bytes = std::fs::read(&hdr).unwrap();
        let rest = bytes.strip_prefix(b"#?RADIANCE").unwrap();
        std::fs::write(&hdr, [b"#?RGBE", rest].concat()).unwrap();
        assert_eq!(load(&hdr, &mut notes).unwrap().content_hash, t.content_hash);
        let deep = dir.path().join("deep.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(1, 1, image::Luma([65535u16]))
            .save(&deep)
            .unwrap();
        assert!(matches!(
            load(&deep, &mut notes).unwrap().texels,
            Texels::Rgba8(_)
        ));
        assert!(notes[0].message.contains("16 bits"), "{}", notes[0]);
    }

    #[test]
    fn open_exr_is_read_and_errors_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        exr::prelude::write_rgb_file(&path, 3, 2, |x, y| (x as f32, 0.25, 7.5 * y as f32)).unwrap();
        let t = load(&path, &mut Vec::new()).unwrap();
        assert_eq!((t.width, t.height), (3, 2));
        let Texels::RgbaF32(texels) = &t.texels else {
            panic!("floats expected")
        };
        assert_eq!(texels[5], [2.0, 0.25, 7.5, 1.0]);
        let good = std::fs::read(&path).unwrap();
        std::fs::write(&path, &good[..good.len() / 2]).unwrap();
        assert!(
            load(&path, &mut Vec::new())
                .unwrap_err()
                .to_string()
                .contains("a.exr")
        );
        exr::prelude::write_rgb_file(&path, 1, 1, |_, _| (f32::NAN, 0.0, 0.0)).unwrap();
        assert!(
            load(&path, &mut Vec::new())
                .unwrap_err()
                .to_string()
                .contains("not finite")
        );
    }

    #[test]
    fn small_files_that_decode_to_large_images_are_refused_except_plain_ones() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bmp");
        image::RgbImage::new(1, 1).save(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[18..26].copy_from_slice(&[0, 0x40, 0, 0, 0, 0x40, 0, 0]);
        std::fs::write(&path, &bytes).unwrap();
        let e = load(&path, &mut Vec::new()).unwrap_err().to_string();
        assert!(
            e.contains("a.bmp") && e.to_lowercase().contains("limit"),
            "{e}"
        );
        let plain = dir.path().join("plain.png");
        image::RgbImage::from_pixel(4096, 2048, image::Rgb([1, 2, 3]))
            .save(&plain)
            .unwrap();
        assert!(std::fs::metadata(&plain).unwrap().len() < 200_000);
        assert_eq!(load(&plain, &mut Vec::new()).unwrap().width, 4096);
    }

    #[test]
    fn damaged_images_are_errors_that_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        write_png(&path);
        let good = std::fs::read(&path).unwrap();
        for cut in [0, 1, 8, 20, good.len() / 2] {
            std::fs::write(&path, &good[..cut]).unwrap();
            let e = load(&path, &mut Vec::new()).unwrap_err().to_string();
            assert!(e.contains("a.png"), "{e}");
        }
        // A header that claims 2^31 columns must be refused.
        let mut huge = good.clone();
        huge[16] = 0x7f;
        std::fs::write(&path, &huge).unwrap();
        assert!(load(&path, &mut Vec::new()).is_err());
    }
}
