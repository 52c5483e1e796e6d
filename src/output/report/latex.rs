//! What LaTeX needs.

use crate::output::plot::style::Style;

/// Text as LaTeX prints it: special characters escaped, the signs that figures use as commands, so that the text also
/// compiles without a Unicode engine.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => out += "\\textbackslash{}",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '−' => out += "$-$",
            '×' => out += "$\\times$",
            '–' => out += "--",
            '²' => out += "$^2$",
            'µ' => out += "$\\mu$",
            '≤' => out += "$\\leq$",
            '≥' => out += "$\\geq$",
            '±' => out += "$\\pm$",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            '\n' | '\r' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// The dash pattern of a style as an option of TikZ, with a leading comma; empty for a solid line.
pub fn dash(style: &Style) -> String {
    let lengths: Vec<&str> = style.dash.split(' ').filter(|l| !l.is_empty()).collect();
    if lengths.is_empty() {
        return String::new();
    }
    let part = |(i, length): (usize, &&str)| format!("{} {length}pt", if i % 2 == 0 { "on" } else { "off" });
    format!(", dash pattern={{{}}}", lengths.iter().enumerate().map(part).collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::plot::style::style;

    #[test]
    fn what_latex_would_read_as_a_command_is_printed() {
        assert_eq!(escape("a_b & 5 % of {x} ~ 1 − SSIM"), "a\\_b \\& 5 \\% of \\{x\\} \\textasciitilde{} 1 $-$ SSIM");
        assert_eq!(escape("\\input"), "\\textbackslash{}input");
    }

    #[test]
    fn dashes_are_those_of_the_figures() {
        assert_eq!(dash(&style(0)), "");
        assert_eq!(dash(&style(1)), ", dash pattern={on 7pt off 3pt}");
    }
}
