//! The log of a session; what is understood is written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_session::live::log::{Entry, read};

fuzz_target!(|data: &[u8]| {
    for entry in read(data).map(|(entries, _)| entries).unwrap_or_default() {
        Entry::decode(&entry.encode()).expect("what we write we read");
    }
});
