//! One OpenIGTLink message; what is understood is written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_wire::openigtlink::{HEADER_SIZE, Message, crc64, poses};

fuzz_target!(|data: &[u8]| {
    let mut bytes = data.to_vec();
    if bytes.len() >= HEADER_SIZE {
        // Size and checksum are put right, so that the decoders behind them are reached.
        let (size, sum) = ((bytes.len() - HEADER_SIZE) as u64, crc64(&bytes[HEADER_SIZE..]));
        bytes[42..50].copy_from_slice(&size.to_be_bytes());
        bytes[50..58].copy_from_slice(&sum.to_be_bytes());
    }
    if let Ok(message) = Message::from_bytes(&bytes) {
        let _ = poses(&message, 0.0);
        if let Ok(again) = message.encode() {
            Message::from_bytes(&again).expect("what we write we read");
        }
    }
});
