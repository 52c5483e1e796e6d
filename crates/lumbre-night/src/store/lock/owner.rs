//! Identity of a process among all processes, on any machine, that share a folder.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::store::schema::process::{ClaimFile, Owner};
use crate::store::schema::{StoredFile, one_line};
use crate::store::{Host, utc};

impl Owner {
    /// Identity of this process. Every call generates another token.
    pub(crate) fn current() -> Owner {
        let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Owner {
            boot: boot.trim().to_owned(),
            ..Owner::named(&Host::detect().name, std::process::id())
        }
    }

    /// Identity of a process on a machine of which only the name is known.
    pub(crate) fn named(host: &str, process: u32) -> Owner {
        let moment = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default()
            .as_nanos();
        // Containers started together may have equal clocks and process numbers.
        let address = std::ptr::from_ref(&moment) as usize;
        let mix = blake3::hash(format!("{host} {process} {moment} {address}").as_bytes()).to_hex();
        Owner {
            host: host.to_owned(),
            boot: String::new(),
            process,
            token: mix[..12].to_owned(),
        }
    }

    /// Whether both run on the same boot of the same machine, and so see each other's file locks.
    pub(crate) fn same_machine(&self, other: &Owner) -> bool {
        self.host == other.host && self.boot == other.boot
    }

    /// Description for messages: `process <number> on <host>`.
    pub(crate) fn description(&self) -> String {
        format!("process {} on {}", self.process, self.host)
    }

    /// Name for files: `<host>-<process>-<token>`.
    pub(crate) fn name(&self) -> String {
        let host: String = self
            .host
            .chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() || c == '.' {
                    c
                } else {
                    '_'
                }
            })
            .collect();
        let host = if host.is_empty() {
            "nameless"
        } else {
            host.trim_start_matches('.')
        };
        format!(
            "{}-{}-{}",
            &host[..host.len().min(64)],
            self.process,
            self.token
        )
    }

    /// Content of a claim file, with the current date.
    pub(crate) fn claim_text(&self) -> String {
        one_line(&ClaimFile {
            owner: self.clone(),
            since: utc(SystemTime::now()),
            ..ClaimFile::default()
        })
    }

    /// Parses the content of a claim file. Returns `None` if it names no owner.
    pub(crate) fn parse(text: &str) -> Option<Owner> {
        ClaimFile::parse(text.as_bytes())
            .ok()
            .map(|claim| claim.owner)
    }
}

#[cfg(test)]
mod tests {
    use crate::store::lock::owner::*;

    #[test]
    fn owners_are_told_apart_and_read_back() {
        let (a, b) = (Owner::current(), Owner::current());
        assert!(a != b && a.same_machine(&b) && a.name() != b.name());
        assert_eq!(Owner::parse(&a.claim_text()), Some(a.clone()));
        assert_eq!(Owner::parse("{}"), None);
        let odd = Owner {
            host: "../a b\u{e9}".to_owned(),
            ..a
        };
        assert!(
            odd.name()
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || "._-".contains(c))
                && !odd.name().starts_with('.')
        );
        assert!(
            Owner {
                host: String::new(),
                ..odd
            }
            .name()
            .starts_with("nameless-")
        );
    }
}
