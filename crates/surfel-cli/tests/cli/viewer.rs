//! `surfel view`: responses to HTTP requests, start and end of the server.

use super::common::{Folder, command, dome, fail, succeed, surfel, wait};
use super::sequences;
use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A server that is killed at the end of the test.
pub struct Server {
    child: Child,
    host: String,
}

impl Server {
    pub fn start(arguments: &[&str]) -> Self {
        let arguments: Vec<&str> =
            ["view", "--port", "0"].iter().chain(arguments).copied().collect();
        let mut child =
            command(&arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut link = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut link).unwrap();
        let host = link.trim().trim_start_matches("http://").trim_end_matches('/').to_owned();
        let server = Self { child, host };
        while !server.get("/healthz").1.windows(5).any(|word| word == b"ready") {
            std::thread::sleep(Duration::from_millis(20));
        }
        server
    }

    /// Returns status and body.
    pub fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.host);
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").unwrap();
        let status = String::from_utf8_lossy(&answer[9..12]).parse().unwrap();
        (status, answer[end + 4..].to_vec())
    }

    fn error(&self, path: &str) -> String {
        self.error_of_status(400, path)
    }

    fn error_of_status(&self, expected: u16, path: &str) -> String {
        let (status, body) = self.get(path);
        assert_eq!(status, expected, "{path}");
        String::from_utf8(body).unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn the_server_renders_the_pictures_of_the_command_line() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let picture = folder.path("out.png");
    let server = Server::start(&[&cloud, "--spp", "2"]);
    for (query, options) in [
        ("", &[][..]),
        ("&color=rain&cmap=turbo", &["--color", "rain", "--cmap", "turbo"]),
        ("&camera-azimuth-angle=40&light=sun", &["--camera-azimuth-angle", "40", "--light", "sun"]),
        ("&clip-plane=0,0,0.2,0,0,1&spp=1", &["--clip-plane", "0,0,0.2,0,0,1", "--spp", "1"]),
        ("&material=mirror&radius-scale=1.5", &["--material", "mirror", "--radius-scale", "1.5"]),
    ] {
        let (status, served) = server.get(&format!("/render?resolution=60x40{query}"));
        assert_eq!(status, 200, "{query}: {}", String::from_utf8_lossy(&served));
        let common = ["render", &cloud, "-o", &picture, "--resolution", "60x40", "--spp", "2"];
        succeed(&[&common, options].concat());
        assert!(served == fs::read(&picture).unwrap(), "{query}");
    }
}

#[test]
fn files_are_hidden_and_coloured_apart() {
    let folder = Folder::new();
    let (cloud, other) = (folder.write("dome.ply", dome(40)), folder.write("other.ply", dome(30)));
    let picture = folder.path("out.png");
    let server = Server::start(&[&cloud, &other, "--spp", "1", "--exposure", "0"]);
    let mut pictures = BTreeSet::new();
    for setting in ["dome.ply:visible=false", "other:visible=false", "other.ply:color=rain", ""] {
        let query = match setting {
            "" => String::new(),
            setting => format!("&object-settings={setting}"),
        };
        let query = format!("/render?resolution=60x40&camera-position=3,-3,3{query}");
        let (status, served) =
            server.get(&query.replace(":visible=", ":visible%3D").replace(":color=", ":color%3D"));
        assert_eq!(status, 200, "{query}: {}", String::from_utf8_lossy(&served));
        let options = match setting {
            "" => vec![],
            setting => vec!["--object-settings", setting],
        };
        let camera = ["--camera-position", "3,-3,3", "--resolution", "60x40"];
        let common = ["render", &cloud, &other, "-o", &picture, "--spp", "1", "--exposure", "0"];
        succeed(&[&common[..], &camera, &options].concat());
        assert!(served == fs::read(&picture).unwrap(), "{setting}");
        pictures.insert(served);
    }
    assert_eq!(pictures.len(), 4);
    for (setting, expected) in [
        ("none.ply:visible%3Dfalse", "no file or object"),
        ("dome.ply:vertices%3Dtrue", "cannot change vertices"),
        ("dome.ply:size%3D3", "unknown key `size`"),
        ("dome.ply:color%3Dwind", "wind"),
    ] {
        let error = server.error(&format!("/render?object-settings={setting}"));
        assert!(error.contains(expected), "{setting}: {error}");
    }
}

#[test]
fn each_request_of_the_initial_scene_gets_the_same() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let server = Server::start(&[&cloud]);
    let (status, first) = server.get("/scene");
    assert_eq!(status, 200);
    let scene = String::from_utf8(first.clone()).unwrap();
    assert!(scene.contains("\"focal_point\"") && scene.contains("1920x1080"), "{scene}");
    assert_eq!(server.get("/scene"), (200, first));
}

