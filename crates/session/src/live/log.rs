//! The log of a session: everything that its snapshots follow from, in the order in which it took effect.
//!
//! Layout, little-endian: 8 bytes `MNRSES2\n`, then for each entry a `u32` length, the `u32` CRC-32 of its bytes, and these: a tag
//! and its fields. Logs that begin with `MNRSES1\n` have no sums.
//! A file cut off by a crash keeps all its whole entries. What a live session takes in goes through this codec first
//! ([`Entry::encode`], [`Entry::decode`]), so that a replay takes in the very same bits.

use super::{Calibration, Observation, PlainEvent, Registration, SessionEvent};
use crate::Loads;
use monro_geometry::{Display, Point, Rigid, Tool, Vector};
use monro_tissue::Csf;
use thiserror::Error;

/// How a log begins.
pub const MAGIC: [u8; 8] = *b"MNRSES2\n";
/// How one without sums does.
const WITHOUT_SUMS: [u8; 8] = *b"MNRSES1\n";
/// Longest entry, bytes: a frame with as many tools as a session remembers is far below.
const LONGEST: usize = 1 << 20;

/// One thing that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A case was opened; always the first.
    Opened(Opened),
    /// An event of the procedure (never that a case was opened).
    Event(SessionEvent),
    /// Glasses were calibrated: from their tracked body to the eye. `None`: that does not hold any more.
    Worn(Option<Rigid<Display, Tool>>),
    /// What is done to the patient's fluid, and gravity, changed.
    Loaded(Loads),
    /// One frame of the tracker.
    Seen(Vec<Observation>),
    /// The soft body went on: when, and by how much, s.
    Step {
        /// The time at which the needle was asked for.
        now_s: f64,
        /// The time step.
        dt_s: f64,
    },
    /// A snapshot was taken for a display.
    Taken {
        /// Counts them.
        id: u64,
        /// When, s.
        time_s: f64,
        /// The deformation that it carries.
        step: u64,
        /// Its sequence number.
        sequence: u32,
    },
    /// It was sent.
    Shown {
        /// Which.
        id: u64,
        /// Digest of its bytes.
        digest: u64,
    },
}

/// What was opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Opened {
    /// Program and version.
    pub generator: String,
    /// The folder of the case, seen from that of the log.
    pub case_dir: String,
    /// What tells the case from others: its files with their hashes.
    pub identity: String,
    /// Name of the soft body's settings.
    pub settings: String,
}

/// Why a log cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LogError {
    /// The file does not begin as a log does.
    #[error("this is no recording of a Monro session (it does not begin with MNRSES2 or MNRSES1)")]
    Magic,
    /// An entry cannot be read.
    #[error("entry {entry} of the recording cannot be read: {what}")]
    Entry {
        /// Its number, from 0.
        entry: usize,
        /// What is wrong.
        what: &'static str,
    },
}

impl Entry {
    /// Its bytes, without their length.
    pub fn encode(&self) -> Vec<u8> {
        let mut w = Writer::default();
        match self {
            Self::Opened(o) => {
                w.0.push(0);
                [&o.generator, &o.case_dir, &o.identity, &o.settings].into_iter().for_each(|t| w.text(t));
            }
            Self::Event(event) => w.event(event),
            Self::Worn(Some(display_from_glasses)) => {
                w.0.push(6);
                w.rigid(display_from_glasses);
            }
            Self::Worn(None) => w.0.push(7),
            Self::Loaded(loads) => {
                w.0.push(8);
                w.loads(loads);
            }
            Self::Seen(seen) => {
                w.0.push(2);
                w.u32(seen.len() as u32);
                seen.iter().for_each(|o| w.observation(o));
            }
            Self::Step { now_s, dt_s } => {
                w.0.push(3);
                w.floats(&[*now_s, *dt_s]);
            }
            Self::Taken { id, time_s, step, sequence } => {
                w.0.push(4);
                w.floats(&[*time_s]);
                w.0.extend([id.to_le_bytes(), step.to_le_bytes()].as_flattened());
                w.u32(*sequence);
            }
            Self::Shown { id, digest } => {
                w.0.push(5);
                w.0.extend([id.to_le_bytes(), digest.to_le_bytes()].as_flattened());
            }
        }
        w.0
    }

