//! A partition of the sphere that resolves the lobes of a BSDF however narrow they are, and integrals
//! over its cells.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use lumbre_light::math::Frame;
use lumbre_light::scene::compile::Material;

/// The sphere divided into cells: each side of the surface into rings about the pole of its lobe.
pub struct SphereCells {
    normal: Vec3,
    wo: Vec3,
    sides: [Rings; 2],
}

impl SphereCells {
    /// Returns the cells that resolve all lobes of a material with this unit normal, seen from the
    /// unit direction `wo`.
    pub fn for_lobes(material: &Material, normal: Vec3, wo: Vec3) -> SphereCells {
        SphereCells {
            normal,
            wo,
            sides: poles(material, normal, wo).map(|pole| Rings::about(pole, narrowest(material))),
        }
    }

    /// Returns the number of cells.
    pub fn cells(&self) -> usize {
        self.sides[0].cells() + self.sides[1].cells()
    }

    fn side(&self, w: Vec3) -> usize {
        usize::from(w.dot(self.normal) * self.wo.dot(self.normal) < 0.0)
    }

    /// Returns the cell of a direction.
    pub fn cell(&self, w: Vec3) -> usize {
        let side = self.side(w);
        side * self.sides[0].cells() + self.sides[side].cell(w)
    }

    /// Returns the integral of a function over every cell.
    pub fn integrate<const N: usize>(&self, f: impl Fn(Vec3) -> [f64; N]) -> Vec<[f64; N]> {
        let half = |side: usize| {
            self.sides[side].integrate(|w| if self.side(w) == side { f(w) } else { [0.0; N] })
        };
        [half(0), half(1)].concat()
    }
}

/// The sphere divided into rings about a pole, narrow near it, and the rings into sectors.
struct Rings {
    frame: Frame,
    /// Upper edges in `(1 - cos) / 2` of the angle to the pole; the first ring is a cap.
    edges: Vec<f64>,
}

/// Sectors of a ring.
const SECTORS: usize = 16;

impl Rings {
    /// Returns rings that resolve a lobe of width `alpha` about the pole.
    fn about(pole: Vec3, alpha: f64) -> Rings {
        let first = (alpha * alpha / 16.0).min(1.0 / 64.0);
        let count = (1.0 / first).log2().ceil().clamp(8.0, 24.0);
        let edges = (0..=count as usize)
            .map(|k| first.powf(1.0 - k as f64 / count))
            .collect();
        Rings {
            frame: Frame::from_normal(pole),
            edges,
        }
    }

    /// Returns the number of cells.
    fn cells(&self) -> usize {
        self.edges.len() * SECTORS
    }

    /// Returns the cell of a direction.
    fn cell(&self, w: Vec3) -> usize {
        let g = f64::from((w - self.frame.n).length_squared()) / 4.0;
        let ring = self
            .edges
            .partition_point(|e| *e < g)
            .min(self.edges.len() - 1);
        let azimuth = f64::from(w.dot(self.frame.t).atan2(w.dot(self.frame.s))) / TAU;
        ring * SECTORS + ((azimuth.rem_euclid(1.0) * SECTORS as f64) as usize).min(SECTORS - 1)
    }

    /// Returns the integral of a function over every cell, per solid angle, by adaptive quadrature.
    fn integrate<const N: usize>(&self, f: impl Fn(Vec3) -> [f64; N]) -> Vec<[f64; N]> {
        let (s, t, n) = (
            self.frame.s.as_dvec3(),
            self.frame.t.as_dvec3(),
            self.frame.n.as_dvec3(),
        );
        // Within a ring the logarithm of g is the coordinate, within the cap g itself: d solid
        // angle = 2 d phi d g.
        let at = |cap: bool, x: f64, phi: f64| {
            let (g, scale) = if cap {
                (x, 2.0)
            } else {
                (x.exp(), 2.0 * x.exp())
            };
            let r = 2.0 * (g * (1.0 - g)).max(0.0).sqrt();
            let w: DVec3 = n * (1.0 - 2.0 * g) + (s * phi.cos() + t * phi.sin()) * r;
            f(w.as_vec3()).map(|v| v * scale)
        };
        (0..self.cells())
            .map(|cell| {
                let (ring, sector) = (cell / SECTORS, (cell % SECTORS) as f64);
                let cap = ring == 0;
                let x = if cap {
                    [0.0, self.edges[0]]
                } else {
                    [self.edges[ring - 1].ln(), self.edges[ring].ln()]
                };
                let phi = [sector, sector + 1.0].map(|k| k * TAU / SECTORS as f64);
                let g = |x, phi| at(cap, x, phi);
                // Wide rings are always subdivided, since horizons cross them.
                let forced = if self.edges[ring] > 0.02 { 3 } else { 0 };
                refine(&g, x, phi, gauss(&g, x, phi), 6, forced)
            })
            .collect()
    }
}

