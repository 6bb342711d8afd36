//! The payload of a frame of NatNet; the first two bytes are its version. (Its poses: `natnet_conversation`.)
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_wire::natnet::{Frame, Version};

fuzz_target!(|data: &[u8]| {
    let Some(([major, minor], payload)) = data.split_first_chunk() else { return };
    let version = Version::new(2 + major % 3, *minor);
    if let Ok(frame) = Frame::decode(payload, version) {
        let _ = (frame.encode(version), frame.source_time(Some(1000)), frame.system_latency(Some(1000)));
    }
});
