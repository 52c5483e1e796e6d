//! What kind of file system a folder lies on.

use std::fs;
use std::path::{Path, PathBuf};

/// Kinds whose files other machines see.
const NETWORK: [&str; 17] = [
    "nfs", "nfs4", "lustre", "gpfs", "beegfs", "cifs", "smb3", "smbfs", "ceph", "9p", "virtiofs", "afs", "ocfs2",
    "gfs2", "orangefs", "panfs", "wekafs",
];

/// The kind of file system that a folder, or the nearest one above it that is there, lies on; `None` where the system
/// does not say.
pub fn kind(folder: &Path) -> Option<String> {
    let absolute = std::path::absolute(folder).ok()?;
    let real = absolute.ancestors().find_map(|f| f.canonicalize().ok())?;
    kind_in(&fs::read_to_string("/proc/self/mountinfo").ok()?, &real)
}

/// Whether a kind of file system is one that machines share.
pub fn is_network(kind: &str) -> bool {
    NETWORK.contains(&kind) || kind.starts_with("fuse.")
}

/// The kind of the mount with the longest path above a folder; of several at one place, the last.
fn kind_in(mounts: &str, folder: &Path) -> Option<String> {
    let mounts = mounts.lines().filter_map(|line| {
        let (before, after) = line.split_once(" - ")?;
        let place = before.split(' ').nth(4)?.replace("\\040", " ");
        Some((PathBuf::from(place), after.split(' ').next()?.to_owned()))
    });
    let above = mounts.filter(|(place, _)| folder.starts_with(place));
    above.max_by_key(|(place, _)| place.components().count()).map(|(_, kind)| kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_mount_above_counts() {
        let mounts = "22 1 254:0 / / rw - ext4 /dev/vda rw\n\
            40 22 0:40 / /scratch rw,relatime shared:1 - lustre mds@tcp:/fs rw\n\
            41 40 0:41 / /scratch/a\\040b rw - nfs4 server:/x rw\n";
        let kind = |path: &str| kind_in(mounts, Path::new(path)).unwrap();
        assert_eq!(kind("/etc/x"), "ext4");
        assert_eq!(kind("/scratch/out"), "lustre");
        assert_eq!(kind("/scratch/a b/out"), "nfs4");
        assert_eq!(kind("/scratchy"), "ext4");
        assert!(is_network("nfs4") && is_network("fuse.sshfs") && !is_network("ext4") && !is_network("tmpfs"));
        assert!(super::kind(Path::new("/")).is_none_or(|kind| !kind.is_empty()));
    }
}
