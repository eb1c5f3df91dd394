//! Frames of a movie from the workers of a Dask scheduler, by the Python package.

use serde_json::{Value, json};
use std::env;
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, absolute};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;
use surfel::animate::AddFrame;
use surfel::description::ObjectOverride;
use surfel::description::rule::absolute_text;
use surfel::{Error, Result, SceneDescription};
use surfel_core::progress::Progress;

/// Names the interpreter that has the package, if it is not `python3`. The package's own program sets it.
const INTERPRETER: &str = "SURFEL_PYTHON";

/// Installs the package from a checkout.
const INSTALL: &str = "`pip install './crates/surfel-python[dask]'`";

/// Time between two looks whether the work is cancelled.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Longest file of a frame that is taken.
const MAX_FRAME_BYTES: u64 = 1 << 32;

/// A frame as it arrives: its index, and the bytes of its file.
type Frame = (u32, Vec<u8>);

/// Renders frames of a description's movie on the workers of the scheduler at `address`, and adds each as a file of
/// `format`.
///
/// # Errors
///
/// Fails if there is no Python with the package, if the scheduler cannot be reached, as rendering does, and if cancelled.
pub fn render_frames(
    address: &str,
    description: &SceneDescription,
    (frames, format): (&[u32], &str),
    add: &mut AddFrame<'_>,
    progress: &dyn Progress,
) -> Result<()> {
    let job = job(address, description, frames, format)?;
    let mut python = Python::start(&job)?;
    let received = python.receive(add, progress);
    if received.is_err() {
        // It may have ended already.
        let _ = python.child.kill();
        let _ = python.child.wait();
    }
    received.and_then(|()| python.end())
}

/// Returns the job as the package reads it.
fn job(
    address: &str,
    description: &SceneDescription,
    frames: &[u32],
    format: &str,
) -> Result<Value> {
    let path = |file| absolute(file).map(|path| path.display().to_string());
    let files = description.files.iter().map(path).collect::<io::Result<Vec<String>>>();
    let files = files.map_err(|error| Error::Unfit(format!("the folder is unknown: {error}")))?;
    let scene = Value::Object(for_other_folders(description).to_table()).to_string();
    Ok(json!({
        "address": address, "files": files, "scene": scene, "frames": frames, "format": format,
    }))
}

/// Returns a description, whose settings by name are applied, as programs in other folders read it: materials and labels
/// name files by their absolute paths.
fn for_other_folders(description: &SceneDescription) -> SceneDescription {
    let mut sent = description.clone();
    if let Some(all) = &mut sent.overrides.object_settings {
        all.retain(ObjectOverride::is_label);
    }
    let is_path = |target: &str| description.named_files().any(|file| file == Path::new(target));
    sent.rename_targets(|target| match is_path(target) {
        true => absolute_text(Path::new(target)),
        false => target.to_owned(),
    });
    sent
}

/// The package at work in an interpreter.
struct Python {
    child: Child,
    frames: Receiver<Frame>,
    messages: thread::JoinHandle<String>,
}