    /// Reads an entry from its bytes.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn decode(bytes: &[u8]) -> Result<Self, &'static str> {
        let mut r = Reader(bytes);
        let entry = match r.u8()? {
            0 => Self::Opened(Opened {
                generator: r.text()?,
                case_dir: r.text()?,
                identity: r.text()?,
                settings: r.text()?,
            }),
            1 => Self::Event(r.event()?),
            2 => {
                let count = r.u32()?;
                Self::Seen((0..count).map(|_| r.observation()).collect::<Result<_, _>>()?)
            }
            3 => {
                let [now_s, dt_s] = r.floats()?;
                Self::Step { now_s, dt_s }
            }
            4 => {
                let [time_s] = r.floats()?;
                Self::Taken { time_s, id: r.u64()?, step: r.u64()?, sequence: r.u32()? }
            }
            5 => Self::Shown { id: r.u64()?, digest: r.u64()? },
            6 => Self::Worn(Some(r.rigid()?)),
            7 => Self::Worn(None),
            8 => Self::Loaded(r.loads()?),
            _ => return Err("its kind is not known to this version"),
        };
        if r.0.is_empty() { Ok(entry) } else { Err("bytes are left over") }
    }
}

/// The bytes of an entry in a file, with their length and their sum before them.
pub fn framed(entry: &[u8]) -> Vec<u8> {
    [&(entry.len() as u32).to_le_bytes(), &crc32fast::hash(entry).to_le_bytes(), entry].concat()
}

/// The bytes of an entry, and those of the file after it.
type Piece<'a> = (&'a [u8], &'a [u8]);

/// The bytes of the entry that a piece of a file begins with, after their length, and what follows: `None` where they are cut off.
/// An error where they are not what was written.
fn unframed(after: &[u8], length: usize, has_sum: bool) -> Option<Result<Piece<'_>, &'static str>> {
    if length > LONGEST {
        return Some(Err("it is longer than any entry"));
    }
    let (sum, after) = match has_sum {
        true => after.split_first_chunk::<4>().map(|(sum, after)| (Some(u32::from_le_bytes(*sum)), after))?,
        false => (None, after),
    };
    let (bytes, next) = after.split_at_checked(length)?;
    Some(match sum.is_none_or(|sum| sum == crc32fast::hash(bytes)) {
        true => Ok((bytes, next)),
        false => Err("its sum is not that of its bytes: one of them is not as it was written"),
    })
}

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// Its entries, up to the first that cannot be read.
    pub entries: Vec<Entry>,
    /// Bytes that are left at its end: of an unfinished entry, or zeros, as a crash leaves them (one whose length is damaged looks
    /// the same); or from a damaged one on.
    pub left: usize,
    /// Why what is left cannot be read, where it is damaged.
    pub damage: Option<LogError>,
}

