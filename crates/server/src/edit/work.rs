//! Desk and file, changed together, by any number of pages.

use super::request::{self, Request};
use super::store::{Store, StoreError};
use monro_anatomy::desk::Desk;
use serde_json::Value;

/// Desk and file, changed together.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) desk: Desk,
    pub(super) store: Store,
    /// The page whose stroke of the brush is under way.
    painter: Option<u64>,
}

impl Work {
    pub(super) const fn new(desk: Desk, store: Store) -> Self {
        Self { desk, store, painter: None }
    }

    /// Does what a message of a page asks; the answer without its id. A stroke is of one page: that of another ends before,
    /// so that each is a step of its own to undo.
    ///
    /// # Errors
    /// A sentence for the user.
    pub(super) fn answer(&mut self, page: u64, request: Request) -> Result<Value, String> {
        let is_own = self.painter.is_none_or(|painter| painter == page);
        if request.ends_stroke() && !is_own {
            return request::answer(&mut self.desk, Request::state(request.id));
        }
        if request.paints() {
            if !is_own {
                self.desk.end_stroke();
            }
            self.painter = Some(page);
        } else if request.ends_stroke() {
            self.painter = None;
        }
        request::answer(&mut self.desk, request)
    }

    /// Appends what was edited to the journal, and says whether that was anything; with `through` all of it is on the disk
    /// on return. Not for each dab of a stroke, which come faster than disks write.
    pub(super) fn save(&mut self, through: bool) -> (bool, Result<(), StoreError>) {
        let bytes = self.desk.take_journal();
        let appended = self.store.append(&bytes);
        let kept = if through { appended.and_then(|()| self.store.sync()) } else { appended };
        (!bytes.is_empty(), kept)
    }

    /// A page has gone, maybe in the middle of a stroke.
    pub(super) fn leave(&mut self, page: u64) {
        if self.painter == Some(page) {
            self.painter = None;
            self.desk.end_stroke();
            // Nobody is left to be told; the next step tries again.
            let _ = self.store.sync();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Known, Start, Subject};
    use super::*;
    use monro_geometry::{Grid, Volume};

    fn work(folder: &std::path::Path) -> Work {
        let grid = Grid::axis_aligned([40, 40, 6], [1.0; 3], [0.0; 3]).expect("grid");
        let mut subject = Subject { scan: "scan-1".into(), origin: "automatic".into(), known: Known::default() };
        let start = || Ok(Start { labels: Volume::filled(grid, 4), known: Known::default() });
        let (store, editor, _) = Store::open(&folder.join("case.edit"), &grid, &mut subject, start).expect("begun");
        Work::new(Desk::new(Volume::filled(grid, 30i16), editor).expect("a desk"), store)
    }

    /// A dab of a label around a place, or another message, of a page; the steps that can be undone then.
    fn say(work: &mut Work, page: u64, message: &str) -> u64 {
        let said = work.answer(page, request::parse(message).expect("understood")).expect("done");
        assert!(said["error"].is_null(), "{said}");
        work.answer(page, Request::state(0)).expect("told")["state"]["past"].as_u64().expect("steps")
    }

    fn dab(work: &mut Work, page: u64, label: u8, x: f64) -> u64 {
        say(
            work,
            page,
            &format!(
                r#"{{"id":1,"op":"brush","target":{{"label":{label}}},"axis":2,"slice":3,"points":[[{x},9.0]],"radius_mm":2,"flat":true,"erase":false}}"#
            ),
        )
    }

    #[test]
    fn strokes_of_a_page_that_died_and_of_a_second_page_were_one_step() {
        let dir = tempfile::tempdir().expect("temp");
        let mut work = work(dir.path());
        assert_eq!((dab(&mut work, 1, 5, 8.0), dab(&mut work, 1, 5, 10.0)), (1, 1));
        work.leave(2);
        assert_eq!(dab(&mut work, 1, 5, 12.0), 1, "another page that goes ends nothing");
        work.leave(1);
        assert_eq!(dab(&mut work, 3, 6, 30.0), 2);
        // Page 4 paints in the middle of a stroke of page 3, and cannot end it.
        assert_eq!(dab(&mut work, 4, 7, 20.0), 3);
        say(&mut work, 3, r#"{"id":2,"op":"end_stroke"}"#);
        assert_eq!(dab(&mut work, 4, 7, 22.0), 3);
        say(&mut work, 4, r#"{"id":3,"op":"end_stroke"}"#);
        assert_eq!((dab(&mut work, 4, 5, 34.0), say(&mut work, 4, r#"{"id":4,"op":"undo"}"#)), (4, 3));
    }
}
