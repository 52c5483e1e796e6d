//! Decoder of compressed buffer views: `KHR_meshopt_compression`, of which
//! `EXT_meshopt_compression` is the part without version 1 and without the filter `COLOR`.
//!
//! The bit stream and the names used here are those of the appendices of the extensions.

/// Names of the extensions.
pub(super) const EXTENSIONS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Number of deltas in a group.
const GROUP: usize = 16;
/// Greatest number of elements in a block.
const MAX_BLOCK: usize = 256;
/// Greatest number of bytes in a block.
const MAX_BLOCK_BYTES: usize = 8192;

/// Decodes `count` elements of `stride` bytes.
///
/// # Errors
/// Returns a message if the data are truncated, too long, or do not have this mode.
pub(super) fn decode(
    data: &[u8],
    mode: &str,
    filter: &str,
    [count, stride]: [usize; 2],
) -> Result<Vec<u8>, String> {
    let fits = match (mode, filter) {
        ("ATTRIBUTES", "NONE" | "EXPONENTIAL") => stride % 4 == 0 && (4..=256).contains(&stride),
        ("ATTRIBUTES", "OCTAHEDRAL" | "COLOR") => matches!(stride, 4 | 8),
        ("ATTRIBUTES", "QUATERNION") => stride == 8,
        ("TRIANGLES", "NONE") => matches!(stride, 2 | 4) && count % 3 == 0,
        ("INDICES", "NONE") => matches!(stride, 2 | 4),
        _ => false,
    };
    if !fits {
        return Err(format!(
            "{count} elements of {stride} bytes cannot have the mode `{mode:.20}` and the filter \
             `{filter:.20}`"
        ));
    }
    let indices = match mode {
        "TRIANGLES" => triangles(data, count / 3)?,
        "INDICES" => indices(data, count)?,
        _ => {
            let mut bytes = attributes(data, count, stride)?;
            if filter != "NONE" {
                bytes
                    .chunks_exact_mut(stride)
                    .for_each(|element| unfilter(filter, element));
            }
            return Ok(bytes);
        }
    };
    let bytes = indices
        .iter()
        .flat_map(|i| i.to_le_bytes().into_iter().take(stride));
    Ok(bytes.collect())
}

/// The part of a stream that has not been read.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    /// Returns the input between a header byte and a tail, and the tail.
    fn new(data: &'a [u8], headers: &[u8], tail: usize) -> Result<(Input<'a>, &'a [u8]), String> {
        match data.split_first() {
            Some((header, rest)) if headers.contains(header) && rest.len() >= tail => {
                let (body, tail) = rest.split_at(rest.len() - tail);
                Ok((Input(body), tail))
            }
            _ => Err("the compressed data are too short, or of another mode".to_owned()),
        }
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self
            .0
            .split_at_checked(n)
            .ok_or("the compressed data end early")?;
        self.0 = rest;
        Ok(taken)
    }

    /// Reads an unsigned LEB128 integer.
    fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.take(1)?[0];
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err("an index of the compressed data has more than 5 bytes".to_owned())
    }

    fn end(&self) -> Result<(), String> {
        let left = self.0.len();
        if left == 0 {
            return Ok(());
        }
        Err(format!("{left} bytes are left after the compressed data"))
    }
}

/// Decodes a zigzag-encoded integer.
fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

/// Decodes elements of attributes.
fn attributes(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let channels = stride / 4;
    let (modes, padded) = match data.first() {
        Some(0xa1) => (channels, 24),
        _ => (0, 32),
    };
    let (mut input, tail) = Input::new(data, &[0xa0, 0xa1], padded.max(stride + modes))?;
    let (last, modes) = tail[tail.len() - stride - modes..].split_at(stride);
    let mut last = last.to_vec();
    let mut out = vec![0; count * stride];
    let most = ((MAX_BLOCK_BYTES / stride) & !(GROUP - 1)).min(MAX_BLOCK);
    for block in out.chunks_mut(most * stride) {
        let controls = input.take(modes.len())?;
        for channel in 0..channels {
            let mut deltas = [[0; MAX_BLOCK]; 4];
            for (i, deltas) in deltas.iter_mut().enumerate() {
                let control = controls.get(channel).map(|c| c >> (2 * i) & 3);
                let deltas = &mut deltas[..block.len() / stride];
                match control {
                    None => groups(&mut input, [0, 2, 4, 8], deltas)?,
                    Some(0) => groups(&mut input, [0, 1, 2, 4], deltas)?,
                    Some(1) => groups(&mut input, [1, 2, 4, 8], deltas)?,
                    Some(2) => {}
                    Some(_) => deltas.copy_from_slice(input.take(deltas.len())?),
                }
            }
            let mode = modes.get(channel).copied().unwrap_or(0);
            let last = &mut last[4 * channel..][..4];
            for (k, element) in block.chunks_exact_mut(stride).enumerate() {
                add(mode, deltas.map(|d| d[k]), last)?;
                element[4 * channel..][..4].copy_from_slice(last);
            }
        }
    }
    input.end()?;
    Ok(out)
}

