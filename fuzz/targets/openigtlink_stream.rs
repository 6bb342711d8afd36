//! A stream of OpenIGTLink in pieces; the first byte tells their size.
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_wire::openigtlink::Parser;

fuzz_target!(|data: &[u8]| {
    let Some((&size, stream)) = data.split_first() else { return };
    let mut parser = Parser::new(1 << 16);
    for piece in stream.chunks(usize::from(size) + 1) {
        parser.push(piece);
        while let Some(message) = parser.next_message() {
            if message.is_err() && parser.is_broken() {
                return;
            }
        }
        assert!(parser.pending() <= stream.len());
    }
});
