//! Writer of XML, element by element.

use std::fmt::Write;

use glam::{DAffine3, Vec3};

/// A document that is written.
#[derive(Default)]
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
}

impl Xml {
    /// Returns the text of the document, with all elements closed.
    pub fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text
    }

    /// Opens an element; what follows is inside until [`Xml::close`].
    pub fn open(&mut self, tag: &'static str, attributes: &[(&str, &str)]) {
        self.element(tag, attributes, ">");
        self.open.push(tag);
    }

    /// Closes the innermost open element.
    pub fn close(&mut self) {
        if let Some(tag) = self.open.pop() {
            let _ = writeln!(
                self.text,
                "{:indent$}</{tag}>",
                "",
                indent = 4 * self.open.len()
            );
        }
    }

    /// Writes an element without content.
    pub fn leaf(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        self.element(tag, attributes, "/>");
    }

    /// Writes a named value, such as `<float name=".." value=".."/>`.
    pub fn value(&mut self, tag: &str, name: &str, value: impl std::fmt::Display) {
        self.leaf(tag, &[("name", name), ("value", &value.to_string())]);
    }

    /// Writes a named colour.
    pub fn rgb(&mut self, name: &str, color: Vec3) {
        self.value(
            "rgb",
            name,
            format_args!("{}, {}, {}", color.x, color.y, color.z),
        );
    }

    /// Writes a named point or vector.
    pub fn vector(&mut self, tag: &str, name: &str, v: Vec3) {
        let [x, y, z] = v.to_array().map(|x| x.to_string());
        self.leaf(tag, &[("name", name), ("x", &x), ("y", &y), ("z", &z)]);
    }

    /// Writes a named transform, unless it is the identity.
    pub fn transform(&mut self, name: &str, map: &DAffine3) {
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

    /// Writes the start of an element with its attributes.
    fn element(&mut self, tag: &str, attributes: &[(&str, &str)], end: &str) {
        let _ = write!(
            self.text,
            "{:indent$}<{tag}",
            "",
            indent = 4 * self.open.len()
        );
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
    fn elements_nest_and_special_characters_are_escaped() {
        let mut xml = Xml::default();
        xml.open("scene", &[("version", "3.0.0")]);
        xml.value("string", "name", "a<\"&b");
        xml.open("shape", &[]);
        assert_eq!(
            xml.finish(),
            concat!(
                "<scene version=\"3.0.0\">\n",
                "    <string name=\"name\" value=\"a&lt;&quot;&amp;b\"/>\n",
                "    <shape>\n    </shape>\n</scene>\n"
            )
        );
    }
}