/// Decodes groups of deltas; `widths` are the numbers of bits of a delta for each header.
fn groups(input: &mut Input, widths: [usize; 4], deltas: &mut [u8]) -> Result<(), String> {
    let headers = input.take(deltas.len().div_ceil(4 * GROUP))?;
    for (g, deltas) in deltas.chunks_mut(GROUP).enumerate() {
        let bits = widths[usize::from(headers[g / 4] >> (2 * (g % 4)) & 3)];
        let packed = input.take(bits * GROUP / 8)?;
        for k in 0..GROUP {
            let (byte, at) = (packed.get(k * bits / 8), k * bits % 8);
            let sentinel = ((1u32 << bits) - 1) as u8;
            let mut delta = match (byte, bits) {
                (None, _) => 0,
                (Some(byte), 1) => byte >> at & 1,
                (Some(byte), _) => byte >> (8 - bits - at) & sentinel,
            };
            if delta == sentinel && matches!(bits, 1 | 2 | 4) {
                delta = input.take(1)?[0];
            }
            // The last group has 16 deltas, too.
            if let Some(out) = deltas.get_mut(k) {
                *out = delta;
            }
        }
    }
    Ok(())
}

/// Adds deltas to the four bytes of a channel.
fn add(mode: u8, deltas: [u8; 4], last: &mut [u8]) -> Result<(), String> {
    match (mode & 15, mode >> 4) {
        (0, 0) => last.iter_mut().zip(deltas).for_each(|(last, delta)| {
            *last = last.wrapping_add(unzigzag(delta.into()) as u8);
        }),
        (1, 0) => {
            for (last, delta) in last.chunks_exact_mut(2).zip(deltas.chunks_exact(2)) {
                let delta = unzigzag(u16::from_le_bytes([delta[0], delta[1]]).into()) as u16;
                let sum = u16::from_le_bytes([last[0], last[1]]).wrapping_add(delta);
                last.copy_from_slice(&sum.to_le_bytes());
            }
        }
        (2, rotation) => {
            let turned = u32::from_le_bytes(deltas).rotate_right(rotation.into());
            let turned = turned.to_le_bytes();
            last.iter_mut()
                .zip(turned)
                .for_each(|(last, delta)| *last ^= delta);
        }
        _ => {
            return Err(format!(
                "unknown channel mode {mode:#x} of the compressed data"
            ));
        }
    }
    Ok(())
}

/// The 16 latest entries, of which number 0 is the last one.
#[derive(Default)]
struct Fifo<T> {
    entries: [T; 16],
    at: usize,
}

impl<T: Copy> Fifo<T> {
    fn push(&mut self, entry: T) {
        self.at = (self.at + 1) % 16;
        self.entries[self.at] = entry;
    }

    fn get(&self, i: u8) -> T {
        self.entries[(self.at + 16 - usize::from(i)) % 16]
    }
}

/// State of the decoder of triangles.
struct Triangles<'a> {
    input: Input<'a>,
    next: u32,
    last: u32,
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn explicit(&mut self) -> Result<u32, String> {
        self.last = self.last.wrapping_add(unzigzag(self.input.varint()?));
        Ok(self.last)
    }

    /// Returns the vertex of a nibble, and whether it is pushed to the vertices.
    fn corner(&mut self, nibble: u8) -> Result<(u32, bool), String> {
        Ok(match nibble {
            0 => (self.fresh(), true),
            15 => (self.explicit()?, true),
            _ => (self.vertices.get(nibble - 1), false),
        })
    }

    /// Decodes the triangle of a code.
    fn triangle(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], String> {
        let (x, y) = (code >> 4, code & 15);
        if x < 15 {
            let [a, b] = self.edges.get(x);
            let c = match y {
                0 => self.fresh(),
                15 => self.explicit()?,
                13 | 14 => {
                    self.last = self.last.wrapping_add(if y == 13 { u32::MAX } else { 1 });
                    self.last
                }
                _ => self.vertices.get(y),
            };
            if y == 0 || y > 12 {
                self.vertices.push(c);
            }
            [[c, b], [a, c]]
                .into_iter()
                .for_each(|edge| self.edges.push(edge));
            return Ok([a, b, c]);
        }
        let corners = match table.get(usize::from(y)) {
            Some(corners) if y < 14 => *corners,
            _ => self.input.take(1)?[0],
        };
        if y >= 14 && corners == 0 {
            self.next = 0;
        }
        let a = if y == 15 {
            self.explicit()?
        } else {
            self.fresh()
        };
        let (b, new_b) = self.corner(corners >> 4)?;
        let (c, new_c) = self.corner(corners & 15)?;
        [[b, a], [c, b], [a, c]]
            .into_iter()
            .for_each(|edge| self.edges.push(edge));
        for (vertex, new) in [(a, true), (b, new_b), (c, new_c)] {
            if new {
                self.vertices.push(vertex);
            }
        }
        Ok([a, b, c])
    }
}

