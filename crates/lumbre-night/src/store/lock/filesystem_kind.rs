//! Detection of the kind of file system that a folder lies on.

use std::fs;
use std::path::{Path, PathBuf};

/// Kinds of file systems that several machines can mount.
const NETWORK: [&str; 17] = [
    "nfs", "nfs4", "lustre", "gpfs", "beegfs", "cifs", "smb3", "smbfs", "ceph", "9p", "virtiofs",
    "afs", "ocfs2", "gfs2", "orangefs", "panfs", "wekafs",
];

/// Returns the kind of file system of a folder, or of its nearest ancestor that exists. Returns
/// `None` if `/proc/self/mountinfo` cannot be read.
pub fn detect(folder: &Path) -> Option<String> {
    let absolute = std::path::absolute(folder).ok()?;
    let real = absolute.ancestors().find_map(|f| f.canonicalize().ok())?;
    kind_from_mountinfo(&fs::read_to_string("/proc/self/mountinfo").ok()?, &real)
}

/// Whether a kind of file system is a network file system.
pub fn is_network(kind: &str) -> bool {
    NETWORK.contains(&kind) || kind.starts_with("fuse.")
}

/// Returns the kind of the mount with the longest path above a folder. Of several mounts on the
/// same path, the last one counts.
fn kind_from_mountinfo(mounts: &str, folder: &Path) -> Option<String> {
    let mounts = mounts.lines().filter_map(|line| {
        let (before, after) = line.split_once(" - ")?;
        let mount_point = before.split(' ').nth(4)?.replace("\\040", " ");
        Some((
            PathBuf::from(mount_point),
            after.split(' ').next()?.to_owned(),
        ))
    });
    let above = mounts.filter(|(mount_point, _)| folder.starts_with(mount_point));
    above
        .max_by_key(|(mount_point, _)| mount_point.components().count())
        .map(|(_, kind)| kind)
}

#[cfg(test)]
mod tests {
    use crate::store::lock::filesystem_kind::*;

    #[test]
    fn the_nearest_mount_above_counts() {
        let mounts = "22 1 254:0 / / rw - ext4 /dev/vda rw\n\
            40 22 0:40 / /scratch rw,relatime shared:1 - lustre mds@tcp:/fs rw\n\
            41 40 0:41 / /scratch/a\\040b rw - nfs4 server:/x rw\n";
        let kind = |path: &str| kind_from_mountinfo(mounts, Path::new(path)).unwrap();
        assert_eq!(kind("/etc/x"), "ext4");
        assert_eq!(kind("/scratch/out"), "lustre");
        assert_eq!(kind("/scratch/a b/out"), "nfs4");
        assert_eq!(kind("/scratchy"), "ext4");
        assert!(
            is_network("nfs4")
                && is_network("fuse.sshfs")
                && !is_network("ext4")
                && !is_network("tmpfs")
        );
        assert!(detect(Path::new("/")).is_none_or(|kind| !kind.is_empty()));
    }
}
