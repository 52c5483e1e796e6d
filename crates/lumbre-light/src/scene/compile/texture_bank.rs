//! Textures that materials share: each image is decoded once for each use.

use std::collections::BTreeMap;

use super::{NONE, Texture};
use crate::scene::Note;
use crate::scene::desc::{Lookup, MaterialDesc, Texels, TextureDesc, TextureSlot};

/// Textures of a scene, one for each decoded image and mapping.
#[derive(Default)]
pub(super) struct TextureBank {
    pub(super) textures: Vec<Texture>,
    /// Index of a texture, by image and mapping key.
    index: BTreeMap<(Decoding, [u32; 9]), u32>,
    /// Index of any texture with an image.
    images: BTreeMap<Decoding, u32>,
}

/// A decoded image: its content hash, whether it is decoded from sRGB, and whether values below 0
/// and above 1 are clamped.
type Decoding = ([u8; 32], bool, [bool; 2]);

impl TextureBank {
    /// Returns the index of a material's texture, or [`NONE`].
    pub(super) fn index(
        &mut self,
        material: &MaterialDesc,
        slot: TextureSlot,
        notes: &mut Vec<Note>,
    ) -> u32 {
        let Some(desc) = material.texture(slot) else {
            return NONE;
        };
        let own = material.lookup(slot);
        let lookup = Lookup {
            filter: material.texture_filter.apply(own.filter),
            ..own
        };
        // 8-bit texels are in range for every slot, so that two colour slots share one texture.
        let float = matches!(desc.texels, Texels::RgbaF32(_));
        let bounded = match slot {
            TextureSlot::Mask
            | TextureSlot::Bump
            | TextureSlot::DelayConstant
            | TextureSlot::DelayRate
            | TextureSlot::DelayMean
            | TextureSlot::DelayWidth => [false; 2],
            TextureSlot::Emission => [float, false],
            _ => [float; 2],
        };
        let image = (desc.content_hash, slot.is_srgb(), bounded);
        if let Some(index) = self.index.get(&(image, lookup.key())) {
            return *index;
        }
        let index = self.textures.len() as u32;
        let texture = match self.images.get(&image) {
            Some(known) => self.textures[*known as usize].clone(),
            None => decoded(desc, slot, bounded, notes),
        };
        self.textures.push(Texture { lookup, ..texture });
        self.images.entry(image).or_insert(index);
        self.index.insert((image, lookup.key()), index);
        index
    }
}

/// Decodes an image for a slot, clamping values as `bounded` demands, with a note if any changed.
fn decoded(
    desc: &TextureDesc,
    slot: TextureSlot,
    bounded: [bool; 2],
    notes: &mut Vec<Note>,
) -> Texture {
    let mut texture = Texture::decode(desc, slot.is_srgb());
    if clamp(&mut texture, bounded) {
        let message = match bounded {
            [_, true] => "the image has values outside 0 to 1; they are clamped",
            _ => "the image has negative values; they count as black, since it is used as emission",
        };
        let message = message.to_owned();
        notes.push(Note::new(desc.file.clone(), "image", message));
    }
    texture
}

/// Clamps texels to at least 0 and to at most 1, each on demand. Returns whether any changed.
fn clamp(texture: &mut Texture, [below, above]: [bool; 2]) -> bool {
    let (low, high) = (
        if below { 0.0 } else { f32::NEG_INFINITY },
        if above { 1.0 } else { f32::INFINITY },
    );
    let mut changed = false;
    let floats = texture.texels.floats_mut().unwrap_or_default();
    for x in floats.as_flattened_mut() {
        let inside = x.clamp(low, high);
        changed |= inside != *x;
        *x = inside;
    }
    changed
}
