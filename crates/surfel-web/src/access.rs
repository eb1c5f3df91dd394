//! Access control: a token beyond loopback, and checks that keep foreign web pages out.

use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, Uri};
use std::net::IpAddr;
use subtle::ConstantTimeEq;

/// Decides which requests a server answers.
#[derive(Clone, Debug)]
pub struct AccessGuard {
    /// The token that requests need; none on loopback.
    token: Option<String>,
}

/// The reason why a request is not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessDenied {
    /// The `Host` header does not name the loopback interface. A foreign name may resolve to it.
    Host,
    /// The `Origin` header names another origin than the server's.
    Origin,
    /// The token is missing or wrong.
    Token,
}

impl AccessDenied {
    /// The reason as a message for the client.
    pub fn message(self) -> &'static str {
        match self {
            Self::Host => "Host: expected localhost or a loopback address",
            Self::Origin => "Origin: requests from pages of another origin are not allowed",
            Self::Token => "token: missing or wrong; use the whole link that `surfel view` printed",
        }
    }
}

/// Number of random bytes in a token.
const TOKEN_BYTES: usize = 16;

impl AccessGuard {
    /// A guard for a server that listens at `host`. Beyond loopback it makes a new token.
    ///
    /// # Errors
    /// Fails if the system has no random numbers.
    pub fn new(host: IpAddr) -> Result<Self, getrandom::Error> {
        if host.is_loopback() {
            return Ok(Self { token: None });
        }
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self { token: Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect()) })
    }

    /// The token that requests need; none on loopback.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Checks the `Host` and `Origin` headers of a request.
    ///
    /// # Errors
    /// Fails on loopback if `Host` is no loopback name, and if `Origin` is not the server's own.
    pub fn check_origin(&self, headers: &HeaderMap) -> Result<(), AccessDenied> {
        let host = headers.get(HOST).and_then(|host| host.to_str().ok());
        let host = host.ok_or(AccessDenied::Host)?;
        // The port is not compared: a tunnel may change it. Beyond loopback a machine has many names, and the
        // token protects the server.
        if self.token.is_none() && !is_loopback(host) {
            return Err(AccessDenied::Host);
        }
        let Some(origin) = headers.get(ORIGIN) else { return Ok(()) };
        let origin = origin.to_str().ok().and_then(|origin| origin.split_once("://"));
        match origin {
            Some((_, origin_host)) if origin_host.eq_ignore_ascii_case(host) => Ok(()),
            _ => Err(AccessDenied::Origin),
        }
    }

    /// Checks the token of a request, which it carries as `?token=` or as a bearer token.
    ///
    /// # Errors
    /// Fails if a token is needed, and the request's is missing or wrong.
    pub fn check_token(&self, headers: &HeaderMap, uri: &Uri) -> Result<(), AccessDenied> {
        let Some(expected) = &self.token else { return Ok(()) };
        let bearer = headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
        let bearer = bearer.and_then(|value| value.strip_prefix("Bearer "));
        let query = uri.query().unwrap_or_default().split('&');
        let found = bearer.or_else(|| query.filter_map(|pair| pair.strip_prefix("token=")).next());
        let is_same = found.is_some_and(|found| found.as_bytes().ct_eq(expected.as_bytes()).into());
        if is_same { Ok(()) } else { Err(AccessDenied::Token) }
    }
}

/// Returns whether a host, with or without a port, is a name of the loopback interface.
fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    //! Requests that are allowed and denied by their host, origin and token.

    use super::*;

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    #[test]
    fn on_loopback_only_loopback_names_are_allowed() {
        let guard = AccessGuard::new("127.0.0.1".parse().unwrap()).unwrap();
        for host in
            ["localhost", "localhost:9", "127.0.0.1:80", "127.9.9.9", "[::1]:7", "LOCALHOST"]
        {
            assert_eq!(guard.check_origin(&headers(&[("host", host)])), Ok(()), "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example:80", "192.168.1.1", "127.0.0.1.nip.io", ""]
        {
            assert_eq!(
                guard.check_origin(&headers(&[("host", host)])),
                Err(AccessDenied::Host),
                "{host}"
            );
        }
        assert_eq!(guard.check_origin(&HeaderMap::new()), Err(AccessDenied::Host));
        assert_eq!(guard.check_token(&HeaderMap::new(), &Uri::from_static("/ws")), Ok(()));
    }

    #[test]
    fn other_origins_are_denied() {
        let guard = AccessGuard::new("127.0.0.1".parse().unwrap()).unwrap();
        let check =
            |origin| guard.check_origin(&headers(&[("host", "localhost:80"), ("origin", origin)]));
        assert_eq!(check("http://localhost:80"), Ok(()));
        for origin in ["http://localhost:81", "https://evil.example", "null", "", "localhost:80"] {
            assert_eq!(check(origin), Err(AccessDenied::Origin), "{origin}");
        }
    }

    #[test]
    fn beyond_loopback_a_token_is_required() {
        let guard = AccessGuard::new("0.0.0.0".parse().unwrap()).unwrap();
        let token = guard.token().unwrap().to_owned();
        assert_eq!(token.len(), 32);
        assert_ne!(AccessGuard::new("0.0.0.0".parse().unwrap()).unwrap().token().unwrap(), token);
        let none = HeaderMap::new();
        let uri = |text: String| text.parse::<Uri>().unwrap();
        assert_eq!(guard.check_token(&none, &uri(format!("/ws?a=1&token={token}"))), Ok(()));
        let bearer = headers(&[("authorization", &format!("Bearer {token}"))]);
        assert_eq!(guard.check_token(&bearer, &uri("/render".into())), Ok(()));
        for invalid in ["/ws".into(), "/ws?token=".into(), format!("/ws?token={}", &token[1..])] {
            assert_eq!(guard.check_token(&none, &uri(invalid)), Err(AccessDenied::Token));
        }
    }
}
