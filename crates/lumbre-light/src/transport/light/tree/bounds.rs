//! Bounds of groups of lights: where they are, where they emit, and their power.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use crate::scene::compile::Cone;

/// Addition to the angles of emission in radians, so that rounding hides no light.
const ANGLE_MARGIN: f32 = 2e-3;

/// A cone of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// Unit vector of the axis.
    pub axis: Vec3,
    /// Half angle in radians.
    pub spread: f32,
}

impl Directions {
    /// Cone that contains all directions.
    const ALL: Directions = Directions {
        axis: Vec3::Z,
        spread: PI,
    };

    /// Returns a cone that contains two cones.
    fn union(self, other: Directions) -> Directions {
        // Most lights of a group are alike.
        if self.spread >= PI || self == other {
            return self;
        }
        if other.spread >= PI {
            return other;
        }
        let between = self.axis.angle_between(other.axis);
        if (between + other.spread).min(PI) <= self.spread {
            return self;
        }
        if (between + self.spread).min(PI) <= other.spread {
            return other;
        }
        let spread = 0.5 * (self.spread + between + other.spread);
        let normal = self.axis.cross(other.axis).normalize_or_zero();
        if spread >= PI || normal == Vec3::ZERO {
            return Directions::ALL;
        }
        let axis = Quat::from_axis_angle(normal, spread - self.spread) * self.axis;
        Directions {
            axis: axis.normalize_or(self.axis),
            spread,
        }
    }
}

/// Bounds of a group of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// Least and greatest corner.
    pub corners: [Vec3; 2],
    /// Directions of strongest emission: normals of surfaces, directions of lights.
    pub directions: Directions,
    /// Greatest angle in radians between those and a direction of emission.
    pub emission: f32,
    /// Power, in any unit.
    pub power: f32,
}

impl LightBounds {
    /// Returns the bounds of lights between two corners that emit in all directions.
    pub fn round(corners: [Vec3; 2], power: f32) -> LightBounds {
        LightBounds {
            corners,
            directions: Directions::ALL,
            emission: 0.0,
            power,
        }
    }

    /// Returns whether some light of the group may emit strongest in any direction.
    pub fn is_round(&self) -> bool {
        self.directions.spread >= PI
    }

    /// Returns the bounds of a triangle, which emits on its front.
    pub fn triangle([a, b, c]: [Vec3; 3], power: f32) -> LightBounds {
        let corners = [a.min(b).min(c), a.max(b).max(c)];
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal == Vec3::ZERO {
            return LightBounds::round(corners, power);
        }
        LightBounds {
            corners,
            directions: Directions {
                axis: normal,
                spread: 0.0,
            },
            emission: FRAC_PI_2,
            power,
        }
    }

    /// Returns the bounds of a point light, whose intensity is the same in much of its cone.
    pub fn point(at: Vec3, cone: &Cone, power: f32) -> LightBounds {
        let axis = cone.axis.normalize_or_zero();
        if cone.cutoff >= PI || axis == Vec3::ZERO {
            return LightBounds::round([at; 2], power);
        }
        LightBounds {
            corners: [at; 2],
            directions: Directions {
                axis,
                spread: cone.cutoff,
            },
            emission: 0.0,
            power,
        }
    }

    /// Returns bounds that contain both groups.
    pub fn union(&self, other: &LightBounds) -> LightBounds {
        LightBounds {
            corners: [
                self.corners[0].min(other.corners[0]),
                self.corners[1].max(other.corners[1]),
            ],
            directions: self.directions.union(other.directions),
            emission: self.emission.max(other.emission),
            power: self.power + other.power,
        }
    }

    /// Returns the centre of the box.
    pub fn center(&self) -> Vec3 {
        self.corners[0] + (self.corners[1] - self.corners[0]) * 0.5
    }

    /// Returns the squared radius of a sphere that contains the box, enlarged against rounding.
    pub fn radius2(&self) -> f32 {
        let [low, high] = self.corners;
        let rounding = 1e-6 * low.abs().max(high.abs()).max_element();
        let radius = 0.5 * (high - low).length() * (1.0 + 1e-4) + rounding;
        (radius * radius).max(1e-20)
    }

    /// Returns the cosine of the greatest angle of emission, enlarged against rounding.
    pub fn cos_emission(&self) -> f32 {
        (self.emission + ANGLE_MARGIN).min(PI).cos() - 1e-6
    }

    /// Returns the measure of a group that the tree keeps small [Conty Estevez and Kulla 2018,
    /// section 4.4]: power, times the area of the bounding sphere, times the solid angle of
    /// emission weighted by the cosine, up to a factor.
    pub fn cost(&self) -> f32 {
        let o = self.directions.spread;
        let w = (o + self.emission).min(PI);
        let angle = (1.0 - o.cos()) * 4.0
            + (2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos());
        let [low, high] = self.corners;
        self.power * (high - low).length_squared() * angle.max(0.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_emits_where_any_of_its_lights_does() {
        let wall = LightBounds::triangle([Vec3::ZERO, Vec3::X, Vec3::Y], 1.0);
        let narrow = LightBounds {
            emission: 0.0,
            directions: wall.directions,
            ..LightBounds::round([Vec3::Z; 2], 2.0)
        };
        for both in [wall.union(&narrow), narrow.union(&wall)] {
            assert_eq!(both.emission, FRAC_PI_2);
            assert_eq!(both.power, 3.0);
            assert_eq!(both.corners, [Vec3::ZERO, Vec3::ONE]);
        }
    }
}
