//! Surfaces of version 0.6 that version 3 lacks: mixtures, Phong's and Ward's models, and coatings.

use std::rc::Rc;

use glam::Vec3;

use super::super::tree::{Property, XmlObject};
use super::BsdfReader;
use crate::load::composed::ImageTexture;
use crate::load::images::mean_texel;
use crate::model_differences;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{Distribution, MaterialDesc, Model, TextureSlot};

impl BsdfReader<'_> {
    /// Converts a `mixturebsdf` to a composed material. What its weights lack to one is absorbed.
    pub(super) fn mixture(
        &mut self,
        o: &XmlObject,
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        let inside = o.surfaces();
        let Some(mut weights) = o.numbers("weights")? else {
            return Err(o.error("a `mixturebsdf` needs `weights`"));
        };
        if inside.is_empty() || inside.len() != weights.len() {
            return Err(o.error(format!(
                "a `mixturebsdf` needs a weight for each surface, found {} for {}",
                weights.len(),
                inside.len()
            )));
        }
        let sum: f32 = weights.iter().sum();
        if !(weights.iter().all(|w| *w >= 0.0) && sum > 0.0 && sum.is_finite()) {
            return Err(o.error("`weights` must be at least 0, and not all 0"));
        }
        o.mark_read(&["ensure_energy_conservation"]);
        if sum > 1.0 {
            self.notes.push(o.note(format!(
                "the weights sum to {sum}; they are divided by it, so that no energy is added"
            )));
            weights.iter_mut().for_each(|w| *w /= sum);
        }
        self.add_surfaces(&inside, two_sided, depth)?;
        if sum < 1.0 - 1e-6 {
            weights.push(1.0 - sum);
            self.add_part(|reader| {
                (reader.m.model, reader.m.base_color) = (Model::Lambert, Vec3::ZERO);
                Ok(())
            })?;
        }
        self.m.weights = weights;
        self.note_smooth_parts(o);
        Ok(())
    }

    /// Converts a `phong` to a diffuse surface and a mirror with a lobe about as wide.
    pub(super) fn phong(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        let exponent = self.number_or_mean(o, "exponent", 30.0)?;
        if !(0.0..=1e9).contains(&exponent) {
            return Err(o.error(format!("`exponent` must be 0 to 1e9, found {exponent}")));
        }
        self.notes.push(o.note(model_differences::PHONG));
        // A lobe of this exponent about the reflected direction is one of four times the exponent
        // about the normal [Walter et al. 2007, Section 5.4].
        let alpha = (2.0 / (4.0 * exponent + 2.0)).sqrt();
        self.diffuse_and_glossy(o, |mirror| {
            mirror.m.roughness = alpha.sqrt().min(1.0) as f32;
            mirror.m.distribution = Distribution::Beckmann;
            Ok(())
        })
    }

    /// Converts a `ward` to a diffuse surface and a rough mirror.
    pub(super) fn ward(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        o.mark_read(&["variant"]);
        self.notes.push(o.note(model_differences::WARD));
        self.diffuse_and_glossy(o, |mirror| mirror.rough(o))
    }

    /// Composes a diffuse surface and a mirror of the colours `diffuse_reflectance` and
    /// `specular_reflectance`: each is drawn in proportion to its colour and has it divided by that
    /// share, so that their sum is that of the file.
    fn diffuse_and_glossy(
        &mut self,
        o: &XmlObject,
        shape: impl FnOnce(&mut BsdfReader<'_>) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let diffuse = self.reflectance(o, "diffuse_reflectance", 0.5)?;
        let glossy = self.reflectance(o, "specular_reflectance", 0.2)?;
        let [mut d, mut s] = [diffuse.0.max_element(), glossy.0.max_element()];
        if d + s > 1.0 {
            self.notes.push(o.note(format!(
                "the two reflectances sum to {}; they are divided by it, as Mitsuba does",
                d + s
            )));
            (d, s) = (d / (d + s), s / (d + s));
        }
        // A texture cannot be brightened by the share of its surface: it is darker by the other.
        let share = if diffuse.1.is_some() {
            1.0 - s
        } else {
            d / (d + s).max(1e-6)
        };
        let (share, rest) = (share.clamp(0.0, 1.0), 1.0 - share.clamp(0.0, 1.0));
        if share > 0.0 && rest > 0.0 && (diffuse.1.is_some() || glossy.1.is_some()) {
            self.notes.push(o.note(
                "textures of the two reflectances are darker here by the share of the other one",
            ));
        }
        let colour = |(color, texture): &(Vec3, Option<ImageTexture>), level: f32, share: f32| {
            let brightest = color.max_element().max(1e-6);
            match texture {
                Some(_) => Vec3::ONE,
                None => *color * (level / brightest / share.max(1e-6)),
            }
        };
        let (below, above) = (colour(&diffuse, d, share), colour(&glossy, s, rest));
        self.add_part(|reader| {
            (reader.m.model, reader.m.base_color) = (Model::Lambert, below.min(Vec3::ONE));
            if let Some(read) = diffuse.1 {
                reader.set_texture(o, TextureSlot::BaseColor, read);
            }
            Ok(())
        })?;
        self.add_part(|reader| {
            (reader.m.model, reader.m.base_color) = (Model::Conductor, above.min(Vec3::ONE));
            // A mirror without Fresnel's law.
            (reader.m.eta, reader.m.k) = (Vec3::ZERO, Vec3::ONE);
            if let Some(read) = glossy.1 {
                reader.set_texture(o, TextureSlot::BaseColor, read);
            }
            shape(reader)
        })?;
        self.m.weights = vec![share, rest];
        Ok(())
    }

    /// Reads a reflectance: a colour, or the mean of a texture and the texture.
    fn reflectance(
        &mut self,
        o: &XmlObject,
        key: &str,
        default: f32,
    ) -> Result<(Vec3, Option<ImageTexture>), SceneError> {
        if let Some(Property::Object(t)) = o.property(key) {
            return Ok(match self.textures.read(t, self.notes)? {
                Some(read) => (mean_texel(&read.image, true), Some(read)),
                None => (Vec3::splat(default), None),
            });
        }
        let color = o.color(key)?.unwrap_or(Vec3::splat(default));
        Ok((self.clamped_color(o, key, color), None))
    }

    /// Converts a `coating` or `roughcoating`: over a diffuse surface it is a plastic.
    pub(super) fn coating(
        &mut self,
        o: &Rc<XmlObject>,
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        self.nested(o, two_sided, depth)?;
        o.mark_read(&["thickness"]);
        let is_clear = o.color("sigma_a")?.is_none_or(|sigma| sigma == Vec3::ZERO);
        if !is_clear || matches!(o.property("sigma_a"), Some(Property::Object(_))) {
            self.notes
                .push(o.note("the absorption of a coating is not supported; it is clear"));
        }
        if self.m.model != Model::Lambert || !self.m.parts.is_empty() {
            o.mark_all_read();
            self.notes.push(o.note(
                "a coating over another surface than a diffuse one is not supported; the surface \
                 inside is used alone",
            ));
            return Ok(());
        }
        self.notes.push(o.note(model_differences::COATING));
        (self.m.model, self.m.roughness) = (Model::Plastic, 0.0);
        (self.m.ior, self.m.nonlinear) = (self.relative_index(o, 1.5046)?, true);
        self.m.specular = self.constant_color(o, "specular_reflectance")?;
        if o.plugin == "roughcoating" {
            self.rough(o)?;
        }
        Ok(())
    }

    /// Adds surfaces as parts of the material.
    pub(super) fn add_surfaces(
        &mut self,
        surfaces: &[Rc<XmlObject>],
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        for surface in surfaces {
            self.add_part(|reader| {
                reader.surface(surface, two_sided, depth + 1)?;
                if reader.m.texture(TextureSlot::Mask).is_some() {
                    let message = "a mask inside a surface of several is ignored";
                    reader.notes.push(surface.note(message));
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// Adds what a function reads as a part of the material.
    fn add_part(
        &mut self,
        read: impl FnOnce(&mut BsdfReader<'_>) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let name = self.names.allocate_numbered(&self.m.name, 1);
        let mut reader = BsdfReader {
            m: MaterialDesc::new(&name),
            parts: Vec::new(),
            names: self.names,
            colored: self.colored,
            textures: self.textures,
            notes: self.notes,
        };
        read(&mut reader)?;
        let BsdfReader { m, parts, .. } = reader;
        self.parts.extend(parts);
        self.parts.push(m);
        self.m.parts.push(name);
        Ok(())
    }

    /// Notes the light that Mitsuba loses where one of the parts is perfectly smooth.
    pub(super) fn note_smooth_parts(&mut self, o: &XmlObject) {
        let is_smooth = |m: &MaterialDesc| {
            let of_interface = !matches!(m.model, Model::Disney | Model::Lambert);
            of_interface && m.roughness == 0.0 && m.texture(TextureSlot::Roughness).is_none()
        };
        if self.parts.iter().any(is_smooth) {
            self.notes.push(o.note(model_differences::SMOOTH_BLEND));
        }
    }
}
