//! Work that outlives kills at any moment, full disks and a second editor.

use super::super::request;
use super::super::work::Work;
use super::*;
use monro_anatomy::desk::Desk;
use monro_anatomy::edit::{Rule, Selection};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

fn grid() -> Grid {
    Grid::axis_aligned([6, 5, 4], [1.0, 1.0, 2.0], [0.0; 3]).expect("grid")
}

fn subject() -> Subject {
    Subject { scan: "scan-1".into(), origin: "automatic".into(), known: Known::default() }
}

fn open(folder: &Path) -> Result<(Store, Editor, Vec<String>), StoreError> {
    let start = || Ok(Start { labels: Volume::filled(grid(), 4), known: Known::default() });
    Store::open(folder, &grid(), &mut subject(), start)
}

/// The edit number `n`: one voxel of its own gets another label.
fn edit(editor: &mut Editor, n: usize) {
    let one = Selection::from_voxels(grid(), vec![n % 120]);
    let label = [5, 6, 7, 4][n / 120 % 4];
    let changed = editor.paint(&one, label, &Rule::anything()).expect("paint");
    assert_eq!(changed.count(), 1);
}

#[test]
fn a_journal_cut_at_any_byte_gives_back_every_edit_before_the_cut() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, mut editor, _) = open(&folder).expect("begun");
    let length = |f: &Path| fs::metadata(f.join("journal")).expect("journal").len();
    let mut ends = vec![length(&folder)];
    let mut states = vec![editor.labels().clone()];
    for n in 0..5 {
        edit(&mut editor, n);
        store.append(&editor.take_journal()).expect("room");
        ends.push(length(&folder));
        states.push(editor.labels().clone());
    }
    drop(store);
    let bytes = fs::read(folder.join("journal")).expect("journal");
    for cut in 0..=bytes.len() {
        fs::write(folder.join("journal"), &bytes[..cut]).expect("cut");
        let whole = ends.iter().filter(|&&end| end <= cut as u64).count().max(1) - 1;
        let (mut store, mut editor, notes) = open(&folder).expect("resumed");
        assert_eq!(editor.labels(), &states[whole], "cut at byte {cut}");
        let torn = notes.iter().any(|n| n.contains("torn"));
        assert_eq!(torn, cut > 0 && !ends.contains(&(cut as u64)), "cut at byte {cut}: {notes:?}");
        // Going on after the cut is as good as before it.
        edit(&mut editor, 77);
        store.append(&editor.take_journal()).expect("room");
        let wanted = editor.labels().clone();
        drop(store);
        assert_eq!(open(&folder).expect("resumed").1.labels(), &wanted, "after byte {cut}");
    }
}

#[test]
fn a_start_that_was_killed_before_its_end_begins_anew() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    drop(open(&folder).expect("begun"));
    // The description is written last.
    fs::remove_file(folder.join("edit.json")).expect("description");
    fs::write(folder.join("base.nii.gz"), b"half a file").expect("base");
    let (mut store, mut editor, notes) = open(&folder).expect("begun again");
    assert!(notes.is_empty(), "{notes:?}");
    edit(&mut editor, 3);
    store.append(&editor.take_journal()).expect("room");
    drop(store);
    assert_eq!(open(&folder).expect("resumed").1.labels(), editor.labels());
}

#[test]
fn a_second_editor_of_the_same_work_is_refused_and_changes_nothing() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, mut editor, _) = open(&folder).expect("begun");
    edit(&mut editor, 0);
    store.append(&editor.take_journal()).expect("room");
    let before = fs::read(folder.join("journal")).expect("journal");
    let said = open(&folder).expect_err("in use").to_string();
    assert!(said.contains("case.edit") && said.contains("another program"), "{said}");
    assert_eq!(fs::read(folder.join("journal")).expect("journal"), before);
    drop(store);
    assert_eq!(open(&folder).expect("resumed").1.labels(), editor.labels());
}

#[test]
fn an_edit_on_a_full_disk_is_written_with_the_next_one() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, mut editor, _) = open(&folder).expect("begun");
    let writable = store.journal.try_clone().expect("handle");
    // Writing to a handle for reading fails as a full disk does, after the half of a record came through.
    store.journal = File::open(folder.join("journal")).expect("handle");
    edit(&mut editor, 0);
    let bytes = editor.take_journal();
    (&writable).write_all(&bytes[..bytes.len() / 2]).expect("half");
    assert!(store.append(&bytes).is_err());
    assert!(store.append(&[]).is_err(), "still not saved");
    store.journal = writable;
    edit(&mut editor, 1);
    store.append(&editor.take_journal()).expect("room");
    drop(store);
    let (_store, back, notes) = open(&folder).expect("resumed");
    assert_eq!(back.labels(), editor.labels());
    assert!(notes[0].contains("(2 entries)"), "{notes:?}");
}

