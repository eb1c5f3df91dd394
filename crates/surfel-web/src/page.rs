//! The page's files, embedded in the program, bundled and compressed: no request reaches the file system.

use crate::bundle::{bundle_modules, bundle_styles};
use crate::frame_ancestors::FrameAncestors;
use axum::body::Bytes;
use axum::http::header::{self, HeaderName};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use flate2::Compression;
use flate2::write::GzEncoder;
use rust_embed::RustEmbed;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Write;
use std::sync::LazyLock;

#[derive(RustEmbed)]
#[folder = "page/"]
struct Embedded;

/// The page loads nothing from other origins and runs no code of its own text. Which pages may frame it follows.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors ";

/// One file as it is served.
struct PageFile {
    name: String,
    content_type: &'static str,
    /// Quoted hash of the content.
    tag: HeaderValue,
    cache_control: &'static str,
    plain: Bytes,
    gzipped: Bytes,
}

/// Names with the hash of their content never change it; the page itself is requested again each time.
const CACHE_FOREVER: &str = "public, max-age=31536000, immutable";
const CACHE_AND_ASK: &str = "no-cache";

static FILES: LazyLock<Vec<PageFile>> =
    LazyLock::new(|| page_files().expect("a test bundles the page"));

/// The response with a file of the page for a request with these headers, if there is one; an empty name stands for the page
/// itself, which pages of `ancestors` may frame.
pub fn file(name: &str, request: &HeaderMap, ancestors: &FrameAncestors) -> Option<Response> {
    let file = FILES.iter().find(|file| file.name == name)?;
    let policy = HeaderValue::try_from(format!("{POLICY}{}", ancestors.source_list()));
    let policy = policy.expect("origins have characters of headers alone");
    let common = [
        (header::CONTENT_SECURITY_POLICY, policy),
        (header::CACHE_CONTROL, HeaderValue::from_static(file.cache_control)),
        (header::ETAG, file.tag.clone()),
        (header::VARY, HeaderValue::from_static("accept-encoding")),
    ];
    if request.get_all(header::IF_NONE_MATCH).iter().any(|tag| tag == file.tag) {
        return Some((StatusCode::NOT_MODIFIED, common).into_response());
    }
    let content_type = [(header::CONTENT_TYPE, file.content_type)];
    if !accepts_gzip(request) {
        return Some((common, content_type, file.plain.clone()).into_response());
    }
    let encoding = [(header::CONTENT_ENCODING, "gzip")];
    Some((common, content_type, encoding, file.gzipped.clone()).into_response())
}

/// Returns whether a client accepts compressed content.
fn accepts_gzip(request: &HeaderMap) -> bool {
    let lines =
        request.get_all(header::ACCEPT_ENCODING).iter().filter_map(|line| line.to_str().ok());
    lines.flat_map(|line| line.split(',')).any(|encoding| {
        let (name, weight) = encoding.split_once(';').unwrap_or((encoding, ""));
        let weight = weight.trim().strip_prefix("q=").map_or(Ok(1.0), str::parse::<f32>);
        name.trim().eq_ignore_ascii_case("gzip") && weight.is_ok_and(|weight| 0.0 < weight)
    })
}

/// The page with its first script, one style sheet and its icon, and the scripts that it loads when it needs them. Their
/// addresses hold the hashes of their contents.
fn page_files() -> Result<Vec<PageFile>, String> {
    let read = |name: &str| {
        let found = Embedded::get(name)?;
        String::from_utf8(found.data.into_owned()).ok()
    };
    let mut page = read("index.html").ok_or("index.html: is missing")?;
    let mut styles = Vec::new();
    let mut lines = Vec::new();
    for line in page.lines() {
        match line.trim().strip_prefix(STYLE_LINK).and_then(|rest| rest.strip_suffix("\">")) {
            Some(name) => styles.push(name),
            None => lines.push(line.trim_start()),
        }
    }
    let style = PageFile::hashed("page", "css", bundle_styles(&styles, &read)?);
    let mut scripts = Vec::new();
    let mut add_script = |name: &str, text: String| {
        let script = PageFile::hashed(name.trim_end_matches(".js"), "js", text);
        let address = script.name.clone();
        scripts.push(script);
        address
    };
    let script = PageFile::hashed("page", "js", bundle_modules(ENTRY, &read, &mut add_script)?);
    let icon = PageFile::hashed("icon", "svg", read(ICON).ok_or("the icon is missing")?);
    page =
        lines.join("\n").replacen("</head>", &format!("{STYLE_LINK}{}\">\n</head>", style.name), 1);
    for (name, file) in [(ENTRY, &script), (ICON, &icon)] {
        page = page.replacen(&format!("\"{name}\""), &format!("\"{}\"", file.name), 1);
    }
    let page = PageFile::new(String::new(), "html", CACHE_AND_ASK, page);
    scripts.extend([page, style, script, icon]);
    Ok(scripts)
}

