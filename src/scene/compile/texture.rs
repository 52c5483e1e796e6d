//! Textures as the integrators read them.

/// A texture in linear colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear texels, `[y][x][rgb]`, origin top-left.
    pub texels: Vec<[f32; 3]>,
}

impl Texture {
    /// Bilinear lookup, repeating, with v = 0 at the bottom row.
    pub fn bilinear(&self, uv: glam::Vec2) -> glam::Vec3 {
        let x = uv.x.rem_euclid(1.0) * self.width as f32 - 0.5;
        let y = (1.0 - uv.y).rem_euclid(1.0) * self.height as f32 - 0.5;
        let texel = |i: f32, j: f32| {
            let i = (i as i64).rem_euclid(i64::from(self.width)) as usize;
            let j = (j as i64).rem_euclid(i64::from(self.height)) as usize;
            glam::Vec3::from_array(self.texels[j * self.width as usize + i])
        };
        let (x0, y0) = (x.floor(), y.floor());
        let top = texel(x0, y0).lerp(texel(x0 + 1.0, y0), x - x0);
        let bottom = texel(x0, y0 + 1.0).lerp(texel(x0 + 1.0, y0 + 1.0), x - x0);
        top.lerp(bottom, y - y0)
    }
}
