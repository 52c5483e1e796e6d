//! Materials of version 3, and those that are not supported.

use glam::Vec3;

use super::{MaterialReader, set_mask, unsupported};
use crate::load::composed::TextureValue;
use crate::model_differences;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{Model, TextureSlot};

impl MaterialReader<'_> {
    /// Sets the parameters of a type of version 3.
    pub(super) fn version3(&mut self) -> Result<(), SceneError> {
        match self.source.class.as_str() {
            "matte" => {
                self.diffuse("Kd", 0.5)?;
                // In degrees, of which pbrt uses at most a right angle.
                let sigma = self.number("sigma", 0.0)?.clamp(0.0, 90.0);
                if sigma > 0.0 {
                    (self.m.model, self.m.roughness) = (Model::OrenNayar, sigma / 90.0);
                }
                Ok(())
            }
            "metal" => self.conductor("", 0.01),
            "mirror" => {
                (self.m.model, self.m.roughness) = (Model::Conductor, 0.0);
                (self.m.eta, self.m.k) = (Vec3::ZERO, Vec3::ONE);
                self.base("Kr", 0.9)
            }
            "glass" => {
                self.dielectric()?;
                self.m.specular = self.constant("Kr", true, 1.0)?.clamp(Vec3::ZERO, Vec3::ONE);
                let transmitted = self.constant("Kt", true, 1.0)?;
                self.m.base_color = (transmitted * transmitted).clamp(Vec3::ZERO, Vec3::ONE);
                self.rough("", 0.0)
            }
            "plastic" => {
                self.plastic(0.25)?;
                self.m.ior = 1.5;
                self.note(model_differences::PBRT_PLASTIC);
                Ok(())
            }
            "substrate" => self.substrate(),
            "uber" => self.uber(),
            "translucent" => {
                self.params().mark_read(&["roughness", "remaproughness"]);
                if self.constant("Ks", true, 0.25)? != Vec3::ZERO {
                    self.note("the glossy lobes (`Ks`) of this material are left out");
                }
                let reflect = self.constant("reflect", true, 0.5)?;
                let transmit = self.constant("transmit", true, 0.5)?;
                self.translucent(["Kd", "Kd"], [reflect, transmit])
            }
            "disney" => self.disney(),
            other => {
                let message = unsupported(other);
                self.note(message);
                let known = ["reflectance", "color", "Kd"];
                let name = known
                    .into_iter()
                    .find(|name| self.params().get(name).is_some());
                self.m.model = Model::Lambert;
                self.base(name.unwrap_or("reflectance"), 0.5)
            }
        }
    }

    /// Sets a plastic with a diffuse part `Kd` and a rough reflection times `Ks`.
    fn plastic(&mut self, default: f32) -> Result<(), SceneError> {
        self.m.model = Model::Plastic;
        self.base("Kd", default)?;
        self.m.specular = self
            .constant("Ks", true, default)?
            .clamp(Vec3::ZERO, Vec3::ONE);
        self.rough("", 0.1)
    }

    /// Sets a plastic whose index has the reflectance `Ks` at normal incidence.
    fn substrate(&mut self) -> Result<(), SceneError> {
        self.plastic(0.5)?;
        let most = self.m.specular.max_element().clamp(0.0, 0.95);
        if most > 0.0 {
            self.m.specular /= self.m.specular.max_element();
        }
        // A reflectance of zero has an index of one, of which there is no plastic.
        let root = most.max(1e-4).sqrt();
        self.m.ior = (1.0 + root) / (1.0 - root);
        self.note(model_differences::PBRT_SUBSTRATE);
        Ok(())
    }

    /// Sets a plastic, or a diffuse surface if it has no reflection, with a mask for its opacity.
    fn uber(&mut self) -> Result<(), SceneError> {
        self.plastic(0.25)?;
        self.m.ior = self.index(&["eta", "index"], 1.5)?;
        if self.m.specular == Vec3::ZERO {
            (self.m.model, self.m.specular) = (Model::Lambert, Vec3::ONE);
        } else {
            self.note(model_differences::PBRT_PLASTIC);
        }
        for name in ["Kr", "Kt"] {
            if self.constant(name, true, 0.0)? != Vec3::ZERO {
                self.note(format!(
                    "`{name}` of this material is not supported; ignored"
                ));
            }
        }
        match self.value("opacity", true, 1.0)? {
            TextureValue::Constant(c) if c.min_element() >= 1.0 => {}
            TextureValue::Constant(c) => {
                if c.max_element() != c.min_element() {
                    self.note(
                        "coloured opacity is not supported; the mean of its channels is used",
                    );
                }
                set_mask(&mut self.m, TextureValue::Constant(c));
            }
            TextureValue::Image(image) => {
                let grey = |[r, g, b, a]: [f32; 4]| {
                    let mean = (r + g + b) / 3.0;
                    [mean, mean, mean, a]
                };
                let params = &self.source.params;
                let image = self.loader.textures.mapped(params, image, "grey", grey)?;
                set_mask(&mut self.m, TextureValue::Image(image));
            }
        }
        Ok(())
    }

    /// Sets the parameters of the Disney model.
    fn disney(&mut self) -> Result<(), SceneError> {
        self.m.model = Model::Disney;
        self.base("color", 0.5)?;
        let unit = |x: f32| x.clamp(0.0, 1.0);
        self.m.metallic = unit(self.number("metallic", 0.0)?);
        self.m.ior = self.index(&["eta"], 1.5)?;
        match self.value("roughness", false, 0.5)? {
            TextureValue::Image(image) => image.apply_to(&mut self.m, TextureSlot::Roughness),
            value => self.m.roughness = unit(value.mean(false).x),
        }
        self.m.specular_tint = unit(self.number("speculartint", 0.0)?);
        self.m.anisotropic = unit(self.number("anisotropic", 0.0)?);
        self.m.sheen = unit(self.number("sheen", 0.0)?);
        self.m.sheen_tint = unit(self.number("sheentint", 0.5)?);
        self.m.clearcoat = unit(self.number("clearcoat", 0.0)?);
        self.m.clearcoat_gloss = unit(self.number("clearcoatgloss", 1.0)?);
        self.m.opacity = 1.0 - unit(self.number("spectrans", 0.0)?);
        self.m.subsurface = unit(self.number("flatness", 0.0)?);
        self.note("the Disney model is adapted here; its lobes differ from pbrt's by some percent");
        Ok(())
    }
}