/// The first module of the page.
const ENTRY: &str = "main.js";
const ICON: &str = "icon.svg";
/// The beginning of a link to a style sheet in the page, up to the sheet's name.
const STYLE_LINK: &str = "<link rel=\"stylesheet\" href=\"";

impl PageFile {
    /// A file whose name holds the hash of its content.
    fn hashed(stem: &str, extension: &str, content: String) -> Self {
        let name = format!("{stem}-{}.{extension}", hash(&content));
        Self::new(name, extension, CACHE_FOREVER, content)
    }

    fn new(name: String, extension: &str, cache_control: &'static str, content: String) -> Self {
        let tag = HeaderValue::try_from(format!("\"{}\"", hash(&content)))
            .expect("a hash has digits alone");
        let gzipped = gzipped(content.as_bytes()).expect("memory can be written").into();
        let content_type = content_type(extension);
        Self { name, content_type, tag, cache_control, plain: content.into(), gzipped }
    }
}

fn hash(content: &str) -> String {
    let mut hasher = DefaultHasher::new();
    content.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}

fn gzipped(content: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(content)?;
    encoder.finish()
}

fn content_type(extension: &str) -> &'static str {
    match extension {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

/// Headers of every response, errors among them.
pub const COMMON_HEADERS: [(HeaderName, HeaderValue); 3] = [
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    // Without Fetch metadata the page's own requests are known by their referrer.
    (header::REFERRER_POLICY, HeaderValue::from_static("same-origin")),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        HeaderValue::from_static("same-origin"),
    ),
];

#[cfg(test)]
mod tests {
    //! The page is bundled, and its keys choose colours that there are.

    use super::*;
    use crate::limits::Limits;
    use surfel_core::scene::color::ColorSource;

    #[test]
    fn the_page_can_be_bundled() {
        let files = page_files().unwrap();
        let text = |file: &PageFile| String::from_utf8(file.plain.to_vec()).unwrap();
        let page = files.iter().find(|file| file.name.is_empty()).map(text).unwrap();
        assert!(!page.contains(ENTRY) && !page.contains("base.css"));
        let is_script =
            |file: &&PageFile| file.name.starts_with("page-") && file.name.ends_with(".js");
        let script = files.iter().find(is_script).map(text).unwrap();
        for PageFile { name, .. } in files.iter().filter(|file| !file.name.is_empty()) {
            let is_named = page.contains(&format!("\"{name}\""));
            assert!(is_named || script.contains(&format!("import('./{name}')")), "{name}");
        }
    }

    #[test]
    fn the_page_knows_how_long_its_first_message_may_be() {
        let script = Embedded::get("viewer.js").unwrap().data;
        let script = std::str::from_utf8(&script).unwrap();
        let (_, rest) = script.split_once("MAX_HELLO_BYTES = ").unwrap();
        let (number, _) = rest.split_once(';').unwrap();
        let max_bytes: usize = number.replace('_', "").parse().unwrap();
        assert_eq!(max_bytes, Limits::default().max_message_bytes);
    }

    #[test]
    fn keys_choose_colors_by_the_names_of_their_sources() {
        let script = Embedded::get("keyboard.js").unwrap().data;
        let script = std::str::from_utf8(&script).unwrap();
        let named: Vec<&str> =
            script.split("colorBy('").skip(1).filter_map(|rest| rest.split('\'').next()).collect();
        assert!(!named.is_empty());
        let known = ColorSource::names_where(|_| true);
        assert!(named.iter().all(|name| known.contains(name)), "{named:?}");
    }
}
