//! The XML of Mitsuba, written element by element.

use std::fmt::Write;

use glam::{DAffine3, Vec3};

/// A document that grows.
#[derive(Default)]
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
}

impl Xml {
    /// The text of a document with everything closed.
    pub fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text
    }

    /// Opens an element; what follows lies in it until [`Xml::close`].
    pub fn open(&mut self, tag: &'static str, attributes: &[(&str, &str)]) {
        self.element(tag, attributes, ">");
        self.open.push(tag);
    }

    /// Closes the element that was opened last.
    pub fn close(&mut self) {
        if let Some(tag) = self.open.pop() {
            let _ = writeln!(self.text, "{:indent$}</{tag}>", "", indent = 4 * self.open.len());
        }
    }

    /// An element without content.
    pub fn leaf(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        self.element(tag, attributes, "/>");
    }

    /// A value by name: `<float name=".." value=".."/>` and its like.
    pub fn value(&mut self, tag: &str, name: &str, value: impl std::fmt::Display) {
        self.leaf(tag, &[("name", name), ("value", &value.to_string())]);
    }

    /// A colour or another triple of one attribute.
    pub fn rgb(&mut self, name: &str, color: Vec3) {
        self.value("rgb", name, format_args!("{}, {}, {}", color.x, color.y, color.z));
    }

    /// A point or a vector.
    pub fn triple(&mut self, tag: &str, name: &str, v: Vec3) {
        let [x, y, z] = v.to_array().map(|x| x.to_string());
        self.leaf(tag, &[("name", name), ("x", &x), ("y", &y), ("z", &z)]);
    }

    /// A place; none where it changes nothing.
    pub fn place(&mut self, name: &str, map: &DAffine3) {
        if *map == DAffine3::IDENTITY {
            return;
        }
        let (m, t) = (map.matrix3, map.translation);
        let row = |i: usize| format!("{} {} {} {}", m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]);
        let rows = format!("{} {} {} 0 0 0 1", row(0), row(1), row(2));
        self.open("transform", &[("name", name)]);
        self.leaf("matrix", &[("value", &rows)]);
        self.close();
    }

    fn element(&mut self, tag: &str, attributes: &[(&str, &str)], end: &str) {
        let _ = write!(self.text, "{:indent$}<{tag}", "", indent = 4 * self.open.len());
        for (name, value) in attributes {
            let _ = write!(self.text, " {name}=\"");
            for c in value.chars() {
                match c {
                    '&' => self.text.push_str("&amp;"),
                    '<' => self.text.push_str("&lt;"),
                    '"' => self.text.push_str("&quot;"),
                    c => self.text.push(c),
                }
            }
            self.text.push('"');
        }
        self.text.push_str(end);
        self.text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_nest_and_what_is_special_is_escaped() {
        let mut xml = Xml::default();
        xml.open("scene", &[("version", "3.0.0")]);
        xml.value("string", "name", "a<\"&b");
        xml.open("shape", &[]);
        assert_eq!(
            xml.finish(),
            "<scene version=\"3.0.0\">\n    <string name=\"name\" value=\"a&lt;&quot;&amp;b\"/>\n    <shape>\n    </shape>\n</scene>\n"
        );
    }
}
