//! Access control: a token beyond loopback, and checks that keep foreign web pages out.

use crate::frame_ancestors::FrameAncestors;
use crate::random_name::random_name;
use crate::scene_provider::Error;
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, HeaderName, ORIGIN, REFERER};
use axum::http::{HeaderMap, HeaderValue, Method, Request, Uri};
use std::net::IpAddr;
use subtle::ConstantTimeEq;

/// Decides which requests a server answers.
#[derive(Clone, Debug)]
pub struct AccessGuard {
    /// The scheme of the server's addresses.
    pub scheme: Scheme,
    /// The origins whose pages may show the page in a frame.
    pub frame_ancestors: FrameAncestors,
    /// The token that requests need; none on loopback.
    token: Option<String>,
}

/// The scheme of an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// The connection is not encrypted.
    Http,
    /// The connection is encrypted by TLS.
    Https,
}

impl Scheme {
    /// The scheme as an address begins with it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Http => "http",
            Self::Https => "https",
        }
    }
}

/// The reason why a request is not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessDenied {
    /// There is not exactly one `Host` header, or it does not name the loopback interface. A foreign name may
    /// resolve to it.
    Host,
    /// Another web site has made the browser send the request.
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

/// The answer to a link with the right token: the token moves from the address into a cookie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenExchange {
    /// The address without the token.
    pub location: HeaderValue,
    /// The value of the `Set-Cookie` header.
    pub cookie: HeaderValue,
}

/// The sender of a request as its headers state it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sender {
    /// The server's own page, or the user by an address or a bookmark.
    Own,
    /// A page of another origin.
    Foreign,
    /// Nothing is stated: a program, or a browser that was told to state nothing.
    Unstated,
}

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

impl AccessGuard {
    /// A guard for a server that listens at `host`, without TLS. Beyond loopback it makes a new token.
    ///
    /// # Errors
    ///
    /// Fails if the system has no random numbers.
    pub fn new(host: IpAddr) -> Result<Self, Error> {
        let (scheme, frame_ancestors) = (Scheme::Http, FrameAncestors::default());
        if host.is_loopback() {
            return Ok(Self { scheme, frame_ancestors, token: None });
        }
        Ok(Self { scheme, frame_ancestors, token: Some(random_name()?) })
    }

    /// The token that requests need; none on loopback.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Checks the host that a request names, and who has sent it.
    ///
    /// # Errors
    ///
    /// Fails if `Host` is missing, repeated, or on loopback no loopback name, and if another web site has made the
    /// browser send the request. A link from there to the page itself is allowed, and so is a frame of it if there are
    /// origins whose pages may show one: the page's policy says which, and browsers obey it.
    pub fn check_origin<B>(&self, request: &Request<B>) -> Result<(), AccessDenied> {
        let host = host_of(request).ok_or(AccessDenied::Host)?;
        // The port is not compared: a tunnel may change it. Beyond loopback a machine has many names, and the
        // token protects the server.
        if self.token.is_none() && !is_loopback(host) {
            return Err(AccessDenied::Host);
        }
        if self.sender(request) == Sender::Foreign && !self.is_visit(request) {
            return Err(AccessDenied::Origin);
        }
        Ok(())
    }

    /// Checks the token of a request: `?token=`, a bearer token, or the cookie that `exchange_token` has set.
    ///
    /// # Errors
    ///
    /// Fails if a token is needed, and the request's is missing or wrong.
    pub fn check_token<B>(&self, request: &Request<B>) -> Result<(), AccessDenied> {
        let headers = request.headers();
        let bearer = headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
        let bearer = bearer.and_then(|value| value.split_once(' '));
        let bearer = bearer.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
        let bearer = bearer.map(|(_, token)| token.trim());
        // A browser sends the cookie for pages of other ports of this host, too.
        let cookie = cookie_value(headers, &cookie_name(request));
        let cookie = cookie.filter(|_| self.sender(request) == Sender::Own);
        let mut found = [query_token(request.uri()), bearer, cookie].into_iter().flatten();
        let is_allowed = self.token.is_none() || found.any(|token| self.is_token(token));
        if is_allowed { Ok(()) } else { Err(AccessDenied::Token) }
    }

