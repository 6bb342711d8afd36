//! A snapshot as bytes, little-endian:
//!
//! | at | type | what |
//! |---|---|---|
//! | 0 | u8 | version, 1 |
//! | 1 | u8 | phase, 0 (no case) to 5 (navigating) |
//! | 2 | u8 | signal: 0 live, 1 stale, 2 lost |
//! | 3 | u8 | 1: the catheter is there; 2: the solver had a fault of late; 4: the displacements are the vertices' |
//! | 4 | u32 | sequence number: counts what is new on the server, so that a gap says what a client has left out |
//! | 8 | f64 | capture time, s on the server's clock |
//! | 16 | 3 f32 | tip of the catheter, LPS mm |
//! | 28 | 3 f32 | its direction from hub to tip |
//! | 40 | u32 | step of the soft body |
//! | 44 | f32 | quantum of the displacements, mm |
//! | 48 | u32 | number of nodes, or of vertices, n |
//! | 52 | u32 | length of the JSON, j |
//! | 56 | 3n i16 | displacement of each node from rest, in quanta |
//! | 56 + 6n | j bytes | the same JSON as `/api/guidance` |
//!
//! A display that asks with the word `vertices` gets instead of the nodes' displacements those of the vertices of the soft
//! surfaces, in the order of `/api/scene`: it need not move them itself.

use crate::guidance::Guidance;
use monro_session::live::Snapshot;

/// Version of the layout.
pub(crate) const VERSION: u8 = 1;
/// Bytes before the displacements.
const HEADER: usize = 56;

/// What moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Moved {
    /// The nodes of the mesh: the display moves its surfaces by them.
    Nodes,
    /// The vertices of the soft surfaces.
    Vertices,
}

/// The displacements of a deformation as every display gets them.
#[derive(Debug)]
pub(crate) struct Quantised {
    of: Moved,
    count: u32,
    quantum: f32,
    bytes: Vec<u8>,
}

impl Quantised {
    /// The largest component fills 16 bits: the error is at most half a quantum.
    pub(crate) fn new(of: Moved, displacements: &[[f32; 3]]) -> Self {
        let flat = displacements.as_flattened();
        let largest = flat.iter().fold(0f32, |m, d| m.max(d.abs()));
        let quantum = (largest / f32::from(i16::MAX)).max(1e-6);
        // A displacement that is not finite counts as none; the solver does not make such.
        let bytes = flat.iter().flat_map(|d| ((d / quantum).round() as i16).to_le_bytes()).collect();
        Self { of, count: displacements.len() as u32, quantum, bytes }
    }
}

/// The bytes of a snapshot, with its deformation's displacements.
pub(crate) fn encode(snapshot: &Snapshot, moved: &Quantised, guidance: &Guidance, sequence: u32) -> Vec<u8> {
    let json = serde_json::to_vec(guidance).unwrap_or_default();
    let deformed = &snapshot.deformed;
    let mut out = Vec::with_capacity(HEADER + moved.bytes.len() + json.len());
    let whole = u8::from(moved.of == Moved::Vertices);
    let flags = u8::from(snapshot.needle.is_some()) | u8::from(deformed.fault) << 1 | whole << 2;
    out.extend([VERSION, snapshot.phase as u8, snapshot.signal as u8, flags]);
    out.extend(sequence.to_le_bytes());
    out.extend(snapshot.time_s.to_le_bytes());
    let needle = snapshot.needle.map_or([[0.0; 3]; 2], |n| [n.tip().to_array(), n.axis().to_array()]);
    needle.as_flattened().iter().for_each(|v| out.extend((*v as f32).to_le_bytes()));
    out.extend((deformed.step as u32).to_le_bytes());
    out.extend(moved.quantum.to_le_bytes());
    out.extend(moved.count.to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(&moved.bytes);
    out.extend(json);
    out
}

/// A digest of a snapshot's bytes, by which a replay knows it again: FNV-1a over words of eight bytes.
pub(crate) fn digest(bytes: &[u8]) -> u64 {
    let mix = |h: u64, w: u64| (h ^ w).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29);
    let (words, rest) = bytes.as_chunks::<8>();
    let h = words.iter().fold(0xcbf2_9ce4_8422_2325, |h, w| mix(h, u64::from_le_bytes(*w)));
    rest.iter().fold(h ^ bytes.len() as u64, |h, b| mix(h, u64::from(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;
    use monro_session::live::{Deformed, Expiry, Session, ToolNames};
    use std::sync::Arc;

    #[test]
    fn a_digest_tells_any_changed_byte() {
        let bytes: Vec<u8> = (0..100).collect();
        for i in 0..100 {
            let mut other = bytes.clone();
            other[i] ^= 1;
            assert_ne!(digest(&other), digest(&bytes), "{i}");
        }
        assert_ne!(digest(&bytes[..99]), digest(&bytes));
    }

    #[test]
    fn displacements_come_back_within_half_a_quantum() {
        let target = Point::new(1.0, 2.0, 3.0);
        let displacements = vec![[0.0, 7.25, -7.5], [1e-3, -0.02, 3.3], [5.0, 0.0, 0.1]];
        let deformed = Arc::new(Deformed { displacements: displacements.clone(), ..Deformed::at_rest(target, 3) });
        let session = Session::new(ToolNames::default(), Expiry::default());
        let snapshot = session.snapshot(1.5, &deformed);
        let bytes =
            encode(&snapshot, &Quantised::new(Moved::Nodes, &displacements), &Guidance::new(&snapshot, target), 7);
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        assert_eq!((bytes[0], bytes[1], bytes[2], bytes[3]), (VERSION, 0, 2, 0));
        assert_eq!((u32::from_le_bytes(word(4)), u32::from_le_bytes(word(48))), (7, 3));
        let quantum = f32::from_le_bytes(word(44));
        assert!((quantum - 7.5 / 32767.0).abs() < 1e-9);
        for (i, d) in displacements.as_flattened().iter().enumerate() {
            let q = i16::from_le_bytes([bytes[56 + 2 * i], bytes[57 + 2 * i]]);
            assert!((f32::from(q) * quantum - d).abs() <= quantum * 0.5001, "{i}");
        }
        let json: serde_json::Value = serde_json::from_slice(&bytes[56 + 18..]).expect("json");
        assert_eq!(u32::from_le_bytes(word(52)) as usize, bytes.len() - 56 - 18);
        assert_eq!(json["state"], "lost");
        assert!(json["distance_to_target_mm"].is_null());
    }
}
