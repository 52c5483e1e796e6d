//! Transmission without a volume: the surface is a thin wall, which does not bend light.

use std::sync::Arc;

use glam::Vec3;
use serde_json::Value as Json;

use super::{LoadedMaterial, MaterialReader};
use crate::load::images::mean_texel;
use crate::names::UniqueNames;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::compile::srgb_to_linear;
use lumbre_light::scene::desc::{MaterialDesc, Model, Texels, TextureDesc, TextureSlot};

/// Slots of an opaque surface that a pane of glass does not use.
const SURFACE_SLOTS: [TextureSlot; 3] = [
    TextureSlot::Roughness,
    TextureSlot::Metallic,
    TextureSlot::Opacity,
];

impl MaterialReader<'_> {
    /// Makes a material that transmits, and has no volume, a pane of glass, or one mixed with an
    /// opaque surface where it transmits partly.
    pub(super) fn thin_walls(
        &mut self,
        place: &str,
        m: &Json,
        loaded: &mut LoadedMaterial,
        names: &mut UniqueNames,
    ) -> Result<(), SceneError> {
        let d = &loaded.desc;
        let thickness = &m["extensions"]["KHR_materials_volume"]["thicknessFactor"];
        let solid = thickness.as_f64().unwrap_or(0.0) > 0.0;
        let [metallic, opacity] =
            [TextureSlot::Metallic, TextureSlot::Opacity].map(|slot| d.texture(slot).is_some());
        let share = (1.0 - d.opacity) * if metallic { 1.0 } else { 1.0 - d.metallic };
        if solid || share == 0.0 || d.model != Model::Disney {
            return Ok(());
        }
        let whole = share == 1.0 && !metallic && !opacity;
        if !whole && d.emission != Vec3::ZERO {
            self.note(
                place,
                "a thin wall that transmits partly and emits light is not supported; it refracts \
                 like a solid",
            );
            return Ok(());
        }
        if d.roughness > 0.0 || d.texture(TextureSlot::Roughness).is_some() {
            self.note(
                place,
                "transmission without the thickness of `KHR_materials_volume` is that of a smooth thin wall here, \
                 whatever its roughness",
            );
        }
        if whole {
            loaded.desc = self.pane(place, d, &d.name)?;
            return Ok(());
        }
        let mut weight = TextureDesc::grey(share).into();
        let mut slot = None;
        if opacity {
            let covered = match d.texture(TextureSlot::Metallic) {
                Some(image) => mean_texel(image, false).x,
                None => d.metallic,
            };
            if metallic {
                self.note(
                    place,
                    "textures of both metallic and transmission are not supported; the mean of \
                     the former is used",
                );
            }
            slot = Some((TextureSlot::Opacity, 1.0 - covered));
        } else if metallic {
            slot = Some((TextureSlot::Metallic, 1.0 - d.opacity));
        }
        let mut lookup = Default::default();
        if let Some((slot, factor)) = slot {
            lookup = d.lookup(slot);
            if let Some(image) = d.texture(slot).cloned() {
                let how = format!("(1 - x) * {factor}");
                weight = self.derived(place, &image, &how, |[x, ..]| (1.0 - x) * factor)?;
            }
        }
        let [surface_name, pane_name] = [(); 2].map(|()| names.allocate_numbered(&d.name, 1));
        let pane = self.pane(place, d, &pane_name)?;
        let mut surface = MaterialDesc {
            name: surface_name,
            opacity: 1.0,
            ..d.clone()
        };
        surface.set_texture(TextureSlot::Opacity, None);
        let mut composed = surface.clone();
        composed.name = d.name.clone();
        composed.parts = vec![surface.name.clone(), pane.name.clone()];
        let mean = mean_texel(&weight, false).x;
        composed.weights = vec![1.0 - mean, mean];
        if slot.is_some() {
            composed.set_mapped_texture(TextureSlot::Weights, weight, lookup);
        }
        loaded.parts = vec![surface, pane];
        loaded.desc = composed;
        Ok(())
    }

    /// Returns the pane of glass of a material that transmits. A pane is tinted by the square root
    /// of its base colour here.
    fn pane(
        &mut self,
        place: &str,
        d: &MaterialDesc,
        name: &str,
    ) -> Result<MaterialDesc, SceneError> {
        let mut pane = MaterialDesc {
            name: name.to_owned(),
            model: Model::Dielectric,
            thin: true,
            opacity: 0.0,
            roughness: 0.0,
            metallic: 0.0,
            base_color: d.base_color * d.base_color,
            ..d.clone()
        };
        for slot in SURFACE_SLOTS {
            pane.set_texture(slot, None);
            pane.set_lookup(slot, Default::default());
        }
        if let Some(image) = d.texture(TextureSlot::BaseColor) {
            let lookup = d.lookup(TextureSlot::BaseColor);
            let squared = self.squared(place, image)?;
            pane.set_mapped_texture(TextureSlot::BaseColor, squared, lookup);
        }
        if d.clearcoat > 0.0 || d.sheen > 0.0 {
            self.note(
                place,
                "clear coat and sheen of a thin wall are not supported; ignored",
            );
        }
        Ok(pane)
    }

    /// Returns the square of a colour texture, linear.
    fn squared(
        &mut self,
        place: &str,
        image: &Arc<TextureDesc>,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        let coded = matches!(image.texels, Texels::Rgba8(_));
        let square = |[r, g, b, a]: [f32; 4]| {
            let [r, g, b] = [r, g, b].map(|x| if coded { srgb_to_linear(x) } else { x });
            [r * r, g * g, b * b, a]
        };
        let squared = self.cache.derived(image, "squared", square);
        squared.map_err(|problem| self.document.error(place, problem))
    }
}