/// Reads a whole file, as far as it can be read.
///
/// # Errors
/// When it is no log, or its first entry is damaged.
pub fn read(file: &[u8]) -> Result<Log, LogError> {
    let with_sums = file.strip_prefix(&MAGIC);
    let has_sums = with_sums.is_some();
    let mut rest = with_sums.or_else(|| file.strip_prefix(&WITHOUT_SUMS)).ok_or(LogError::Magic)?;
    let (mut entries, mut damage) = (Vec::new(), None);
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let length = u32::from_le_bytes(*length) as usize;
        // Room that the system had made for entries that were never written.
        if rest.iter().all(|&byte| byte == 0) {
            break;
        }
        let Some(found) = unframed(after, length, has_sums) else { break };
        match found.and_then(|(bytes, next)| Ok((Entry::decode(bytes)?, next))) {
            Ok((entry, next)) => {
                entries.push(entry);
                rest = next;
            }
            Err(what) => {
                damage = Some(LogError::Entry { entry: entries.len(), what });
                break;
            }
        }
    }
    match damage {
        Some(error) if entries.is_empty() => Err(error),
        damage => Ok(Log { entries, left: rest.len(), damage }),
    }
}

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn u32(&mut self, v: u32) {
        self.0.extend(v.to_le_bytes());
    }

    fn floats(&mut self, values: &[f64]) {
        values.iter().for_each(|v| self.0.extend(v.to_le_bytes()));
    }

    fn text(&mut self, text: &str) {
        self.u32(text.len() as u32);
        self.0.extend(text.as_bytes());
    }

    fn rigid<To, From>(&mut self, pose: &Rigid<To, From>) {
        self.floats(&pose.quaternion_wxyz());
        self.floats(&pose.translation().to_array());
    }

    fn loads(&mut self, loads: &Loads) {
        let (kind, value) = match loads.csf {
            Csf::AtRest => (0, 0.0),
            Csf::Pressure { kpa } => (1, kpa),
            Csf::Drained { ml } => (2, ml),
        };
        self.0.push(kind);
        self.floats(&[value]);
        self.floats(&loads.gravity_mm_s2);
    }

    fn event(&mut self, event: &SessionEvent) {
        self.0.push(1);
        match event {
            SessionEvent::Calibrated(c) => {
                self.0.push(0);
                self.floats(&c.tip.to_array());
                self.floats(&c.axis.to_array());
            }
            SessionEvent::Registered(r) => {
                self.0.push(1);
                self.rigid(&r.patient_from_reference);
                // A prediction that is not known is no number.
                self.floats(&[r.predicted_tre_mm.unwrap_or(f64::NAN)]);
            }
            SessionEvent::Plain(event) => {
                let number = PlainEvent::ALL.iter().position(|e| e == event).unwrap_or(0);
                self.0.extend([2, number as u8]);
            }
            // The case itself is in the entry that opens the log.
            SessionEvent::CaseOpened(_) => self.0.push(3),
        }
    }

    fn observation(&mut self, o: &Observation) {
        self.text(&o.name);
        self.floats(&[o.time_s]);
        self.0.push(u8::from(o.tracker_from_tool.is_some()));
        if let Some(pose) = &o.tracker_from_tool {
            self.rigid(pose);
        }
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], &'static str> {
        let (head, rest) = self.0.split_first_chunk::<N>().ok_or("it ends too soon")?;
        self.0 = rest;
        Ok(*head)
    }

    fn u8(&mut self) -> Result<u8, &'static str> {
        self.array::<1>().map(|[b]| b)
    }

    fn u32(&mut self) -> Result<u32, &'static str> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, &'static str> {
        self.array().map(u64::from_le_bytes)
    }

    fn floats<const N: usize>(&mut self) -> Result<[f64; N], &'static str> {
        let mut out = [0.0; N];
        for v in &mut out {
            *v = f64::from_le_bytes(self.array()?);
        }
        Ok(out)
    }

    fn text(&mut self) -> Result<String, &'static str> {
        let length = self.u32()? as usize;
        let (text, rest) = self.0.split_at_checked(length).ok_or("a text ends too soon")?;
        self.0 = rest;
        String::from_utf8(text.to_vec()).map_err(|_| "a text is not UTF-8")
    }

    fn rigid<To, From>(&mut self) -> Result<Rigid<To, From>, &'static str> {
        let (quaternion, translation) = (self.floats()?, Vector::from_array(self.floats()?));
        Rigid::from_quaternion(quaternion, translation).ok_or("a pose is no rigid motion")
    }

    fn loads(&mut self) -> Result<Loads, &'static str> {
        let (kind, [value]) = (self.u8()?, self.floats()?);
        let csf = match kind {
            0 => Csf::AtRest,
            1 => Csf::Pressure { kpa: value },
            2 => Csf::Drained { ml: value },
            _ => return Err("what is done to the fluid is not known"),
        };
        Ok(Loads { csf, gravity_mm_s2: self.floats()? })
    }

    fn event(&mut self) -> Result<SessionEvent, &'static str> {
        Ok(match self.u8()? {
            0 => SessionEvent::Calibrated(Calibration {
                tip: Point::from_array(self.floats()?),
                axis: Vector::from_array(self.floats()?),
            }),
            1 => {
                let patient_from_reference = self.rigid()?;
                let [tre] = self.floats()?;
                let predicted_tre_mm = (!tre.is_nan()).then_some(tre);
                SessionEvent::Registered(Registration { patient_from_reference, predicted_tre_mm })
            }
            2 => {
                let number = usize::from(self.u8()?);
                SessionEvent::Plain(*PlainEvent::ALL.get(number).ok_or("an event's kind is not known")?)
            }
            _ => return Err("an event's kind is not known"),
        })
    }

    fn observation(&mut self) -> Result<Observation, &'static str> {
        let name = self.text()?;
        let [time_s] = self.floats()?;
        let tracker_from_tool = if self.u8()? == 1 { Some(self.rigid()?) } else { None };
        Ok(Observation { name, time_s, tracker_from_tool })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::Script;
    use crate::live::session::tests::plan;
    use proptest::prelude::*;

    fn entries() -> Vec<Entry> {
        let script = Script::new(plan());
        let truth = script.truth();
        let text = str::to_owned;
        let opened = Opened {
            generator: text("monro 1"),
            case_dir: text("/a b/ü"),
            identity: text("00ff"),
            settings: text("paper"),
        };
        let mut all = vec![
            Entry::Opened(opened),
            Entry::Event(SessionEvent::Calibrated(truth.calibration)),
            Entry::Event(SessionEvent::Registered(truth.registration)),
            Entry::Worn(Some(truth.display_from_glasses)),
            Entry::Worn(None),
            Entry::Loaded(Loads { csf: Csf::Drained { ml: 0.1 + 0.2 }, gravity_mm_s2: [0.0, 9810.0, -1.0 / 3.0] }),
            Entry::Loaded(Loads { csf: Csf::Pressure { kpa: -0.1 }, ..Loads::default() }),
            Entry::Loaded(Loads::default()),
            Entry::Seen(script.observations(1.25).to_vec()),
            Entry::Seen(vec![Observation { name: text("Lost"), time_s: 0.1, tracker_from_tool: None }]),
            Entry::Step { now_s: 0.1 + 0.2, dt_s: 1.0 / 3.0 },
            Entry::Taken { id: 1, time_s: 1e-300, step: u64::MAX, sequence: 7 },
            Entry::Shown { id: 1, digest: 0x0123_4567_89ab_cdef },
        ];
        all.extend(PlainEvent::ALL.map(|e| Entry::Event(SessionEvent::Plain(e))));
        all
    }

    fn file() -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        entries().iter().for_each(|e| out.extend(framed(&e.encode())));
        out
    }

    #[test]
    fn what_was_taken_in_live_is_what_is_read_bit_for_bit() {
        for entry in entries() {
            // The live session takes in the decoded entry; a replay reads the bytes of the same.
            let bytes = entry.encode();
            assert_eq!(Entry::decode(&bytes), Entry::decode(&bytes.clone()));
            let (read, wanted) = (Entry::decode(&bytes).expect("read"), &entry);
            if !matches!(entry, Entry::Seen(_) | Entry::Worn(_) | Entry::Event(SessionEvent::Registered(_))) {
                assert_eq!(read, *wanted);
            }
        }
        let log = read(&file()).expect("whole");
        assert_eq!((log.entries.len(), log.left, log.damage), (entries().len(), 0, None));
    }

    #[test]
    fn another_file_is_refused_and_a_damaged_entry_named() {
        assert_eq!(read(b"MNRREC1\nxx"), Err(LogError::Magic));
        let mut bad = [MAGIC.to_vec(), framed(&[99])].concat();
        assert_eq!(read(&bad), Err(LogError::Entry { entry: 0, what: "its kind is not known to this version" }));
        bad[MAGIC.len() + 8] = 98;
        let Err(LogError::Entry { entry: 0, what }) = read(&bad) else { panic!("{:?}", read(&bad)) };
        assert!(what.contains("its sum"), "{what}");
    }

    /// One byte of 21 in 24 places passed as sound: "identical 60 of 60".
    #[test]
    fn a_byte_that_is_not_as_it_was_written_is_noticed_wherever_it_is() {
        let file = file();
        for at in MAGIC.len()..file.len() {
            let mut bad = file.clone();
            bad[at] ^= 0x55;
            let noticed = read(&bad).map_or(true, |log| log.damage.is_some() || log.left > 0);
            assert!(noticed, "byte {at} of {}", file.len());
        }
    }

    #[test]
    fn logs_of_before_there_were_sums_are_read() {
        let entries = || entries().into_iter().map(|e| e.encode());
        let old = entries().flat_map(|e| [&(e.len() as u32).to_le_bytes(), &e[..]].concat());
        let log = read(&WITHOUT_SUMS.into_iter().chain(old).collect::<Vec<_>>()).expect("read");
        assert_eq!((log.entries.len(), log.left, log.damage), (entries().count(), 0, None));
    }

    #[test]
    fn zeros_at_the_end_or_one_damaged_entry_took_all_entries_along() {
        let (whole, count) = (file(), entries().len());
        let zeros = read(&[whole.clone(), vec![0; 4096]].concat()).expect("entries");
        assert_eq!((zeros.entries.len(), zeros.left, zeros.damage), (count, 4096, None));
        let mut bad = whole.clone();
        let last = framed(&entries()[count - 1].encode()).len();
        bad[whole.len() - last + 8] = 99;
        let log = read(&bad).expect("entries");
        assert_eq!((log.entries.len(), log.left), (count - 1, last));
        assert!(matches!(log.damage, Some(LogError::Entry { entry, .. }) if entry == count - 1));
    }

    proptest! {
        #[test]
        fn a_log_cut_anywhere_keeps_its_whole_entries(cut in 8usize..2000) {
            let file = file();
            let cut = cut.min(file.len());
            let log = read(&file[..cut]).expect("begins well");
            let whole: usize = log.entries.iter().zip(entries()).map(|(_, e)| framed(&e.encode()).len()).sum();
            prop_assert_eq!((MAGIC.len() + whole + log.left, log.damage), (cut, None));
        }

        #[test]
        fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Entry::decode(&bytes);
            let _ = read(&[MAGIC.to_vec(), bytes].concat());
        }
    }
}
