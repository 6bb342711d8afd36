//! Encryption for the local network: a certificate of the user's, or one made at start.

use crate::ServeError;
use crate::options::Certificate;
use rustls::ServerConfig;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer};
use sha2::{Digest, Sha256};
use std::fmt::Display;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;

/// What TLS needs, and what people may compare.
pub(crate) struct Tls {
    pub(crate) acceptor: TlsAcceptor,
    /// SHA-256 of the certificate, as browsers show it.
    pub(crate) fingerprint: String,
    /// The certificate itself, DER.
    pub(crate) certificate: Vec<u8>,
}

fn faulty(error: impl Display) -> ServeError {
    ServeError::Certificate(error.to_string())
}

impl Tls {
    /// From the user's certificate, or a new one for `names`.
    ///
    /// # Errors
    /// Files that cannot be read, or do not belong together.
    pub(crate) fn new(certificate: &Certificate, names: Vec<String>) -> Result<Self, ServeError> {
        let (chain, key) = match certificate {
            Certificate::SelfSigned => self_signed(names)?,
            Certificate::Files { cert, key } => {
                let named = |path: &std::path::Path, e: &dyn Display| faulty(format!("{}: {e}", path.display()));
                let chain = CertificateDer::pem_file_iter(cert).and_then(Iterator::collect::<Result<Vec<_>, _>>);
                let chain = chain.map_err(|e| named(cert, &e))?;
                (chain, PrivateKeyDer::from_pem_file(key).map_err(|e| named(key, &e))?)
            }
        };
        let first = chain.first().ok_or_else(|| faulty("the file holds no certificate"))?.to_vec();
        let digest = Sha256::digest(&first);
        let fingerprint = digest.iter().map(|b| format!("{b:02X}")).collect::<Vec<_>>().join(":");
        let mut config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(faulty)?
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .map_err(faulty)?;
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self { acceptor: TlsAcceptor::from(Arc::new(config)), fingerprint, certificate: first })
    }
}

fn self_signed(names: Vec<String>) -> Result<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>), ServeError> {
    let made = rcgen::generate_simple_self_signed(names).map_err(faulty)?;
    let key = PrivatePkcs8KeyDer::from(made.signing_key.serialize_der());
    Ok((vec![made.cert.der().clone()], key.into()))
}

/// Our address as others in the local network see it: that of the interface to the outside, or loopback without one. Nothing
/// is sent.
pub(crate) fn outward(listen: IpAddr) -> IpAddr {
    if !listen.is_unspecified() {
        return listen;
    }
    let probe = || {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
        // A documentation address (RFC 5737): only the route to it is looked up.
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
        socket.local_addr().ok().map(|a| a.ip())
    };
    probe().unwrap_or(Ipv4Addr::LOCALHOST.into())
}