/// Returns the Gauss quadrature with three by three points.
fn gauss<const N: usize>(f: &impl Fn(f64, f64) -> [f64; N], x: [f64; 2], y: [f64; 2]) -> [f64; N] {
    let points = [
        (-(0.6f64.sqrt()), 5.0 / 18.0),
        (0.0, 8.0 / 18.0),
        (0.6f64.sqrt(), 5.0 / 18.0),
    ];
    let area = (x[1] - x[0]) * (y[1] - y[0]);
    let mut sum = [0.0; N];
    for (u, wu) in points {
        for (v, wv) in points {
            let value = f(
                0.5 * (x[0] + x[1] + u * (x[1] - x[0])),
                0.5 * (y[0] + y[1] + v * (y[1] - y[0])),
            )
            .map(|a| a * area);
            sum.iter_mut()
                .zip(value)
                .for_each(|(s, v)| *s += wu * wv * v);
        }
    }
    sum
}

/// Subdivides a rectangle into four until the integral no longer changes.
fn refine<const N: usize>(
    f: &impl Fn(f64, f64) -> [f64; N],
    x: [f64; 2],
    y: [f64; 2],
    whole: [f64; N],
    depth: u32,
    forced: u32,
) -> [f64; N] {
    let (mx, my) = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
    let parts = [
        ([x[0], mx], [y[0], my]),
        ([x[0], mx], [my, y[1]]),
        ([mx, x[1]], [y[0], my]),
        ([mx, x[1]], [my, y[1]]),
    ];
    let values = parts.map(|(x, y)| gauss(f, x, y));
    let sum: [f64; N] = std::array::from_fn(|k| values.iter().map(|v| v[k]).sum());
    let settled = sum
        .iter()
        .zip(whole)
        .all(|(a, b)| (a - b).abs() <= 2e-3 * a.abs() + 4e-7);
    if depth == 0 || (settled && forced == 0) {
        return sum;
    }
    let values: Vec<[f64; N]> = parts
        .into_iter()
        .zip(values)
        .map(|((x, y), v)| refine(f, x, y, v, depth - 1, forced.saturating_sub(1)))
        .collect();
    std::array::from_fn(|k| values.iter().map(|v| v[k]).sum())
}

/// Returns the directions that Dirac lobes would sample on the side of `wo` and on the other side.
/// Narrow lobes lie about them. Under total reflection the second is the grazing direction at which
/// refraction vanishes.
fn poles(material: &Material, normal: Vec3, wo: Vec3) -> [Vec3; 2] {
    let frame = Frame::from_normal(normal);
    let o = frame.to_local(wo);
    let eta = if o.z > 0.0 {
        material.ior
    } else {
        1.0 / material.ior
    };
    let cos2 = (1.0 - (1.0 - o.z * o.z) / (eta * eta)).max(0.0);
    let refracted =
        Vec3::new(-o.x / eta, -o.y / eta, cos2.sqrt().copysign(-o.z)).normalize_or(Vec3::Z);
    [Vec3::new(-o.x, -o.y, o.z), refracted].map(|w| frame.to_world(w))
}

/// Returns the alpha of a material's narrowest lobe.
pub fn narrowest(m: &Material) -> f64 {
    let base = f64::from(m.roughness).powi(2) * (1.0 - 0.9 * f64::from(m.anisotropic)).sqrt();
    let coat = if m.clearcoat > 0.0 {
        0.1 - 0.099 * f64::from(m.clearcoat_gloss)
    } else {
        1.0
    };
    base.min(coat).max(0.001)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn rings_cover_the_sphere_once_and_integrate_every_cell_separately() {
        for alpha in [0.001, 0.1, 1.0] {
            let rings = Rings::about(Vec3::new(0.2, -0.6, 0.7746), alpha);
            let areas = rings.integrate(|_| [1.0]);
            assert!((areas.iter().map(|a| a[0]).sum::<f64>() / (4.0 * PI) - 1.0).abs() < 1e-6);
            let band = rings.integrate(|w| [f64::from(u8::from(w.z > 0.5))]);
            assert!((band.iter().map(|a| a[0]).sum::<f64>() / PI - 1.0).abs() < 2e-3);
            // The indicator of a cell integrates to its area in that cell and to zero elsewhere.
            let k = rings.cells() / 2 + 3;
            let own = rings.integrate(|w| [f64::from(u8::from(rings.cell(w) == k))]);
            assert!((own[k][0] / areas[k][0] - 1.0).abs() < 1e-3);
            assert!(
                own.iter()
                    .enumerate()
                    .all(|(i, a)| i == k || a[0] < 1e-3 * areas[k][0])
            );
        }
    }
}
