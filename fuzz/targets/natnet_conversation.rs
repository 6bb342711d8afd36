//! Whole datagrams of NatNet to a client and to a server; the first two bytes are the version.
#![no_main]

use libfuzzer_sys::fuzz_target;
use monro_wire::natnet::{Client, ClientOptions, Server, ServerInfo, ServerOptions, UpAxis, Version, definitions};

fuzz_target!(|data: &[u8]| {
    let Some(([major, minor], datagram)) = data.split_first_chunk() else { return };
    let version = Version::new(2 + major % 3, *minor);
    let mut server = Server::new(ServerOptions {
        version,
        bodies: vec!["Stylus".to_owned(), "Reference".to_owned()],
        frequency: 1_000_000,
        data_port: 1511,
        multicast: false,
        up: UpAxis::Y,
        rate: 120.0,
    });
    let payload = datagram.get(4..).unwrap_or_default();
    let _ = (definitions(payload, version), ServerInfo::decode(payload), server.receive(datagram, 1.0));
    let mut client = Client::new(ClientOptions { force_version: Some(version), ..ClientOptions::default() });
    let _ = client.receive(&server.info().encode(), 0.0);
    let _ = client.receive(datagram, 1.0);
    let _ = (client.poll(1.1), client.diagnosis(1.2, &["Stylus"]));
});
