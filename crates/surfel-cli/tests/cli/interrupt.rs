//! Ctrl-C and SIGTERM.

use super::common::{Folder, command, dome};
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const SIGTERM: i32 = 15;

fn send(signal: &str, child: &Child) {
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
}

#[test]
fn one_signal_stops_within_a_second_and_leaves_no_file() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    let picture = folder.path("out.png");
    let arguments = ["render", &cloud, "-o", &picture, "--resolution", "4000x4000", "--spp", "64"];
    for signal in ["-INT", "-TERM"] {
        let mut child = command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(1500));
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was stopped");
        let start = Instant::now();
        send(signal, &child);
        let output = child.wait_with_output().unwrap();
        assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
        assert_eq!(output.status.code(), Some(1));
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains("error: cancelled"), "{text}");
        assert_eq!(folder.names(), ["dome.ply"]);
    }
}

#[test]
fn a_second_signal_ends_work_that_does_not_ask() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    // A noisy picture is more than a pipe holds, so writing it waits for ever for somebody to read on.
    let arguments =
        ["render", &cloud, "-o", "-", "--resolution", "600x500", "--spp", "1", "--samples", "1"];
    let mut child =
        command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
    send("-INT", &child);
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "the first signal only asks");
    send("-TERM", &child);
    assert_eq!(child.wait().unwrap().signal(), Some(SIGTERM));
}