#[test]
fn the_server_renders_a_sequence_at_any_time() {
    let folder = sequences::site();
    let files = format!("files = {:?}\nfps = 2\n", sequences::FRAMES);
    let scene = folder.write("scene.toml", sequences::scene("\"sun\"", &files));
    let picture = folder.path("out.png");
    let server = Server::start(&[&scene, "--spp", "1"]);
    let times = ["1", "0", "2", "0.5", "1.5", "0.5"].map(|time| (time, "0.2"));
    for (time, exposure) in times.into_iter().chain([("1", "auto"), ("2", "auto")]) {
        let query = format!("/render?resolution=40x30&time={time}&exposure={exposure}");
        let (status, served) = server.get(&query);
        assert_eq!(status, 200, "{query}: {}", String::from_utf8_lossy(&served));
        let options = ["--time", time, "--exposure", exposure, "--spp", "1"];
        let size = ["--resolution", "40x30", "-o", &picture];
        succeed(&[&["render", &scene][..], &options, &size].concat());
        assert!(served == fs::read(&picture).unwrap(), "{query}");
    }
}

#[test]
fn errors_name_files_without_their_folders() {
    let folder = sequences::site();
    let files = format!("files = {:?}\nfps = 2\n", sequences::FRAMES);
    let scene = folder.write("scene.toml", sequences::scene("\"sun\"", &files));
    let prefix = folder.path("");
    let server = Server::start(&[&scene, "--spp", "1"]);
    let assert_hidden = |status: u16, query: &str, name: &str| {
        let error = server.error_of_status(status, &format!("/render?resolution=40x30&{query}"));
        assert!(error.contains(name) && !error.contains(&prefix), "{query}: {error}");
    };
    assert_hidden(400, "color=nothing", ".ply");
    for name in sequences::FRAMES {
        fs::remove_file(folder.path(name)).unwrap();
    }
    assert_hidden(500, "time=1.5", ".ply");
}

#[test]
fn settings_that_a_page_may_not_change_are_rejected() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    let server = Server::start(&[&cloud]);
    for (query, expected) in [
        ("environment=/etc/passwd", "environment"),
        ("output=/tmp/x.png", "output"),
        ("object=x", "object"),
        ("spp=100000", "spp"),
        ("sharpness=3", "sharpness"),
        ("camera-view-angle=400", "camera.view_angle"),
        ("resolution=8192x8192&spp=1024", "rays"),
        ("resolution=16000x16000&spp=1", "16000x16000"),
        ("radius-scale=100", "over each other"),
        ("radius=1e9", "over each other"),
    ] {
        let error = server.error(&format!("/render?{query}"));
        assert!(error.contains(expected), "{query}: {error}");
    }
    let pixels = "/render?surface=points&radius-scale=100&resolution=20x10";
    assert_eq!(server.get(pixels).0, 200);
    assert_eq!(server.get("/../Cargo.toml").0, 404);
}

#[test]
fn the_links_of_all_addresses_reach_the_server() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let arguments = ["view", &cloud, "--port", "0", "--host", "0.0.0.0"];
    let mut child =
        command(&arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    // The last link is for this machine, the one before it, if there is a network, for others.
    let mut has_local_link = false;
    for link in lines {
        let link = link.unwrap();
        let (host, query) = link["http://".len()..].split_once('/').unwrap();
        let mut stream = TcpStream::connect(host).unwrap();
        let head = format!("GET /scene{query} HTTP/1.0\r\nHost: {host}\r\n\r\n");
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(["200", "503"].contains(&&answer[9..12]), "{link}: {answer}");
        has_local_link = link.contains("//localhost:");
        if has_local_link {
            break;
        }
        assert!(!link.contains("//0.0.0.0"), "{link}");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(has_local_link, "the server printed no link for this machine");
}

#[test]
fn a_signal_ends_the_server() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let mut server = Server::start(&[&cloud]);
    let kill = Command::new("kill").args(["-INT", &server.child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    assert_eq!(wait(&mut server.child).code(), Some(0));
}

#[test]
fn errors_before_serving_are_reported() {
    let folder = Folder::new();
    let missing = folder.path("missing.laz");
    assert!(fail(&["view", &missing, "--port", "0"], 1).contains("missing.laz"));
    assert!(surfel(&["view", &missing, "--port", "0"]).stdout.is_empty(), "a link to nothing");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let cloud = folder.write("dome.ply", dome(20));
    // This address is reserved for documentation (RFC 5737).
    let message = fail(&["view", &cloud, "--host", "192.0.2.1", "--port", "0"], 1);
    assert!(message.contains("--host"), "{message}");
    assert!(fail(&["view", &cloud, "--port", &port], 1).contains("--port"));
    fail(&["view", &cloud, "--camera-view-angle", "400"], 2);
    assert!(fail(&["view", &cloud, "--tls-cert", &cloud], 2).contains("--tls-key"));
    let (empty, absent) = (folder.write("empty.pem", ""), folder.path("absent.pem"));
    for (certificate, key, expected) in
        [(&empty, &empty, "empty.pem: expected a certificate"), (&empty, &absent, "absent.pem")]
    {
        let options = ["--port", "0", "--tls-cert", certificate, "--tls-key", key];
        let message = fail(&[&["view", &cloud][..], &options].concat(), 1);
        assert!(message.contains(expected), "{message}");
    }
}
