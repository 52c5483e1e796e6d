//! The memory that this process may use: the least of the option `--memory`, the machine, the
//! control groups that contain the process, and the limit of its address space.

use std::path::Path;

/// A limit of memory, and where it comes from. Its text is `1.0 GiB are free`, with the source.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryLimit {
    /// Number of bytes.
    pub bytes: u64,
    /// Source of the limit, as it follows the number of bytes in a sentence.
    pub source: String,
}

impl std::fmt::Display for MemoryLimit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", gibibytes(self.bytes), self.source)
    }
}

/// Formats a number of bytes: `1.5 GiB`, and below a tenth of that `96.0 MiB`.
pub(super) fn gibibytes(bytes: u64) -> String {
    let mebibytes = bytes as f64 / (1u64 << 20) as f64;
    if mebibytes < 102.4 {
        format!("{mebibytes:.1} MiB")
    } else {
        format!("{:.1} GiB", mebibytes / 1024.0)
    }
}

/// A limit and how much of it is used, in bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Usage {
    limit: u64,
    used: u64,
}

/// Returns the memory that runs may take now, or `None` if the system states no limit. `given` is
/// the limit of the option `--memory`, `kept` the memory that this process keeps for them, in
/// bytes.
pub fn free(given: Option<u64>, kept: u64) -> Option<MemoryLimit> {
    least(given, "free", |usage| {
        usage.limit.saturating_sub(usage.used).saturating_add(kept)
    })
}

/// Returns the memory that runs could take if nothing else used any, or `None` if the system states
/// no limit. `given` is the limit of the option `--memory` in bytes.
pub fn total(given: Option<u64>) -> Option<MemoryLimit> {
    least(given, "available in all", |usage| usage.limit)
}

/// Returns the least limit, of which `bytes` says how much counts.
fn least(given: Option<u64>, what: &str, bytes: impl Fn(Usage) -> u64) -> Option<MemoryLimit> {
    let machine = available_and_total().map(|[available, limit]| Usage {
        limit,
        used: limit.saturating_sub(available),
    });
    let by_system = [
        (machine, "on this machine"),
        (
            control_group(Path::new("/")),
            "in the control group of this process",
        ),
        (
            address_space(),
            "in the address space of this process (`ulimit -v`)",
        ),
    ];
    let by_system = by_system.into_iter().filter_map(|(usage, place)| {
        Some(MemoryLimit {
            bytes: bytes(usage?),
            source: format!("are {what} {place}"),
        })
    });
    let by_user = given.map(|bytes| MemoryLimit {
        bytes,
        source: "are allowed by `--memory`".to_owned(),
    });
    by_system.chain(by_user).min_by_key(|limit| limit.bytes)
}

/// Address space that the program needs to render a small night, in bytes. With less it is ended by
/// the first allocation or thread that fails.
const LEAST_ADDRESS_SPACE: u64 = 1 << 30;

/// Returns an error message if the address space of this process is too small for the program.
pub fn address_space_shortage() -> Option<String> {
    let limit = address_space()?.limit;
    (limit < LEAST_ADDRESS_SPACE).then(|| {
        format!(
            "the address space of this process is limited to {} MiB (`ulimit -v`), but the program needs \
             at least {} MiB: raise the limit",
            limit >> 20,
            LEAST_ADDRESS_SPACE >> 20
        )
    })
}

/// Returns the limit of the address space of this process, unless it is unlimited.
fn address_space() -> Option<Usage> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    Some(Usage {
        limit: soft_limit(&limits, "Max address space")?,
        used: process_bytes("self", "VmSize:")?,
    })
}

/// Returns a soft limit in the text of `/proc/self/limits`, unless it is unlimited.
fn soft_limit(limits: &str, name: &str) -> Option<u64> {
    let rest = limits.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Returns the control group with the least free memory among those that contain this process,
/// below a root folder that is `/` outside tests.
fn control_group(root: &Path) -> Option<Usage> {
    let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    let mounted = root.join("sys/fs/cgroup");
    let mut found = Vec::new();
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':');
        let (Some(_), Some(controllers), Some(path)) =
            (fields.next(), fields.next(), fields.next())
        else {
            continue;
        };
        // Version 2 has one hierarchy without names of controllers, version 1 one for each.
        let (folder, limit, used) = if controllers.is_empty() {
            (mounted.clone(), "memory.max", "memory.current")
        } else if controllers.split(',').any(|name| name == "memory") {
            let names = ["memory.limit_in_bytes", "memory.usage_in_bytes"];
            (mounted.join("memory"), names[0], names[1])
        } else {
            continue;
        };
        // A container may see its own group as the root, where the path does not exist.
        for group in Path::new(path.trim_start_matches('/')).ancestors() {
            let group = folder.join(group);
            let bytes = |name: &str| number(&group.join(name));
            if let (Some(limit), Some(used)) = (bytes(limit), bytes(used)) {
                let used = used.saturating_sub(inactive_file_bytes(&group));
                found.push(Usage { limit, used });
            }
        }
    }
    found
        .into_iter()
        .min_by_key(|usage| usage.limit.saturating_sub(usage.used))
}