    /// The cookie and the address for a request whose address holds the token; none if it holds no token, or the
    /// server needs none.
    ///
    /// # Errors
    ///
    /// Fails if the token is wrong.
    pub fn exchange_token<B>(
        &self,
        request: &Request<B>,
    ) -> Result<Option<TokenExchange>, AccessDenied> {
        let Some((token, expected)) = query_token(request.uri()).zip(self.token()) else {
            return Ok(None);
        };
        if !self.is_token(token) {
            return Err(AccessDenied::Token);
        }
        let query = request.uri().query().unwrap_or_default().split('&');
        let others: Vec<&str> = query.filter(|pair| !pair.starts_with(TOKEN_KEY)).collect();
        let separator = if others.is_empty() { "" } else { "?" };
        let location = format!("{}{separator}{}", request.uri().path(), others.join("&"));
        let secure = if self.scheme == Scheme::Https { "; Secure" } else { "" };
        let name = cookie_name(request);
        let cookie = format!("{name}={expected}; Path=/; HttpOnly; SameSite=Strict{secure}");
        let value = |text: String| HeaderValue::try_from(text).map_err(|_| AccessDenied::Token);
        Ok(Some(TokenExchange { location: value(location)?, cookie: value(cookie)? }))
    }

    /// Returns whether a request is a visit of the page in a tab, or in a frame where one may be. Without Fetch metadata
    /// this cannot be known, and the page itself holds nothing that needs protection.
    fn is_visit<B>(&self, request: &Request<B>) -> bool {
        let says = |name: &str, expected: &str| {
            request.headers().get_all(name).iter().all(|value| value == expected)
        };
        let is_frame = || !self.frame_ancestors.is_empty() && says("sec-fetch-dest", "iframe");
        request.method() == Method::GET
            && request.uri().path() == "/"
            && !request.headers().contains_key(ORIGIN)
            && says("sec-fetch-mode", "navigate")
            && (says("sec-fetch-dest", "document") || is_frame())
    }

    fn is_token(&self, found: &str) -> bool {
        let expected = self.token().unwrap_or_default();
        found.as_bytes().ct_eq(expected.as_bytes()).into()
    }

    /// Browsers send `Sec-Fetch-Site` to loopback and by TLS; elsewhere `Referer` stands in for it.
    fn sender<B>(&self, request: &Request<B>) -> Sender {
        let headers = request.headers();
        let host = host_of(request).unwrap_or_default();
        let is_own = |address: &str| {
            let origin = address.split_once("://");
            origin.is_some_and(|(scheme, rest)| {
                let origin_host = rest.split('/').next().unwrap_or_default();
                scheme.eq_ignore_ascii_case(self.scheme.name())
                    && origin_host.eq_ignore_ascii_case(host)
            })
        };
        let stands_in = if headers.contains_key(SEC_FETCH_SITE) { None } else { Some(REFERER) };
        let addresses = stands_in.into_iter().chain([ORIGIN]);
        let of_addresses = addresses.flat_map(|name| headers.get_all(name));
        let of_addresses = of_addresses.map(|address| address.to_str().is_ok_and(is_own));
        let of_sites = headers.get_all(SEC_FETCH_SITE).iter();
        let of_sites = of_sites.map(|site| site == "same-origin" || site == "none");
        let mut sender = Sender::Unstated;
        for is_own in of_addresses.chain(of_sites) {
            if !is_own {
                return Sender::Foreign;
            }
            sender = Sender::Own;
        }
        sender
    }
}

const TOKEN_KEY: &str = "token=";

/// The token in the query of an address.
fn query_token(uri: &Uri) -> Option<&str> {
    uri.query().unwrap_or_default().split('&').find_map(|pair| pair.strip_prefix(TOKEN_KEY))
}

/// The value of the only `Host` header; none if an absolute address names another host.
fn host_of<B>(request: &Request<B>) -> Option<&str> {
    let mut hosts = request.headers().get_all(HOST).iter();
    let (Some(host), None) = (hosts.next(), hosts.next()) else { return None };
    let authority = request.uri().authority();
    let host = host.to_str().ok()?;
    authority.is_none_or(|authority| authority.as_str().eq_ignore_ascii_case(host)).then_some(host)
}

/// The name of the cookie. All ports of a host share their cookies, so it holds the port that the browser knows.
fn cookie_name<B>(request: &Request<B>) -> String {
    let port = host_of(request).and_then(|host| split_port(host).1);
    port.map_or("surfel".to_owned(), |port| format!("surfel-{port}"))
}

fn cookie_value<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    let lines = headers.get_all(COOKIE).iter().filter_map(|line| line.to_str().ok());
    let mut pairs = lines.flat_map(|line| line.split(';')).filter_map(|pair| pair.split_once('='));
    pairs.find(|(found, _)| found.trim() == name).map(|(_, value)| value.trim())
}

/// A host without its port, and the port if there is one.
fn split_port(host: &str) -> (&str, Option<&str>) {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => (name, Some(port)),
        _ => (host, None),
    }
}

