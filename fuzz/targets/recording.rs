//! A recording of a tracker.
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_wire::recording::Recording;

fuzz_target!(|data: &[u8]| {
    if let Ok(recording) = Recording::read(data) {
        assert!(recording.records().iter().map(|r| r.bytes.len()).sum::<usize>() <= data.len());
    }
});
