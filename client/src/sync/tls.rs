//! The cryptography behind `https`: chosen once for the whole program, which is why the program
//! does it and not the library.

/// Makes ring the provider of TLS for this process. Call it in `main` before the first
/// [`super::Api`]; calling it again does no harm.
pub fn install_provider() {
    // An error says that there is a provider already, and one is all that is needed.
    let _ = rustls::crypto::ring::default_provider().install_default();
}

/// Whether there is a provider; without one, making an HTTP client would panic.
pub(super) fn has_provider() -> bool {
    rustls::crypto::CryptoProvider::get_default().is_some()
}
