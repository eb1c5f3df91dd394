//! Encryption of connections, by a certificate and its key.

use std::sync::Arc;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

/// A certificate and its private key, by which a server encrypts its connections.
#[derive(Clone)]
pub struct TlsIdentity {
    config: Arc<ServerConfig>,
}

/// The reason why a certificate and a key cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// The certificate is not given in the PEM format.
    #[error("expected a certificate in the PEM format: {0}")]
    Certificate(pem::Error),
    /// The private key is not given in the PEM format.
    #[error("expected a private key in the PEM format: {0}")]
    Key(pem::Error),
    /// The key does not belong to the certificate, or their kind is not supported.
    #[error("cannot be used with this certificate: {0}")]
    Unusable(#[from] tokio_rustls::rustls::Error),
}

impl TlsIdentity {
    /// Reads a chain of certificates, the server's own one first, and the private key of that one.
    ///
    /// # Errors
    ///
    /// Fails if one of them is not in the PEM format, or if they do not belong together.
    pub fn from_pem(certificates: &[u8], key: &[u8]) -> Result<Self, TlsError> {
        let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_slice_iter(certificates)
            .collect::<Result<_, _>>()
            .map_err(TlsError::Certificate)?;
        if chain.is_empty() {
            return Err(TlsError::Certificate(pem::Error::NoItemsFound));
        }
        let key = PrivateKeyDer::from_pem_slice(key).map_err(TlsError::Key)?;
        let builder = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()));
        let builder = builder.with_safe_default_protocol_versions()?;
        let config = builder.with_no_client_auth().with_single_cert(chain, key)?;
        Ok(Self { config: Arc::new(config) })
    }

    /// Accepts encrypted connections.
    pub fn acceptor(&self) -> TlsAcceptor {
        self.config.clone().into()
    }
}

#[cfg(test)]
mod tests {
    //! Certificates and keys that cannot be used.

    use super::*;

    fn identity() -> (Vec<u8>, Vec<u8>) {
        let generated = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        (generated.cert.pem().into(), generated.signing_key.serialize_pem().into())
    }

    #[test]
    fn a_certificate_and_its_key_are_accepted() {
        let (certificate, key) = identity();
        assert!(TlsIdentity::from_pem(&certificate, &key).is_ok());
    }

    #[test]
    fn wrong_files_are_rejected() {
        let (certificate, key) = identity();
        let (_, other_key) = identity();
        let error = |certificate: &[u8], key: &[u8]| TlsIdentity::from_pem(certificate, key).err();
        assert!(matches!(error(b"", &key), Some(TlsError::Certificate(_))));
        assert!(matches!(error(&key, &key), Some(TlsError::Certificate(_))));
        assert!(matches!(error(&certificate, b"\xff\0"), Some(TlsError::Key(_))));
        assert!(matches!(error(&certificate, &certificate), Some(TlsError::Key(_))));
        assert!(matches!(error(&certificate, &other_key), Some(TlsError::Unusable(_))));
    }
}