/// Returns the bytes of cached files of a control group, which the system frees on demand.
fn inactive_file_bytes(group: &Path) -> u64 {
    let statistics = std::fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let value = |name| {
        let mut lines = statistics.lines();
        lines.find_map(|line| line.strip_prefix(name)?.trim().parse().ok())
    };
    value("total_inactive_file ")
        .or_else(|| value("inactive_file "))
        .unwrap_or(0)
}

/// Returns the number in a file, or `None` for the word `max` and for a file that is not there.
fn number(file: &Path) -> Option<u64> {
    std::fs::read_to_string(file).ok()?.trim().parse().ok()
}

/// Available and total bytes of memory of the machine; `None` on systems without `/proc/meminfo`.
pub fn available_and_total() -> Option<[u64; 2]> {
    parse_meminfo(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// Bytes under a key such as `VmRSS:` of `/proc/<process>/status`, where `process` is a number or
/// `self`; `None` on systems without that file.
pub fn process_bytes(process: &str, key: &str) -> Option<u64> {
    bytes_after(
        &std::fs::read_to_string(format!("/proc/{process}/status")).ok()?,
        key,
    )
}

fn parse_meminfo(text: &str) -> Option<[u64; 2]> {
    Some([
        bytes_after(text, "MemAvailable:")?,
        bytes_after(text, "MemTotal:")?,
    ])
}

fn bytes_after(text: &str, key: &str) -> Option<u64> {
    number_after(text, key).map(|kilobytes| kilobytes * 1024)
}

fn number_after(text: &str, key: &str) -> Option<u64> {
    text.lines()
        .find_map(|line| line.strip_prefix(key))?
        .split_whitespace()
        .next()?
        .parse()
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes files below a new folder.
    fn root(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn the_tightest_control_group_counts() {
        let nested = root(&[
            ("proc/self/cgroup", "0::/night/job\n"),
            ("sys/fs/cgroup/night/memory.max", "4000\n"),
            ("sys/fs/cgroup/night/memory.current", "3500\n"),
            (
                "sys/fs/cgroup/night/memory.stat",
                "anon 3\ninactive_file 500\n",
            ),
            ("sys/fs/cgroup/night/job/memory.max", "max\n"),
            ("sys/fs/cgroup/night/job/memory.current", "3500\n"),
        ]);
        let expected = Usage {
            limit: 4000,
            used: 3000,
        };
        assert_eq!(control_group(nested.path()), Some(expected));
        let first_version = root(&[
            ("proc/self/cgroup", "9:name=systemd:/\n4:memory:/a\n0::/\n"),
            ("sys/fs/cgroup/memory/a/memory.limit_in_bytes", "100"),
            ("sys/fs/cgroup/memory/a/memory.usage_in_bytes", "30"),
        ]);
        let expected = Usage {
            limit: 100,
            used: 30,
        };
        assert_eq!(control_group(first_version.path()), Some(expected));
        assert_eq!(control_group(root(&[]).path()), None);
    }

    #[test]
    fn the_limit_of_the_address_space_is_read() {
        let text = "Limit                Soft Limit     Hard Limit    Units\n\
                    Max address space    2147483648     unlimited     bytes\n\
                    Max file locks       unlimited      unlimited     locks\n";
        assert_eq!(soft_limit(text, "Max address space"), Some(1 << 31));
        assert_eq!(soft_limit(text, "Max file locks"), None);
    }

    #[test]
    fn the_least_limit_is_named() {
        let given = Some(1 << 20);
        for limit in [free(given, 0), total(given)] {
            assert_eq!(
                limit.unwrap().to_string(),
                "1.0 MiB are allowed by `--memory`"
            );
        }
        let [free, total] = [free(None, 0).unwrap(), total(None).unwrap()];
        assert!(0 < free.bytes && free.bytes < total.bytes, "{free} {total}");
    }

    #[test]
    fn meminfo_is_parsed() {
        let text =
            "MemTotal:       16316412 kB\nMemFree:         1 kB\nMemAvailable:    8158206 kB\n";
        assert_eq!(
            parse_meminfo(text),
            Some([8_158_206 * 1024, 16_316_412 * 1024])
        );
        assert_eq!(parse_meminfo("MemTotal: 1 kB\n"), None);
        assert_eq!(
            number_after("VmPeak: 1 kB\nVmRSS:       16316412 kB\n", "VmRSS:"),
            Some(16_316_412)
        );
    }
}
