//! Writer of pbrt's text, directive by directive.

use std::fmt::{Display, Write};

use glam::{DAffine3, Vec3};

/// A file that is written.
#[derive(Default)]
pub(super) struct Text {
    text: String,
    depth: usize,
}

impl Text {
    /// Returns the text of the file.
    pub fn finish(self) -> String {
        self.text
    }

    /// Writes a line.
    pub fn line(&mut self, line: &str) {
        let indent = 2 * self.depth;
        let _ = writeln!(self.text, "{:indent$}{line}", "");
    }

    /// Begins a block, such as `AttributeBegin`.
    pub fn begin(&mut self, name: &str) {
        self.line(&format!("{name}Begin"));
        self.depth += 1;
    }

    /// Ends a block.
    pub fn end(&mut self, name: &str) {
        self.depth = self.depth.saturating_sub(1);
        self.line(&format!("{name}End"));
    }

    /// Writes a directive with its type; parameters follow.
    pub fn directive(&mut self, name: &str, class: &str) {
        self.line(&format!("{name} \"{class}\""));
    }

    /// Writes a parameter.
    pub fn parameter(&mut self, parameter: &str) {
        let indent = 2 * self.depth + 4;
        let _ = writeln!(self.text, "{:indent$}{parameter}", "");
    }

    /// Writes a number, or a truth value.
    pub fn number(&mut self, declaration: &str, value: impl Display) {
        self.parameter(&format!("\"{declaration}\" {value}"));
    }

    /// Writes a string without special characters.
    pub fn string(&mut self, declaration: &str, value: &str) {
        self.parameter(&format!("\"{declaration}\" \"{value}\""));
    }

    /// Writes a colour, point or vector.
    pub fn vector(&mut self, declaration: &str, v: Vec3) {
        self.parameter(&vector(declaration, v));
    }

    /// Writes a transform, unless it is the identity.
    pub fn transform(&mut self, map: &DAffine3) {
        if *map == DAffine3::IDENTITY {
            return;
        }
        let (m, t) = (map.matrix3, map.translation);
        let column = |c: glam::DVec3, last: u32| format!("{} {} {} {last}", c.x, c.y, c.z);
        self.line(&format!(
            "ConcatTransform [ {}  {}  {}  {} ]",
            column(m.x_axis, 0),
            column(m.y_axis, 0),
            column(m.z_axis, 0),
            column(t, 1)
        ));
    }
}

/// Returns the parameter of a colour, point or vector.
pub(super) fn vector(declaration: &str, v: Vec3) -> String {
    format!("\"{declaration}\" [ {} {} {} ]", v.x, v.y, v.z)
}
