//! Adapters: surfaces around other surfaces.

use std::sync::Arc;

use glam::Vec3;

use super::super::tree::{Property, XmlObject};
use super::BsdfReader;
use crate::load::composed::ImageTexture;
use crate::model_differences;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{Formulas, MaskMode, TextureDesc, TextureSlot};

impl BsdfReader<'_> {
    /// Converts the surface inside an adapter; a `twosided` may have one for each side.
    pub(super) fn nested(
        &mut self,
        o: &XmlObject,
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        let inside = o.surfaces();
        if o.plugin == "twosided" && inside.len() == 2 {
            self.add_surfaces(&inside, two_sided, depth)?;
            self.m.by_side = true;
            self.m.weights = vec![0.5; 2];
            return Ok(());
        }
        if inside.len() > 1 {
            self.notes.push(o.note(format!(
                "only the first of the {} surfaces of `{}` is used",
                inside.len(),
                o.plugin
            )));
        }
        match inside.first() {
            Some(first) => self.surface(first, two_sided, depth + 1),
            None => Err(o.error(format!("a `{}` needs a surface inside", o.plugin))),
        }
    }

    /// Converts a `blendbsdf` to a composed material: its `weight` is that of the second surface.
    pub(super) fn blend(
        &mut self,
        o: &XmlObject,
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        let inside = o.surfaces();
        if inside.len() != 2 {
            return Err(o.error(format!(
                "a `blendbsdf` needs exactly two surfaces inside, found {}",
                inside.len()
            )));
        }
        self.add_surfaces(&inside, two_sided, depth)?;
        let second = self.unit_number(o, "weight", 0.5, Some(TextureSlot::Weights))?;
        self.m.weights = vec![1.0 - second, second];
        self.note_smooth_parts(o);
        Ok(())
    }

    /// Sets the texture of a slot in the material and in all its parts, with a note if its mapping is
    /// not supported.
    fn set_texture_of_parts(&mut self, o: &XmlObject, slot: TextureSlot, read: &ImageTexture) {
        for m in self.parts.iter_mut().chain([&mut self.m]) {
            if let Err(e) = read.clone().apply_relative(m, slot) {
                self.notes.push(o.note(e.to_string()));
            }
        }
    }

    /// Reads the height map of a `bumpmap`, whose texture may have any name.
    pub(super) fn bump_map(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        let map = o.children("texture").next().cloned();
        let height = o.number("scale", 1.0)?;
        if height.abs() > 1e6 {
            return Err(o.error(format!(
                "`scale` must be between -1e6 and 1e6, found {height}"
            )));
        }
        if let Some(texture) = self.optional_texture(map)? {
            if !texture.is_interpolated() {
                self.notes.push(o.note(model_differences::STEPPED_BUMPS));
                return Ok(());
            }
            self.notes.push(o.note(model_differences::STEEP_BUMPS));
            let heights = self.textures.heights(o, texture)?;
            for m in self.parts.iter_mut().chain([&mut self.m]) {
                m.bump_height = height as f32;
                m.formulas = Formulas::Mitsuba;
            }
            self.set_texture_of_parts(o, TextureSlot::Bump, &heights);
        }
        Ok(())
    }

    /// Reads the texture of a `normalmap`. The second component of its normals is along growing v, and
    /// v grows from the top of an image.
    pub(super) fn normal_map(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        let map = match o.property("normalmap").or_else(|| o.property("")) {
            Some(Property::Object(t)) if t.class == "texture" => Some(t.clone()),
            _ => o.children("texture").next().cloned(),
        };
        if let Some(texture) = self.optional_texture(map)? {
            self.notes.push(o.note(model_differences::NORMALS));
            let linear = self.textures.linear(o, texture)?;
            let texture = self.textures.green_reversed(o, linear)?;
            self.set_texture_of_parts(o, TextureSlot::Normal, &texture);
        }
        Ok(())
    }

    /// Reads the opacity of a `mask`. A constant becomes a mask texture of one texel, which accepts
    /// a hit with that probability.
    pub(super) fn mask(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        self.m.mask_mode = MaskMode::Blend;
        self.notes.push(o.note(
            "holes of a mask are not path edges here, but in Mitsuba: paths reach further for the same \
             `max_depth`",
        ));
        if let Some(Property::Object(t)) = o.property("opacity") {
            if let Some(read) = self.number_texture(t)? {
                self.set_texture(o, TextureSlot::Mask, read);
            }
            return Ok(());
        }
        let opacity = o.color("opacity")?.unwrap_or(Vec3::splat(0.5));
        if opacity.max_element() != opacity.min_element() {
            self.notes.push(
                o.note("coloured opacity is not supported; the mean of its channels is used"),
            );
        }
        let grey = (opacity.element_sum() / 3.0).clamp(0.0, 1.0);
        self.m
            .set_texture(TextureSlot::Mask, Some(Arc::new(TextureDesc::grey(grey))));
        Ok(())
    }
}
