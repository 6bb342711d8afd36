//! Pseudonyms: short hashes from which nothing can be guessed.

use monro_geometry::Volume;
use sha2::{Digest, Sha256};

fn hex(digest: &[u8], bytes: usize) -> String {
    digest.iter().take(bytes).map(|b| format!("{b:02x}")).collect()
}

/// Name of a case from its voxels and their placement. A hash of the patient's name or id could be undone by trying
/// names; the voxels cannot be tried.
pub(crate) fn pseudonym(volume: &Volume<i16>) -> String {
    let mut sha = Sha256::new();
    sha.update(b"monro pseudonym 1");
    let m = volume.grid().patient_from_voxel();
    for v in m.linear.rows.iter().flatten().chain(&m.offset) {
        sha.update(v.to_le_bytes());
    }
    let mut bytes = Vec::with_capacity(1 << 16);
    for chunk in volume.data().chunks(1 << 15) {
        bytes.clear();
        bytes.extend(chunk.iter().flat_map(|v| v.to_le_bytes()));
        sha.update(&bytes);
    }
    format!("scan-{}", hex(&sha.finalize(), 6))
}

/// Short hash of a patient's id, to compare and not to keep: ids can be tried. Empty where there is none.
pub(crate) fn patient_id(id: &str) -> String {
    if id.is_empty() { String::new() } else { hex(&Sha256::digest(format!("monro patient {id}").as_bytes()), 8) }
}

/// Short id of a series, from its UID.
pub(crate) fn series_id(uid: &str) -> String {
    hex(&Sha256::digest(uid.as_bytes()), 4)
}

/// A short name of some bytes.
pub(crate) fn of_bytes(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes), 16)
}

/// A UID under 2.25 (a UUID as a number, PS3.5 B.2) from a text.
pub(crate) fn uid(text: &str) -> String {
    let bits = Sha256::digest(text.as_bytes()).iter().take(16).fold(0u128, |n, &b| n << 8 | u128::from(b));
    // Version 8 (custom) and variant bits of RFC 9562.
    let bits = bits & !(0xF << 76) & !(3 << 62) | 8 << 76 | 2 << 62;
    format!("2.25.{bits}")
}
