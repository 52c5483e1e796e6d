//! Escapes text and formats line styles for LaTeX.

use crate::plot::style::Style;

/// Escapes text for LaTeX. Special characters are escaped. Symbols that captions use become
/// commands, so that the text compiles without a Unicode engine. Text between two backticks is set
/// in a typewriter font.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut marks = text.matches('`').count() / 2 * 2;
    let mut in_code = false;
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
            '÷' => out += "$\\div$",
            '†' => out += "$^\\dagger$",
            '–' => out += "--",
            '²' => out += "$^2$",
            'µ' => out += "$\\mu$",
            '≤' => out += "$\\leq$",
            '≥' => out += "$\\geq$",
            '±' => out += "$\\pm$",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            '`' if marks > 0 => {
                marks -= 1;
                in_code = !in_code;
                out += if in_code { "\\texttt{" } else { "}" };
            }
            '\n' | '\r' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Returns the dash pattern of a style as a TikZ option with a leading comma, or an empty text for
/// a solid line.
pub fn dash(style: &Style) -> String {
    let lengths: Vec<&str> = style.dash.split(' ').filter(|l| !l.is_empty()).collect();
    if lengths.is_empty() {
        return String::new();
    }
    let segment = |(i, length): (usize, &&str)| {
        format!("{} {length}pt", if i % 2 == 0 { "on" } else { "off" })
    };
    format!(
        ", dash pattern={{{}}}",
        lengths
            .iter()
            .enumerate()
            .map(segment)
            .collect::<Vec<_>>()
            .join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::style::style;

    #[test]
    fn special_characters_are_printed() {
        assert_eq!(
            escape("a_b & 5 % of {x} ~ 1 − SSIM"),
            "a\\_b \\& 5 \\% of \\{x\\} \\textasciitilde{} 1 $-$ SSIM"
        );
        assert_eq!(escape("\\input"), "\\textbackslash{}input");
        assert_eq!(escape("`a_b` and `"), "\\texttt{a\\_b} and `");
    }

    #[test]
    fn dashes_match_those_of_the_figures() {
        assert_eq!(dash(&style(0)), "");
        assert_eq!(dash(&style(1)), ", dash pattern={on 7pt off 3pt}");
    }
}
