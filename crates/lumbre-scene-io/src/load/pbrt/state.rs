//! Graphics state: what the directives before a shape set for it.

use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3};

use super::light::AreaSource;
use super::material_source::MaterialSource;
use super::params::Param;
use super::spectrum::ColorSpace;

/// Material of the shapes that follow.
#[derive(Clone, Debug, Default)]
pub(super) enum MaterialRef {
    /// None was set.
    #[default]
    None,
    /// A `Material` directive.
    Own(Rc<MaterialSource>),
    /// The name of a `MakeNamedMaterial` directive.
    Named(String),
}

/// Defaults that `Attribute` sets for one kind of directive.
pub(super) type Defaults = Rc<Vec<Rc<Param>>>;

/// Graphics state of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// Map from the space of the next object to the world of the file, or to camera space before
    /// the world begins.
    pub ctm: DAffine3,
    /// Whether `ReverseOrientation` is set.
    pub reversed: bool,
    /// Material of the next shape.
    pub material: MaterialRef,
    /// Area light of the next shape.
    pub area_light: Option<Rc<AreaSource>>,
    /// Colour space of RGB parameters.
    pub color_space: ColorSpace,
    /// Whether transforms apply to the end of the exposure only.
    pub at_end: bool,
    /// Defaults of shapes, lights, materials and textures.
    pub defaults: [Defaults; 4],
}

/// Kinds of directives that `Attribute` sets defaults for, in the order of [`State::defaults`].
pub(super) const TARGETS: [&str; 4] = ["shape", "light", "material", "texture"];

impl State {
    /// Multiplies the transform from the right, unless transforms apply to the end of the exposure.
    pub fn concat(&mut self, map: DAffine3) {
        self.set(self.ctm * map);
    }

    /// Sets the transform.
    pub fn set(&mut self, map: DAffine3) {
        if !self.at_end {
            self.ctm = map;
        }
    }

    /// Returns the defaults for a target.
    pub fn defaults_of(&self, target: &str) -> Defaults {
        let index = TARGETS.iter().position(|name| *name == target);
        index.map_or_else(Rc::default, |i| self.defaults[i].clone())
    }
}

/// Returns the map of sixteen numbers in columns; `None` if it is not affine.
pub(super) fn matrix(m: &[f64; 16]) -> Option<DAffine3> {
    let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    let [a, b, c, w] = [m[3], m[7], m[11], m[15]];
    if [a, b, c] != [0.0; 3] || w == 0.0 {
        return None;
    }
    Some(DAffine3::from_mat3_translation(
        DMat3::from_cols(column(0), column(4), column(8)) * w.recip(),
        column(12) / w,
    ))
}

/// Returns the map from the world to a camera; `None` if it has no direction.
pub(super) fn look_at(v: &[f64; 9]) -> Option<DAffine3> {
    let at = |i: usize| DVec3::new(v[i], v[i + 1], v[i + 2]);
    let forward = (at(3) - at(0)).try_normalize()?;
    let right = at(6).try_normalize()?.cross(forward).try_normalize()?;
    let axes = DMat3::from_cols(right, forward.cross(right), forward);
    Some(DAffine3::from_mat3_translation(axes, at(0)).inverse())
}

/// Returns the rotation by an angle in degrees; `None` if the axis has no length.
pub(super) fn rotation([degrees, x, y, z]: [f64; 4]) -> Option<DAffine3> {
    let axis = DVec3::new(x, y, z).try_normalize()?;
    Some(DAffine3::from_axis_angle(axis, degrees.to_radians()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_are_those_of_the_book() {
        // A camera at (0, 0, -5) that looks at the origin: x is to the right, y up, z forward.
        let view = look_at(&[0.0, 0.0, -5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]).unwrap();
        let found = view.transform_point3(DVec3::new(1.0, 2.0, 0.0));
        assert!(found.distance(DVec3::new(1.0, 2.0, 5.0)) < 1e-12, "{found}");
        let quarter = rotation([90.0, 0.0, 0.0, 1.0]).unwrap();
        assert!(quarter.transform_point3(DVec3::X).distance(DVec3::Y) < 1e-12);
        let mut m = [0.0; 16];
        (m[0], m[5], m[10], m[12], m[15]) = (2.0, 2.0, 2.0, 6.0, 2.0);
        let map = matrix(&m).unwrap();
        assert_eq!(map.transform_point3(DVec3::Y), DVec3::new(3.0, 1.0, 0.0));
        m[3] = 1.0;
        assert!(matrix(&m).is_none());
        assert!(look_at(&[0.0; 9]).is_none() && rotation([1.0, 0.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn transforms_of_the_end_of_the_exposure_are_ignored() {
        let mut state = State {
            at_end: true,
            ..State::default()
        };
        state.concat(DAffine3::from_translation(DVec3::X));
        assert_eq!(state.ctm, DAffine3::IDENTITY);
    }
}
