//! Changes of valid files that leave most of their structure intact, so that they get past parsers.
//! The fuzz targets use this file too.

use crate::random::Random;

/// Numbers that readers must expect.
const NUMBERS: [&str; 22] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "1e-45",
    "1e38",
    "-1e39",
    "1e999",
    "nan",
    "inf",
    "0.1",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "-2147483648",
    "4294967296",
    "9007199254740993",
    "18446744073709551616",
    "1e",
];

/// Extent of the changes of a text.
pub struct Extent {
    /// Greatest number of changes.
    pub changes: usize,
    /// Greatest number of copies of a line that a repetition inserts.
    pub copies: usize,
}

/// Returns a file with at least one change: text by tokens and lines, most binary glTFs in their
/// text or data, other files by bytes.
pub fn of_file(bytes: &[u8], extent: &Extent, random: &mut Random) -> Vec<u8> {
    match std::str::from_utf8(bytes) {
        Ok(text) if !text.contains('\0') => return of_text(text, extent, random).into_bytes(),
        _ if bytes.is_empty() => return Vec::new(),
        _ => {}
    }
    let by_chunks = match random.below(8) {
        0 => None,
        _ => of_glb(bytes, extent, random),
    };
    by_chunks.unwrap_or_else(|| of_bytes(bytes, random))
}

/// Returns a binary glTF with a changed text or changed data, and lengths that agree with them
/// (glTF 2.0, section 4.4); `None` for other files.
fn of_glb(bytes: &[u8], extent: &Extent, random: &mut Random) -> Option<Vec<u8>> {
    let (header, rest) = bytes.split_at_checked(12)?;
    let (text, rest) = chunk(rest)?;
    let mut text = std::str::from_utf8(text).ok()?.to_owned();
    let mut data = chunk(rest).map(|(data, _)| data.to_vec());
    match &mut data {
        Some(data) if !data.is_empty() && random.below(4) == 0 => *data = of_bytes(data, random),
        _ => text = of_text(&text, extent, random),
    }
    let mut file = header.to_vec();
    put_chunk(&mut file, b"JSON", text.into_bytes(), b' ');
    if let Some(data) = data {
        put_chunk(&mut file, b"BIN\0", data, 0);
    }
    let length = u32::try_from(file.len()).ok()?;
    file[8..12].copy_from_slice(&length.to_le_bytes());
    Some(file)
}

/// Returns the content of the chunk that bytes start with, and what follows it.
fn chunk(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    let (_, rest) = rest.split_at_checked(4)?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// Appends a chunk, its content padded to a multiple of four bytes.
fn put_chunk(file: &mut Vec<u8>, kind: &[u8; 4], mut content: Vec<u8>, padding: u8) {
    content.resize(content.len().next_multiple_of(4), padding);
    file.extend((content.len() as u32).to_le_bytes());
    file.extend(kind);
    file.append(&mut content);
}

/// Returns a text with at least one change.
pub fn of_text(text: &str, extent: &Extent, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..=random.below(extent.changes) {
        text = match random.below(8) {
            0 => change_line(&text, random, |lines, at, _| {
                lines.remove(at);
            }),
            1 => change_line(&text, random, |lines, at, random| {
                let line = lines[at].clone();
                let copies = 1 + random.below(extent.copies);
                lines.splice(at..at, std::iter::repeat_n(line, copies));
            }),
            2 => change_line(&text, random, |lines, at, random| {
                let other = random.below(lines.len());
                lines.swap(at, other);
            }),
            3 => change_token(&text, random, |_, _| String::new()),
            4 => change_token(&text, random, |tokens, random| random.pick(tokens).clone()),
            _ => change_number(&text, random),
        };
    }
    text
}

/// Returns bytes with one to eight of them changed, or a part repeated or removed.
fn of_bytes(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let at = random.below(bytes.len());
    match random.below(4) {
        0 => bytes.truncate(at),
        1 => {
            let end = at + random.below(bytes.len() - at);
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {
            for _ in 0..=random.below(8) {
                let at = random.below(bytes.len());
                bytes[at] = *random.pick(&[0, 1, 127, 128, 255, b'0', b' ', bytes[at] ^ 16]);
            }
        }
    }
    bytes
}

fn change_line(
    text: &str,
    random: &mut Random,
    change: impl Fn(&mut Vec<String>, usize, &mut Random),
) -> String {
    let mut lines: Vec<String> = text.split('\n').map(str::to_owned).collect();
    let at = random.below(lines.len());
    change(&mut lines, at, random);
    lines.join("\n")
}

fn change_token(
    text: &str,
    random: &mut Random,
    change: impl Fn(&[String], &mut Random) -> String,
) -> String {
    let mut tokens = tokens(text);
    let at = random.below(tokens.len());
    tokens[at] = change(&tokens, random);
    tokens.concat()
}

/// Replaces a number by another one, or a token if there is no number.
fn change_number(text: &str, random: &mut Random) -> String {
    let mut tokens = tokens(text);
    let is_number = |token: &String| token.starts_with(|c: char| c.is_ascii_digit());
    let places: Vec<usize> = (0..tokens.len())
        .filter(|i| is_number(&tokens[*i]))
        .collect();
    let at = match places.as_slice() {
        [] => random.below(tokens.len()),
        places => *random.pick(places),
    };
    tokens[at] = (*random.pick(&NUMBERS)).to_owned();
    tokens.concat()
}

/// Cuts a text into words and numbers, single other characters, and runs of spaces. Never empty.
fn tokens(text: &str) -> Vec<String> {
    let kind = |c: char| match c {
        c if c.is_alphanumeric() || "._-".contains(c) => 0,
        c if c.is_whitespace() => 1,
        _ => 2,
    };
    let mut tokens: Vec<String> = Vec::new();
    let mut last = None;
    for c in text.chars() {
        match tokens.last_mut() {
            Some(token) if last == Some(kind(c)) && kind(c) != 2 => token.push(c),
            _ => tokens.push(c.to_string()),
        }
        last = Some(kind(c));
    }
    if tokens.is_empty() {
        tokens.push(String::new());
    }
    tokens
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_most_changed_binary_gltfs_agree_with_their_chunks() {
        let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        put_chunk(&mut file, b"JSON", b"{\"nodes\": [0, 1]}".to_vec(), b' ');
        put_chunk(&mut file, b"BIN\0", vec![1, 2, 3, 255], 0);
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        let extent = Extent {
            changes: 1,
            copies: 4,
        };
        let agrees = |file: &[u8]| {
            let (header, rest) = file.split_at_checked(12)?;
            let (_, rest) = chunk(rest)?;
            let (_, rest) = chunk(rest)?;
            let length = (file.len() as u32).to_le_bytes();
            (rest.is_empty() && header[8..] == length).then_some(())
        };
        let attempt = |seed| of_file(&file, &extent, &mut Random::new([seed, 0, 0]));
        let files: Vec<Vec<u8>> = (0..1000).map(attempt).collect();
        let agree = files.iter().filter(|f| agrees(f).is_some()).count();
        // Of all, 7 in 8 are changed by chunks; some of the others keep their lengths too.
        assert!((830..960).contains(&agree), "{agree} of 1000");
        let changed = files.iter().filter(|f| **f != file).count();
        assert!(changed > 800, "{changed} of 1000");
    }
}
