//! Ctrl-C.

use super::common::{Folder, command, dome};
use std::process::Stdio;
use std::time::{Duration, Instant};

#[test]
fn ctrl_c_stops_within_a_second_and_leaves_no_file() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    let picture = folder.path("out.png");
    let arguments = ["render", &cloud, "-o", &picture, "--resolution", "4000x4000", "--spp", "64"];
    let mut child = command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    assert!(child.try_wait().unwrap().is_none(), "it ended before it was stopped");
    let start = Instant::now();
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("error: cancelled"), "{text}");
    assert_eq!(folder.names(), ["dome.ply"]);
}
