//! Origins whose pages may show the viewer in a frame, as a notebook does.

use crate::scene_provider::{Error, Result};
use std::sync::{Arc, PoisonError, RwLock};

/// The origins whose pages may show the page in a frame; none at first. Copies share them.
#[derive(Clone, Debug, Default)]
pub struct FrameAncestors(Arc<RwLock<Vec<String>>>);

impl FrameAncestors {
    /// Allows an origin, as in `http://localhost:8888`, from now on.
    ///
    /// # Errors
    ///
    /// Fails for anything but a scheme, a host and a port.
    pub fn allow(&self, origin: &str) -> Result<()> {
        if !is_origin(origin) {
            let message =
                format!("origin: found {origin:?}, expected one as http://localhost:8888");
            return Err(Error::invalid_request(message));
        }
        let mut origins = self.0.write().unwrap_or_else(PoisonError::into_inner);
        if !origins.iter().any(|known| known == origin) {
            origins.push(origin.to_owned());
        }
        Ok(())
    }

    /// Returns true if no page may show the viewer in a frame.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.read().unwrap_or_else(PoisonError::into_inner).is_empty()
    }

    /// Returns the origins as a content security policy lists them.
    pub(crate) fn source_list(&self) -> String {
        let origins = self.0.read().unwrap_or_else(PoisonError::into_inner);
        if origins.is_empty() { "'none'".to_owned() } else { origins.join(" ") }
    }
}

/// Returns true for `http://HOST:PORT` and `https://HOST:PORT`, with or without the port. Nothing else may get into the
/// policy, where a space or a semicolon would begin another rule, and a star would allow many hosts.
fn is_origin(text: &str) -> bool {
    let host = ["http://", "https://"].iter().find_map(|scheme| text.strip_prefix(scheme));
    let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || b".-:[]".contains(&byte);
    host.is_some_and(|host| !host.is_empty() && host.bytes().all(is_allowed))
}

#[cfg(test)]
mod tests {
    //! Origins are listed; anything else is refused.

    use super::*;

    #[test]
    fn origins_alone_are_listed() {
        let ancestors = FrameAncestors::default();
        assert_eq!((ancestors.is_empty(), &*ancestors.source_list()), (true, "'none'"));
        for wrong in [
            "",
            "*",
            "null",
            "http://",
            "localhost:8888",
            "http://*",
            "http://a b",
            "http://a;b",
            "http://a/",
            "http://a/b",
            "http://a?b",
            "http://u@a",
            "ws://a",
            "http://a'b",
            "'self'",
            "http://a\r\nX: y",
            "data:",
        ] {
            assert!(ancestors.allow(wrong).is_err(), "{wrong}");
        }
        assert!(ancestors.is_empty());
        for origin in ["http://localhost:8888", "https://hub.example", "http://[::1]:80"] {
            ancestors.allow(origin).unwrap();
            ancestors.clone().allow(origin).unwrap();
        }
        let expected = "http://localhost:8888 https://hub.example http://[::1]:80";
        assert_eq!(ancestors.source_list(), expected);
    }
}
