//! Tests of several processes in one folder: claims, full disks, and leftovers of dead processes.

use super::*;
use crate::store::schema::run::ConfigFile;

#[test]
fn two_processes_claim_different_runs() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &["aa11", "bb22"]);
    let (first, second) = (
        Store::open(dir.path(), &plan, decode).unwrap(),
        Store::open(dir.path(), &plan, decode).unwrap(),
    );
    assert_eq!(first.folder(), second.folder());
    assert_eq!(
        first.claim(&plan, CellRef::Cell(0).into()).unwrap(),
        Claim::Granted
    );
    assert!(matches!(
        second.claim(&plan, CellRef::Cell(0).into()).unwrap(),
        Claim::HeldBy(_)
    ));
    assert_eq!(
        second.claim(&plan, CellRef::Cell(1).into()).unwrap(),
        Claim::Granted
    );
    drop(first);
    assert_eq!(
        eventually(|| second.claim(&plan, CellRef::Cell(0).into()).unwrap()),
        Claim::Granted
    );
}

#[test]
fn a_claim_on_a_full_disk_is_retried() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path(), &plan("night", "3f9a00", &["aa11"]), decode).unwrap();
    for kind in [ErrorKind::StorageFull, ErrorKind::QuotaExceeded] {
        let full = StoreError::io("claim", dir.path(), &kind.into());
        assert!(matches!(
            store.wait_if_disk_full(Err(full)).unwrap(),
            Claim::HeldBy(_)
        ));
        assert!(store.full.get());
        assert_eq!(
            store.wait_if_disk_full(Ok(Claim::Granted)).unwrap(),
            Claim::Granted
        );
        assert!(!store.full.get());
    }
    let denied = StoreError::io("claim", dir.path(), &ErrorKind::PermissionDenied.into());
    assert!(store.wait_if_disk_full(Err(denied)).is_err());
}

#[test]
fn nothing_is_removed_where_another_process_works_on_a_finished_run() {
    let dir = tempfile::tempdir().unwrap();
    let (plan, changed) = (
        plan("night", "3f9a00", &["aa11"]),
        plan("night", "77b200", &["aa11"]),
    );
    let (first, second) = (
        Store::open(dir.path(), &plan, decode).unwrap(),
        Store::open(dir.path(), &plan, decode).unwrap(),
    );
    let folder = layout::run_folder(first.folder(), &plan, 0);
    second.claim(&plan, CellRef::Cell(0).into()).unwrap();
    second.start(&plan, CellRef::Cell(0), None).unwrap();
    let working = ["ckpt.a", ".lumbre-1a.tmp", "claim"].map(|name| folder.join(name));
    for file in &working[..2] {
        fs::write(file, "x").unwrap();
    }
    // The same run in the night of a changed script.
    finish_run(
        &Store::open(dir.path(), &changed, decode).unwrap(),
        &changed,
        0,
    );
    let status = first.plan_status(&plan);
    assert_eq!(
        status.done,
        [CellRef::Cell(0)],
        "the run is finished in another night"
    );
    assert!(working.iter().all(|file| file.exists()));
    // It died.
    drop(second);
    eventually(|| {
        first.plan_status(&plan);
        match working.iter().any(|file| file.exists()) {
            true => Claim::HeldBy(String::new()),
            false => Claim::Granted,
        }
    });
    assert!(working.iter().all(|file| !file.exists()));
}