/// Decodes the indices of triangles.
fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (mut input, table) = Input::new(data, &[0xe1], 16)?;
    let codes = input.take(count)?;
    let mut state = Triangles {
        input,
        next: 0,
        last: 0,
        edges: Fifo::default(),
        vertices: Fifo::default(),
    };
    let mut out = Vec::with_capacity(3 * count);
    for code in codes {
        out.extend(state.triangle(*code, table)?);
    }
    state.input.end()?;
    Ok(out)
}

/// Decodes any indices.
fn indices(data: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (mut input, _) = Input::new(data, &[0xd1], 4)?;
    let mut last = [0u32; 2];
    let mut out = Vec::new();
    for _ in 0..count {
        let v = input.varint()?;
        let last = &mut last[(v & 1) as usize];
        *last = last.wrapping_add(unzigzag(v >> 1));
        out.push(*last);
    }
    input.end()?;
    Ok(out)
}

/// Applies a filter other than `NONE` to an element of attributes.
fn unfilter(filter: &str, element: &mut [u8]) {
    if filter == "EXPONENTIAL" {
        for bytes in element.chunks_exact_mut(4) {
            let v = i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let x = f64::from((v << 8) >> 8) * 2f64.powi(v >> 24);
            bytes.copy_from_slice(&(x as f32).to_le_bytes());
        }
        return;
    }
    // Four components of one or two bytes.
    let size = element.len() / 4;
    let largest = (1i32 << (8 * size)) - 1;
    let input: [i32; 4] = std::array::from_fn(|c| match element[c * size..][..size] {
        [a, b] => i16::from_le_bytes([a, b]).into(),
        ref bytes => i32::from(bytes[0] as i8),
    });
    let float = input.map(|x| x as f32);
    let mut out = input;
    match filter {
        "OCTAHEDRAL" => {
            let [x, y] = [float[0] / float[2], float[1] / float[2]];
            let z = 1.0 - x.abs() - y.abs();
            let t = z.min(0.0);
            let v = glam::Vec3::new(x - t.copysign(x), y - t.copysign(y), z);
            let scale = (largest / 2) as f32 / v.length();
            out[..3].copy_from_slice(&(v * scale).round().to_array().map(|x| x as i32));
        }
        "QUATERNION" => {
            let scale = std::f32::consts::FRAC_1_SQRT_2 / (input[3] | 3) as f32;
            let v = glam::Vec3::new(float[0], float[1], float[2]) * scale;
            let w = (1.0 - v.length_squared()).max(0.0).sqrt();
            let greatest = (input[3] & 3) as usize;
            for (k, x) in [w, v.x, v.y, v.z].into_iter().enumerate() {
                out[(greatest + k) % 4] = (x * 32767.0).round() as i32;
            }
        }
        _ => {
            let [y, co, cg, alpha] = [input[0] & largest, input[1], input[2], input[3] & largest];
            // The highest bit of alpha is the number of bits.
            let scale = (alpha.max(1) as u32).ilog2();
            let of = (1i32 << (scale + 1)) - 1;
            let a = alpha & (of >> 1);
            let colors = [y + co - cg, y + cg, y - co - cg, (a << 1) | (a & 1)];
            out = colors.map(|x| (x as f32 * (largest as f32 / of as f32)).round() as i32);
        }
    }
    for (bytes, x) in element.chunks_exact_mut(size).zip(out) {
        bytes.copy_from_slice(&x.to_le_bytes()[..size]);
    }
}
