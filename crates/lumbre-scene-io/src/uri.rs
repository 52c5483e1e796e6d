//! Percent-encoding in addresses of files [RFC 3986, section 2.1].

/// Percent-encodes one component of a URL.
pub fn encoded(part: &str) -> String {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.=+,~".contains(&b);
    part.bytes()
        .map(|b| {
            if is_plain(b) {
                char::from(b).to_string()
            } else {
                format!("%{b:02X}")
            }
        })
        .collect()
}

/// Returns an address with its percent-encoded characters decoded.
pub fn decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut out, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let hex = |k: usize| bytes.get(at + k).and_then(|b| (*b as char).to_digit(16));
        match (bytes[at], hex(1), hex(2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                at += 3;
            }
            (b, ..) => {
                out.push(b);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_encoded_and_decoded() {
        assert_eq!(decoded("a%20b/%C3%A9%"), "a b/é%");
        assert_eq!(encoded("a bé#"), "a%20b%C3%A9%23");
    }
}