impl Python {
    fn start(job: &Value) -> Result<Self> {
        let interpreter = env::var_os(INTERPRETER).unwrap_or_else(|| OsString::from("python3"));
        let mut command = Command::new(&interpreter);
        command.args(["-m", "surfel.dask"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let missing = |error: io::Error| {
            Error::Unfit(format!(
                "--cluster needs the Python package, and {} does not run: {error}; install Python and \
                 {INSTALL}, or name the interpreter by {INTERPRETER}",
                interpreter.display()
            ))
        };
        let mut child = command.spawn().map_err(missing)?;
        let (stdin, stdout, stderr) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let job = job.to_string();
        // An interpreter that has ended says why on stderr.
        thread::spawn(move || stdin.map(|mut stdin| stdin.write_all(job.as_bytes())));
        let (sender, frames) = sync_channel(1);
        thread::spawn(move || stdout.map(|stdout| send_frames(stdout, &sender)));
        let messages = thread::spawn(move || {
            let mut text = Vec::new();
            // What cannot be read is not shown.
            let _ = stderr.map(|mut stderr| stderr.read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        });
        Ok(Self { child, frames, messages })
    }

    /// Adds frames until the interpreter sends no more.
    fn receive(&self, add: &mut AddFrame<'_>, progress: &dyn Progress) -> Result<()> {
        loop {
            progress.check()?;
            match self.frames.recv_timeout(POLL_INTERVAL) {
                Ok((index, bytes)) => add(index, &bytes)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    }

    /// Waits for the end, and fails with the last line of what was said if it was a failure.
    fn end(mut self) -> Result<()> {
        let status = self.child.wait();
        let text = self.messages.join().unwrap_or_default();
        if status.as_ref().is_ok_and(|status| status.success()) {
            return Ok(());
        }
        let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
        let is_missing = ["No module named", "ImportError"].iter().any(|word| last.contains(word));
        let advice = if is_missing { format!("; install it by {INSTALL}") } else { String::new() };
        Err(Error::Unfit(format!("--cluster: the Python package failed: {last}{advice}")))
    }
}

/// Sends frames on until there are no more: of each a line with its index and its number of bytes, and these.
fn send_frames(stdout: ChildStdout, sender: &SyncSender<Frame>) {
    let mut stdout = BufReader::new(stdout);
    while let Some(frame) = read_frame(&mut stdout) {
        if sender.send(frame).is_err() {
            return;
        }
    }
}

/// Reads a frame; none at the end and after a broken one, without which the movie is not complete.
fn read_frame(stdout: &mut impl BufRead) -> Option<Frame> {
    let mut line = String::new();
    stdout.read_line(&mut line).ok()?;
    let (index, n_bytes) = line.trim_end().split_once(' ')?;
    let (index, n_bytes) = (index.parse().ok()?, n_bytes.parse().ok()?);
    let mut bytes = Vec::new();
    let n_read = stdout.take(MAX_FRAME_BYTES.min(n_bytes)).read_to_end(&mut bytes).ok()?;
    (n_read as u64 == n_bytes).then_some((index, bytes))
}

#[cfg(test)]
mod tests {
    //! Jobs for other folders; frames are read as they are sent, and broken ones end the stream.

    use super::*;

    #[test]
    fn targets_that_are_paths_are_sent_as_absolute_paths() {
        let mut description = SceneDescription::of_files(["scans/a.laz", "scans/b.laz"]);
        let set = |description: &mut SceneDescription, key: &str, value: Value| {
            description.set(key, &value, Path::new("")).unwrap();
        };
        let materials = ["metal", "scans/a.laz=mirror", "scans/b.laz=glass", "b=matte"];
        set(&mut description, "material", json!(materials));
        let settings = ["scans/b.laz:color=class", "scans/a.laz:label=A"];
        set(&mut description, "object_settings", json!(settings));
        description.apply_object_settings().unwrap();
        let job = job("tcp://x:1", &description, &[0], "png").unwrap();
        let folder = absolute("scans").unwrap().display().to_string();
        assert_eq!(job["files"], json!([format!("{folder}/a.laz")]));
        let scene: Value = serde_json::from_str(job["scene"].as_str().unwrap()).unwrap();
        let [a, b] = ["a", "b"].map(|name| format!("{folder}/{name}.laz"));
        let targets = json!(["metal", format!("{a}=mirror"), format!("{b}=glass"), "b=matte"]);
        assert_eq!(scene["material"], targets);
        assert_eq!(scene["object_settings"], json!([format!("{a}:label=A")]));
        assert_eq!(scene["object"][0]["file"], json!(b));
        let sent = SceneDescription::from_table(scene.as_object().unwrap(), Path::new("/"));
        assert!(sent.is_ok(), "{sent:?}");
    }

    #[test]
    fn frames_are_read_one_after_the_other() {
        let mut sent = &b"3 2\nab0 0\n12 5\nabc"[..];
        assert_eq!(read_frame(&mut sent), Some((3, b"ab".to_vec())));
        assert_eq!(read_frame(&mut sent), Some((0, Vec::new())));
        assert_eq!(read_frame(&mut sent), None);
        for broken in ["", "x 1\na", "1\n", "1 99999999999999999999\n", "-1 1\na", "1 1"] {
            assert_eq!(read_frame(&mut broken.as_bytes()), None, "{broken}");
        }
    }
}