#[test]
fn labels_of_the_case_that_changed_put_the_earlier_edits_aside() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, mut editor, _) = open(&folder).expect("begun");
    edit(&mut editor, 0);
    store.append(&editor.take_journal()).expect("room");
    drop(store);
    let mut other = Subject { origin: "drawn elsewhere".into(), ..subject() };
    let start = || Ok(Start { labels: Volume::filled(grid(), 2), known: Known::default() });
    let (_store, now, notes) = Store::open(&folder, &grid(), &mut other, start).expect("begun again");
    assert_eq!(now.labels(), &Volume::filled(grid(), 2));
    assert!(notes[0].contains("case.edit.1"), "{notes:?}");
    assert_eq!(open(&dir.path().join("case.edit.1")).expect("the earlier work").1.labels(), editor.labels());
}

#[test]
fn labels_that_cannot_be_used_leave_no_folder_behind() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let start = || Err("they are of another head".to_owned());
    let said = Store::open(&folder, &grid(), &mut subject(), start).expect_err("bad labels").to_string();
    assert!(said.contains("another head"), "{said}");
    assert!(!folder.exists());
}

#[test]
fn labels_that_could_not_be_used_took_the_earlier_edits_away() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, mut editor, _) = open(&folder).expect("begun");
    edit(&mut editor, 0);
    store.append(&editor.take_journal()).expect("room");
    drop(store);
    let mut other = Subject { origin: "bad.nii.gz".into(), ..subject() };
    let start = || Err("bad.nii.gz: label 9 is unknown".to_owned());
    let said = Store::open(&folder, &grid(), &mut other, start).expect_err("bad labels").to_string();
    assert!(said.contains("label 9") && !said.contains("move the folder"), "{said}");
    assert!(!dir.path().join("case.edit.1").exists());
    let (_store, back, notes) = open(&folder).expect("the earlier work");
    assert_eq!(back.labels(), editor.labels());
    assert!(notes[0].contains("restored"), "{notes:?}");
}

#[test]
fn a_step_that_was_called_saved_was_lost_by_a_power_cut() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let (mut store, editor, _) = open(&folder).expect("begun");
    // It takes all bytes and writes none through, as a disk that is about to fail.
    let null = OpenOptions::new().write(true).open("/dev/null").expect("handle");
    let journal = core::mem::replace(&mut store.journal, null);
    let mut work = Work::new(Desk::new(Volume::filled(grid(), 30i16), editor).expect("a desk"), store);
    let say = |work: &mut Work, text: &str| {
        let request = request::parse(text).expect("understood");
        let is_dab = request.paints();
        work.answer(1, request).expect("done");
        work.save(!is_dab).1
    };
    let dab = r#"{"id":1,"op":"brush","target":{"label":5},"axis":2,"slice":1,"points":[[2,2]],"radius_mm":2,"flat":true,"erase":false}"#;
    assert!(say(&mut work, dab).is_ok(), "the disk is not waited for while the mouse moves");
    let [end, undo] = [r#"{"id":2,"op":"end_stroke"}"#, r#"{"id":3,"op":"undo"}"#];
    assert!(say(&mut work, end).is_err() && say(&mut work, undo).is_err(), "not on the disk");
    work.store.journal = journal;
    assert!(say(&mut work, r#"{"id":4,"op":"state"}"#).is_ok());
}

const FOLDER: &str = "MONRO_TEST_EDIT_FOLDER";

/// Not a test by itself: edits without end, and says the number of each edit that is saved.
#[test]
#[ignore = "the killed program of the test below"]
fn edits_until_it_is_killed() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let (mut store, mut editor, _) = open(Path::new(&folder)).expect("opened");
    for n in editor.steps().0.. {
        edit(&mut editor, n);
        store.append(&editor.take_journal()).expect("room");
        println!("saved {}", n + 1);
    }
}

#[test]
fn a_program_killed_at_any_moment_has_kept_every_edit_that_it_called_saved() {
    let dir = tempfile::tempdir().expect("temp");
    let folder = dir.path().join("case.edit");
    let name = format!("{}::edits_until_it_is_killed", module_path!().split_once("::").expect("crate").1);
    for round in 0..12 {
        let mut child = Command::new(std::env::current_exe().expect("this test"))
            .args([&name, "--exact", "--ignored", "--nocapture"])
            .env(FOLDER, &folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("child");
        let mut lines = BufReader::new(child.stdout.take().expect("its words")).lines();
        let number = |line: &str| line.strip_prefix("saved ").and_then(|n| n.parse::<usize>().ok());
        // Some edits in, each time another number of them, whatever it is doing then.
        let mut seen = 0;
        let mut last = 0;
        while seen < 3 + 7 * round {
            let line = lines.next().expect("the child still edits").expect("a line");
            if let Some(n) = number(&line) {
                (seen, last) = (seen + 1, n);
            }
        }
        child.kill().expect("killed");
        last = lines.map_while(Result::ok).filter_map(|l| number(&l)).last().unwrap_or(last);
        child.wait().expect("gone");
        let (store, editor, _) = open(&folder).expect("resumed");
        drop(store);
        let kept = editor.steps().0;
        assert!(kept >= last, "{last} edits were called saved, {kept} are there");
        let mut wanted = Editor::new(Volume::filled(grid(), 4));
        (0..kept).for_each(|n| edit(&mut wanted, n));
        assert_eq!(editor.labels(), wanted.labels(), "after {kept} edits");
    }
}
