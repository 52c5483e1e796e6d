//! Inline images of iTerm2: a PNG file in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::Picture;

/// Returns the control sequence that shows a picture in `cells` character cells at the cursor, or
/// `None` if it cannot be encoded as PNG.
pub(super) fn encode(picture: &Picture, [columns, rows]: [u16; 2]) -> Option<String> {
    let file = picture.png()?;
    // The size is given in cells, since terminals differ in what they call a pixel.
    let mut out = format!(
        "\u{1b}]1337;File=inline=1;size={};width={columns};height={rows};preserveAspectRatio=0;\
         doNotMoveCursor=1:",
        file.len()
    );
    STANDARD.encode_string(&file, &mut out);
    out.push('\u{7}');
    Some(out)
}
