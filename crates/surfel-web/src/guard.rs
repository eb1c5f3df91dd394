//! Who may ask: a token beyond loopback, and the checks that keep foreign pages out.

use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, Uri};
use std::net::IpAddr;
use subtle::ConstantTimeEq;

/// Guards a server.
#[derive(Clone, Debug)]
pub struct Guard {
    /// Needed beyond loopback.
    token: Option<String>,
}

/// Why a request is not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The name in `Host` is not one of this machine's own: a foreign name that resolves to it.
    Host,
    /// A page of another origin asks.
    Origin,
    Token,
}

impl Refusal {
    pub fn text(self) -> &'static str {
        match self {
            Self::Host => "Host: expected localhost or a loopback address",
            Self::Origin => "Origin: a page of another origin may not ask",
            Self::Token => "token: missing or wrong; use the whole link that `surfel view` printed",
        }
    }
}

/// Bytes of a token.
const TOKEN_BYTES: usize = 16;

impl Guard {
    /// For a server that listens at `host`.
    pub fn new(host: IpAddr) -> Result<Self, getrandom::Error> {
        if host.is_loopback() {
            return Ok(Self { token: None });
        }
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self { token: Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect()) })
    }

    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Whether a request may be answered at all.
    pub fn check(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = headers.get(HOST).and_then(|host| host.to_str().ok()).ok_or(Refusal::Host)?;
        // Behind a tunnel the port is another. Beyond loopback names are many, and the token guards.
        if self.token.is_none() && !is_loopback(host) {
            return Err(Refusal::Host);
        }
        let Some(origin) = headers.get(ORIGIN) else { return Ok(()) };
        let of_origin = origin.to_str().ok().and_then(|origin| origin.split_once("://"));
        match of_origin {
            Some((_, of_origin)) if of_origin.eq_ignore_ascii_case(host) => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }

    /// The same for what shows or makes something: it needs the token, as `?token=` or as bearer.
    pub fn check_token(&self, headers: &HeaderMap, uri: &Uri) -> Result<(), Refusal> {
        let Some(expected) = &self.token else { return Ok(()) };
        let bearer = headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
        let bearer = bearer.and_then(|value| value.strip_prefix("Bearer "));
        let query = uri.query().unwrap_or_default().split('&');
        let found = bearer.or_else(|| query.filter_map(|pair| pair.strip_prefix("token=")).next());
        let is_same = found.is_some_and(|found| found.as_bytes().ct_eq(expected.as_bytes()).into());
        if is_same { Ok(()) } else { Err(Refusal::Token) }
    }
}

/// Whether a host, with or without a port, names this machine to itself.
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
    use super::*;

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    #[test]
    fn loopback_answers_only_to_its_own_names() {
        let guard = Guard::new("127.0.0.1".parse().unwrap()).unwrap();
        for host in
            ["localhost", "localhost:9", "127.0.0.1:80", "127.9.9.9", "[::1]:7", "LOCALHOST"]
        {
            assert_eq!(guard.check(&headers(&[("host", host)])), Ok(()), "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example:80", "192.168.1.1", "127.0.0.1.nip.io", ""]
        {
            assert_eq!(guard.check(&headers(&[("host", host)])), Err(Refusal::Host), "{host}");
        }
        assert_eq!(guard.check(&HeaderMap::new()), Err(Refusal::Host));
        assert_eq!(guard.check_token(&HeaderMap::new(), &Uri::from_static("/ws")), Ok(()));
    }

    #[test]
    fn pages_of_other_origins_may_not_ask() {
        let guard = Guard::new("127.0.0.1".parse().unwrap()).unwrap();
        let check = |origin| guard.check(&headers(&[("host", "localhost:80"), ("origin", origin)]));
        assert_eq!(check("http://localhost:80"), Ok(()));
        for origin in ["http://localhost:81", "https://evil.example", "null", "", "localhost:80"] {
            assert_eq!(check(origin), Err(Refusal::Origin), "{origin}");
        }
    }

    #[test]
    fn beyond_loopback_a_token_is_needed() {
        let guard = Guard::new("0.0.0.0".parse().unwrap()).unwrap();
        let token = guard.token().unwrap().to_owned();
        assert_eq!(token.len(), 32);
        assert_ne!(Guard::new("0.0.0.0".parse().unwrap()).unwrap().token().unwrap(), token);
        let none = HeaderMap::new();
        let uri = |text: String| text.parse::<Uri>().unwrap();
        assert_eq!(guard.check_token(&none, &uri(format!("/ws?a=1&token={token}"))), Ok(()));
        let bearer = headers(&[("authorization", &format!("Bearer {token}"))]);
        assert_eq!(guard.check_token(&bearer, &uri("/render".into())), Ok(()));
        for wrong in ["/ws".into(), "/ws?token=".into(), format!("/ws?token={}", &token[1..])] {
            assert_eq!(guard.check_token(&none, &uri(wrong)), Err(Refusal::Token));
        }
    }
}