#[test]
fn cells_that_are_one_run_have_one_claim_and_one_folder() {
    let dir = tempfile::tempdir().unwrap();
    // Two cells with one id, such as a technique without the parameter of the other axis.
    let plan = plan("night", "3f9a00", &["aa11", "bb22", "aa11"]);
    let (first, second) = (
        Store::open(dir.path(), &plan, decode).unwrap(),
        Store::open(dir.path(), &plan, decode).unwrap(),
    );
    let [once, other, again] = [0, 1, 2].map(CellRef::Cell);
    assert_eq!(second.claim(&plan, again.into()).unwrap(), Claim::Granted);
    assert!(matches!(
        first.claim(&plan, once.into()).unwrap(),
        Claim::HeldBy(_)
    ));
    assert_eq!(first.claim(&plan, other.into()).unwrap(), Claim::Granted);
    finish_run(&second, &plan, 2);
    second.release(&plan, again.into());
    let folders = [once, again].map(|cell| first.finished_run(&plan, cell).unwrap().folder);
    assert_eq!(folders[0], folders[1]);
    // Nothing about it depends on which of its cells was rendered.
    let config = fs::read(folders[0].join(ConfigFile::NAME)).unwrap();
    config_file(&plan, once).write(&folders[0]).unwrap();
    assert_eq!(fs::read(folders[0].join(ConfigFile::NAME)).unwrap(), config);
    let reader = NightReader::open(first.folder()).unwrap();
    assert_eq!(reader.run_folder(again), folders[0]);
}

#[test]
fn leftovers_beside_the_last_file_are_removed() {
    let (dir, plan, store) = opened(&["aa11"]);
    finish_run(&store, &plan, 0);
    let reference = store.start(&plan, CellRef::Reference(0), None).unwrap();
    reference.write("ref.exr", b"I\x05").unwrap();
    reference.write_rows(&[row(1, 0)]).unwrap();
    // Left by a process that was killed while it tried to claim the run.
    let temporary = dir.path().join("refs/ee/ee00/.lumbre-7Q.tmp");
    fs::write(&temporary, "claim").unwrap();
    reference.finish(&results("ee00", 64)).unwrap();
    assert!(!temporary.exists());
    let home = store.folder().to_owned();
    drop(store);
    let folders = [
        layout::run_folder(&home, &plan, 0),
        dir.path().join("refs/ee/ee00"),
    ];
    let left: Vec<_> = folders
        .iter()
        .flat_map(|f| {
            ["claim", "ckpt.a", "ckpt.b", "failed.json", ".lumbre-1a.tmp"].map(|name| f.join(name))
        })
        .collect();
    // Child processes of other tests may hold a lock for a moment, so try repeatedly.
    let is_removed = |mut clean_up: Box<dyn FnMut() + '_>| {
        left.iter()
            .for_each(|file| fs::write(file, "left by a dead process").unwrap());
        let since = std::time::Instant::now();
        while left.iter().any(|file| file.exists()) {
            clean_up();
            let stays: Vec<_> = left.iter().filter(|file| file.exists()).collect();
            assert!(
                since.elapsed() < std::time::Duration::from_secs(20),
                "{stays:?}"
            );
        }
    };
    is_removed(Box::new(|| {
        drop(Store::open(dir.path(), &plan, decode).unwrap())
    }));
    let worker = Store::join(
        &home,
        &plan,
        &PlanSnapshot::default(),
        decode,
        &WorkerInfo::default(),
    )
    .unwrap();
    is_removed(Box::new(|| assert_eq!(worker.plan_status(&plan).open, 0)));
}

#[test]
fn the_last_process_removes_temporary_files_of_dead_ones() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan("night", "3f9a00", &[]);
    let open = || Store::open(dir.path(), &plan, decode).unwrap();
    let (first, second) = (open(), open());
    first.write("tables/errors.csv", b"rmse").unwrap();
    let half = first.folder().join("tables/.lumbre-3kQ.tmp");
    fs::write(&half, b"rm").unwrap();
    drop(first);
    assert!(half.exists(), "the second process may be writing it");
    let tables = half.parent().unwrap().to_owned();
    drop(second);
    assert_eq!(
        fs::read_dir(tables)
            .unwrap()
            .flatten()
            .map(|e| e.file_name())
            .collect::<Vec<_>>(),
        ["errors.csv"]
    );
}

#[test]
fn an_unwritable_folder_is_detected_at_once() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("out"), b"a file").unwrap();
    let plan = plan("night", "3f9a00", &[]);
    let error = Store::open(&dir.path().join("out"), &plan, decode).unwrap_err();
    assert!(matches!(error, StoreError::Unwritable { .. }), "{error}");
}
