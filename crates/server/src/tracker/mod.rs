//! Where poses come from. Each source runs by itself and only ever hands observations to the session.

mod igtl;
mod sim;

use crate::live::Live;
use crate::options::TrackerUrl;
use monro_guidance::Plan;
use std::io;
use std::sync::Arc;

/// Starts the source of poses.
pub(crate) fn start(url: &TrackerUrl, live: &Arc<Live>, plan: Plan) -> io::Result<()> {
    match url {
        TrackerUrl::Sim => sim::spawn(Arc::clone(live), plan),
        TrackerUrl::OpenIgtLink(host) => {
            tokio::spawn(igtl::run(Arc::clone(live), host.clone()));
            Ok(())
        }
    }
}
