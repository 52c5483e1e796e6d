//! Identity of a process among all processes, on any machine, that share a folder.

use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::{Value as Json, json};

use crate::store::{Host, utc};

/// Identity of a process. Neither the machine's name nor the process number is unique, so a boot id
/// and a random token are added.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Owner {
    /// Name of the machine.
    pub(crate) host: String,
    /// Boot id of the operating system, empty if unknown. Containers share it with their host, and
    /// with it the file locks.
    pub(crate) boot: String,
    /// Number of the process.
    pub(crate) process: u32,
    /// Token that distinguishes processes with the same number.
    pub(crate) token: String,
}

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

    /// Fields that identify the owner in JSON files.
    pub(crate) fn to_json(&self) -> Json {
        let Owner {
            host,
            boot,
            process,
            token,
        } = self;
        json!({ "host": host, "boot": boot, "process": process, "token": token })
    }

    /// Content of a claim file, with the current date.
    pub(crate) fn claim_text(&self) -> String {
        let mut json = self.to_json();
        json["since"] = utc(SystemTime::now()).into();
        json.to_string() + "\n"
    }

    /// Parses the content of a claim file. Returns `None` if it names no owner.
    pub(crate) fn parse(text: &str) -> Option<Owner> {
        Owner::from_json(&serde_json::from_str(text).ok()?)
    }

    /// Reads the fields written by [`Owner::to_json`]. Earlier versions wrote no `boot`.
    pub(crate) fn from_json(json: &Json) -> Option<Owner> {
        Some(Owner {
            host: json["host"].as_str()?.to_owned(),
            boot: json["boot"].as_str().unwrap_or_default().to_owned(),
            process: u32::try_from(json["process"].as_u64()?).ok()?,
            token: json["token"].as_str()?.to_owned(),
        })
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
