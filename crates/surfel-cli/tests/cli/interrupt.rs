//! Signals: the first Ctrl-C or SIGTERM cancels the work, a second one kills the process.

use super::common::{Folder, command, dome, wait};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const SIGTERM: i32 = 15;

fn send(signal: &str, child: &Child) {
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
}

#[test]
fn the_first_signal_cancels_rendering_and_leaves_no_file() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    let picture = folder.path("out.png");
    // This picture takes minutes: a process that ends earlier was cancelled.
    let size = ["--resolution", "4000x4000", "--spp", "256", "--verbose"];
    let arguments = [&["render", &cloud, "-o", &picture][..], &size].concat();
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let mut child = command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        // The time of this stage is reported when the next one, rendering, begins.
        let mut line = String::new();
        while !line.starts_with("build tree: ") {
            line.clear();
            assert_ne!(stderr.read_line(&mut line).unwrap(), 0, "no tree was built");
        }
        send(signal, &child);
        let mut text = String::new();
        stderr.read_to_string(&mut text).unwrap();
        assert_eq!(wait(&mut child).code(), Some(code));
        assert!(text.contains("error: cancelled"), "{text}");
        assert_eq!(folder.names(), ["dome.ply"]);
    }
}

#[test]
fn a_signal_ends_the_wait_for_standard_input() {
    let folder = Folder::new();
    let picture = folder.path("out.png");
    let mut command = command(&["render", "-", "-o", &picture]);
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let copy = std::env::temp_dir().join(format!("surfel-stdin-{}.xyz", child.id()));
    while !copy.exists() {
        assert!(child.try_wait().unwrap().is_none(), "the program ended before its input");
        std::thread::sleep(Duration::from_millis(20));
    }
    send("-INT", &child);
    assert_eq!(wait(&mut child).code(), Some(130));
    assert!(!copy.exists() && folder.names().is_empty());
}

#[test]
fn second_signal_kills_blocked_process() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    // The picture exceeds the buffer of a pipe, so that writing it blocks until the test reads on.
    let arguments = [
        "render",
        &cloud,
        "-o",
        "-",
        "--resolution",
        "600x500",
        "--spp",
        "1",
        "--light-samples",
        "1",
    ];
    let mut child =
        command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
    send("-INT", &child);
    wait_for_delivery(&child);
    assert!(child.try_wait().unwrap().is_none(), "the first signal killed the process");
    // The process may not have handled the first signal yet.
    while child.try_wait().unwrap().is_none() {
        send("-TERM", &child);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(wait(&mut child).signal(), Some(SIGTERM));
}

/// Waits until the process has received all signals that were sent to it.
fn wait_for_delivery(child: &Child) {
    let status = format!("/proc/{}/status", child.id());
    loop {
        std::thread::sleep(Duration::from_millis(20));
        // Systems without this file do not list pending signals: there, the pause has to suffice.
        let Ok(text) = fs::read_to_string(&status) else { return };
        let masks = text.lines().filter_map(|line| {
            line.strip_prefix("SigPnd:").or_else(|| line.strip_prefix("ShdPnd:"))
        });
        if masks.map(|mask| u64::from_str_radix(mask.trim(), 16)).all(|mask| mask == Ok(0)) {
            return;
        }
    }
}
