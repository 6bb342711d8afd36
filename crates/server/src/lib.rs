//! A live session for browsers: one case, one tracker, any number of displays.
//!
//! [`serve`] opens a case, starts the tracker and the soft body on threads of their own, and answers on one port: the web
//! app, a JSON API (`/api/openapi.json` describes it), and a binary WebSocket of snapshots. The rules of the session live
//! in `monro_session::live`; this crate adds clocks, threads, sockets and the guard at the door.
//!
//! - **Nobody waits for anybody.** The newest pose and the newest deformation are shared as immutable values. A display
//!   asks for one snapshot at a time and gets the newest then; one that does not ask gets nothing and delays nobody.
//! - **Encrypted beyond this machine**: what others can reach speaks TLS only. The API wants a bearer token that is made anew
//!   at every start (a viewer's or an operator's; other devices get theirs for a one-time code), the WebSocket a one-time
//!   ticket; `Host` and `Origin` are checked against DNS rebinding and foreign pages; sizes, rates and connections are bounded.
//! - **The web app is in the binary** when `web/dist` was there at build time (`scripts/web.sh build`); without it a small
//!   page says how to build it.

mod api;
mod body;
mod bound;
mod calibrate;
mod case_data;
mod clock;
mod connection;
mod container;
mod deformer;
mod door;
pub mod edit;
mod error;
mod guidance;
mod half;
mod headers;
mod limit;
mod listener;
mod live;
mod lock;
mod options;
mod pairing;
mod places;
mod preparing;
mod rate;
mod record;
mod register;
mod replay;
mod server;
mod slicer;
mod snapshot;
mod socket;
mod tissue;
mod tls;
mod tracker;
mod web;

pub use error::ServeError;
pub use options::{Certificate, Recording, ServeOptions};
pub use preparing::{Beside, serve_scans};
pub use replay::{Replayed, replay};
pub use server::{Invitation, Ready, Running, serve, start};
pub use tracker::Tracker;