/// Returns whether a host, with or without a port, is a name of the loopback interface.
fn is_loopback(host: &str) -> bool {
    let (name, _) = split_port(host);
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    //! Requests that are allowed and denied by their host, sender and token.

    use super::*;

    /// A GET request of this path with these headers.
    fn get(path: &str, headers: &[(&str, &str)]) -> Request<()> {
        let request = Request::get(path);
        headers
            .iter()
            .fold(request, |request, (name, value)| request.header(*name, *value))
            .body(())
            .unwrap()
    }

    fn on_loopback() -> AccessGuard {
        AccessGuard::new("127.0.0.1".parse().unwrap()).unwrap()
    }

    fn beyond_loopback() -> (AccessGuard, String) {
        let guard = AccessGuard::new("0.0.0.0".parse().unwrap()).unwrap();
        let token = guard.token().unwrap().to_owned();
        (guard, token)
    }

    #[test]
    fn on_loopback_only_loopback_names_are_allowed() {
        let guard = on_loopback();
        for host in
            ["localhost", "localhost:9", "127.0.0.1:80", "127.9.9.9", "[::1]:7", "LOCALHOST"]
        {
            assert_eq!(guard.check_origin(&get("/", &[("host", host)])), Ok(()), "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example:80", "192.168.1.1", "127.0.0.1.nip.io", ""]
        {
            let found = guard.check_origin(&get("/", &[("host", host)]));
            assert_eq!(found, Err(AccessDenied::Host), "{host}");
        }
        assert_eq!(guard.check_origin(&get("/", &[])), Err(AccessDenied::Host));
        assert_eq!(guard.check_token(&get("/ws", &[("host", "localhost")])), Ok(()));
    }

    #[test]
    fn a_request_names_one_host() {
        let two = get("/", &[("host", "localhost"), ("host", "localhost")]);
        assert_eq!(on_loopback().check_origin(&two), Err(AccessDenied::Host));
        let other = get("http://evil.example/", &[("host", "localhost")]);
        assert_eq!(on_loopback().check_origin(&other), Err(AccessDenied::Host));
        let same = get("http://localhost/", &[("host", "localhost")]);
        assert_eq!(on_loopback().check_origin(&same), Ok(()));
    }

    #[test]
    fn other_origins_are_denied() {
        let check = |guard: &AccessGuard, name: &str, value: &str| {
            guard.check_origin(&get("/render", &[("host", "localhost:80"), (name, value)]))
        };
        let (http, https) = (on_loopback(), AccessGuard { scheme: Scheme::Https, ..on_loopback() });
        for (name, path) in [("origin", ""), ("referer", "/a/b?c"), ("referer", "")] {
            let own = |scheme: &str| format!("{scheme}://localhost:80{path}");
            assert_eq!(check(&http, name, &own("http")), Ok(()));
            assert_eq!(check(&https, name, &own("https")), Ok(()));
            assert_eq!(check(&http, name, &own("https")), Err(AccessDenied::Origin));
            assert_eq!(check(&https, name, &own("http")), Err(AccessDenied::Origin));
            for origin in ["http://localhost:81", "http://evil.example", "null", "", "localhost:80"]
            {
                assert_eq!(check(&http, name, origin), Err(AccessDenied::Origin), "{origin}");
            }
        }
    }

    #[test]
    fn fetch_metadata_decide_before_the_referrer() {
        let check = |path, headers: &[_]| {
            on_loopback().check_origin(&get(path, &[&[("host", "localhost")], headers].concat()))
        };
        for site in ["same-origin", "none"] {
            assert_eq!(check("/render", &[("sec-fetch-site", site)]), Ok(()));
        }
        let foreign_referer = [("sec-fetch-site", "none"), ("referer", "http://evil.example/")];
        assert_eq!(check("/render", &foreign_referer), Ok(()));
        for site in ["cross-site", "same-site", "", "SAME-ORIGIN"] {
            let denied = Err(AccessDenied::Origin);
            assert_eq!(check("/render", &[("sec-fetch-site", site)]), denied, "{site}");
            let visit = [
                ("sec-fetch-site", site),
                ("sec-fetch-mode", "navigate"),
                ("sec-fetch-dest", "document"),
            ];
            assert_eq!(check("/?a=b", &visit), Ok(()), "{site}");
            for path in ["/render", "/ws", "/scene", "/stats", "/healthz"] {
                assert_eq!(check(path, &visit), denied, "{site} {path}");
            }
            let frame = [visit[0], visit[1], ("sec-fetch-dest", "iframe")];
            assert_eq!(check("/", &frame), denied, "{site}");
            let image = [visit[0], ("sec-fetch-mode", "no-cors"), ("sec-fetch-dest", "image")];
            assert_eq!(check("/", &image), denied, "{site}");
        }
    }

    #[test]
    fn frames_need_an_origin_that_may_show_them() {
        let guard = on_loopback();
        let frame = |path: &str, site: &str, dest: &str| {
            let headers = [("host", "localhost"), ("sec-fetch-site", site)];
            let headers =
                [headers[0], headers[1], ("sec-fetch-mode", "navigate"), ("sec-fetch-dest", dest)];
            guard.check_origin(&get(path, &headers))
        };
        assert_eq!(frame("/", "same-site", "iframe"), Err(AccessDenied::Origin));
        guard.frame_ancestors.allow("http://localhost:8888").unwrap();
        for site in ["same-site", "cross-site"] {
            assert_eq!(frame("/", site, "iframe"), Ok(()), "{site}");
            for path in ["/render", "/ws", "/scene", "/stats", "/healthz"] {
                assert_eq!(frame(path, site, "iframe"), Err(AccessDenied::Origin), "{path}");
            }
            for dest in ["frame", "embed", "object", "image", "script"] {
                assert_eq!(frame("/", site, dest), Err(AccessDenied::Origin), "{dest}");
            }
        }
    }

    #[test]
    fn beyond_loopback_a_token_is_required() {
        let (guard, token) = beyond_loopback();
        assert_eq!(token.len(), 32);
        assert_ne!(beyond_loopback().1, token);
        assert_eq!(guard.check_token(&get(&format!("/ws?a=1&token={token}"), &[])), Ok(()));
        for scheme in ["Bearer", "bearer", "BEARER", "Bearer "] {
            let value = format!("{scheme} {token}");
            let request = get("/render", &[("authorization", &value)]);
            assert_eq!(guard.check_token(&request), Ok(()), "{scheme}");
        }
        for invalid in ["/ws".into(), "/ws?token=".into(), format!("/ws?token={}", &token[1..])] {
            assert_eq!(guard.check_token(&get(&invalid, &[])), Err(AccessDenied::Token));
        }
        for value in [token.clone(), format!("Basic {token}"), format!("Bearer{token}")] {
            let request = get("/render", &[("authorization", &value)]);
            assert_eq!(guard.check_token(&request), Err(AccessDenied::Token), "{value}");
        }
    }

    #[test]
    fn a_link_is_exchanged_for_a_cookie() {
        let (guard, token) = beyond_loopback();
        let host = ("host", "scan.example:8080");
        let link = get(&format!("/?a=1&token={token}&b=2"), &[host]);
        let TokenExchange { location, cookie } = guard.exchange_token(&link).unwrap().unwrap();
        assert_eq!(location, "/?a=1&b=2");
        let expected = format!("surfel-8080={token}; Path=/; HttpOnly; SameSite=Strict");
        assert_eq!(cookie, expected);
        let encrypted = AccessGuard { scheme: Scheme::Https, ..guard.clone() };
        let of_encrypted = encrypted.exchange_token(&link).unwrap().unwrap();
        assert_eq!(of_encrypted.cookie, format!("{expected}; Secure"));
        let bare = get(&format!("/?token={token}"), &[("host", "scan.example")]);
        let TokenExchange { location, cookie } = guard.exchange_token(&bare).unwrap().unwrap();
        assert_eq!(location, "/");
        assert!(cookie.to_str().unwrap().starts_with("surfel="));
        assert_eq!(guard.exchange_token(&get("/?a=1", &[host])), Ok(None));
        assert_eq!(guard.exchange_token(&get("/?token=0", &[host])), Err(AccessDenied::Token));
        assert_eq!(on_loopback().exchange_token(&link), Ok(None));
    }

    #[test]
    fn a_cookie_counts_for_the_own_page_alone() {
        let (guard, token) = beyond_loopback();
        let cookie = format!("a=b; surfel-8080={token}; c=d");
        let check = |headers: &[_]| {
            let own = [("host", "scan.example:8080"), ("cookie", &cookie)];
            guard.check_token(&get("/render", &[&own, headers].concat()))
        };
        for own in [
            ("origin", "http://scan.example:8080"),
            ("referer", "http://scan.example:8080/"),
            ("sec-fetch-site", "same-origin"),
            ("sec-fetch-site", "none"),
        ] {
            assert_eq!(check(&[own]), Ok(()), "{own:?}");
        }
        for foreign in [
            ("accept", "*/*"),
            ("referer", "http://scan.example/"),
            ("sec-fetch-site", "same-site"),
        ] {
            assert_eq!(check(&[foreign]), Err(AccessDenied::Token), "{foreign:?}");
        }
        let other_port =
            [("host", "scan.example:81"), ("cookie", &*cookie), ("sec-fetch-site", "none")];
        assert_eq!(guard.check_token(&get("/render", &other_port)), Err(AccessDenied::Token));
    }
}
