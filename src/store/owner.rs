//! Who a process is, among all that may see one folder.

use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::{Value as Json, json};

use super::{Host, utc};

/// A process. Machines may have the same name, and numbers of processes come again, so neither alone says who it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Owner {
    /// The machine's name.
    pub(super) host: String,
    /// Tells this start of the machine's system from all others, if the system says so. Containers share it with what
    /// they run on, and with it the locks.
    pub(super) boot: String,
    /// Number of the process.
    pub(super) process: u32,
    /// Tells this process from another with the same number.
    pub(super) token: String,
}

impl Owner {
    /// This process. Every call is another owner.
    pub(super) fn here() -> Owner {
        let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Owner { boot: boot.trim().to_owned(), ..Owner::named(&Host::here().name, std::process::id()) }
    }

    /// A process of a machine of which only the name is known.
    pub(super) fn named(host: &str, process: u32) -> Owner {
        let moment = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        // Clocks of containers that start at once may agree, and so may their processes' numbers.
        let place = std::ptr::from_ref(&moment) as usize;
        let mix = blake3::hash(format!("{host} {process} {moment} {place}").as_bytes()).to_hex();
        Owner { host: host.to_owned(), boot: String::new(), process, token: mix[..12].to_owned() }
    }

    /// Whether both see each other's locks: they run on the same boot of the same machine.
    pub(super) fn same_machine(&self, other: &Owner) -> bool {
        self.host == other.host && self.boot == other.boot
    }

    /// For people.
    pub(super) fn words(&self) -> String {
        format!("process {} on {}", self.process, self.host)
    }

    /// A name for files: `<host>-<process>-<token>`.
    pub(super) fn name(&self) -> String {
        let host: String =
            self.host.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' }).collect();
        let host = if host.is_empty() { "nameless" } else { host.trim_start_matches('.') };
        format!("{}-{}-{}", &host[..host.len().min(64)], self.process, self.token)
    }

    /// The fields of a file that says whose it is.
    pub(super) fn json(&self) -> Json {
        let Owner { host, boot, process, token } = self;
        json!({ "host": host, "boot": boot, "process": process, "token": token })
    }

    /// The text of a claim.
    pub(super) fn text(&self) -> String {
        let mut json = self.json();
        json["since"] = utc(SystemTime::now()).into();
        json.to_string() + "\n"
    }

    /// Whose a file is, if it says so.
    pub(super) fn read(text: &str) -> Option<Owner> {
        Owner::from_json(&serde_json::from_str(text).ok()?)
    }

    /// [`Owner::json`] backwards. Earlier versions named no boot.
    pub(super) fn from_json(json: &Json) -> Option<Owner> {
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
    use super::*;

    #[test]
    fn owners_are_told_apart_and_read_back() {
        let (a, b) = (Owner::here(), Owner::here());
        assert!(a != b && a.same_machine(&b) && a.name() != b.name());
        assert_eq!(Owner::read(&a.text()), Some(a.clone()));
        assert_eq!(Owner::read("{}"), None);
        let odd = Owner { host: "../a b\u{e9}".to_owned(), ..a };
        assert!(
            odd.name().chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c)) && !odd.name().starts_with('.')
        );
        assert!(Owner { host: String::new(), ..odd }.name().starts_with("nameless-"));
    }
}
