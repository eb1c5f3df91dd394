//! A run of the program ffmpeg that receives raw frames on its standard input.
//!
//! A linked encoder would bring its patents, its C code and its size; the program is installed on most
//! machines.

use std::ffi::{OsStr, OsString};
use std::io::{self, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use surfel_core::progress::Progress;

use crate::error::{Error, Result};

/// Name of the program, which the system looks up.
pub(super) const PROGRAM: &str = "ffmpeg";

/// Time that a program that refused a frame has to exit before it is killed.
const EXIT_TIMEOUT: Duration = Duration::from_secs(5);
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// A running ffmpeg process. Dropping it kills the process if it is still running.
pub(super) struct FfmpegProcess {
    /// Path of the movie, for messages.
    file: String,
    /// Name of the program, for messages.
    program: String,
    /// Advice at the end of each error message.
    advice: &'static str,
    child: Child,
    stdin: Option<ChildStdin>,
    /// Drains standard error while the program runs: a full pipe would block the program.
    stderr_reader: Option<JoinHandle<Vec<u8>>>,
}

impl FfmpegProcess {
    /// Starts `program` for the movie `file`.
    ///
    /// # Errors
    ///
    /// Fails if the program is missing or cannot be started.
    pub fn start(
        file: String,
        program: &OsStr,
        arguments: &[OsString],
        advice: &'static str,
    ) -> Result<Self> {
        let program_name = program.to_string_lossy().into_owned();
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = match command.spawn() {
            Ok(child) => child,
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => {
                return Err(Error::EncoderNotFound { file, program: program_name });
            }
            Err(cause) => {
                let message = cause.to_string();
                return Err(Error::EncoderFailed { file, program: program_name, message, advice });
            }
        };
        let stdin = child.stdin.take();
        let stderr_reader = child.stderr.take().map(|pipe| thread::spawn(|| drain(pipe)));
        Ok(Self { file, program: program_name, advice, child, stdin, stderr_reader })
    }

    /// Writes the samples of one frame to the program.
    ///
    /// # Errors
    ///
    /// Fails with the program's own message if it does not accept the frame.
    pub fn write_frame(&mut self, samples: &[u8], progress: &dyn Progress) -> Result<()> {
        let Some(stdin) = &mut self.stdin else { return Ok(()) };
        match stdin.write_all(samples) {
            Ok(()) => Ok(()),
            Err(cause) => Err(self.failure(&cause.to_string(), progress)),
        }
    }

    /// Closes the input and waits until the program has written everything.
    ///
    /// # Errors
    ///
    /// Fails if the program fails or if `progress` cancels.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<()> {
        if self.wait(Duration::MAX, progress)?.success() {
            return Ok(());
        }
        Err(self.failure("it stopped before its work was done", progress))
    }

    /// Returns an error with the program's message, or with `cause` if it printed none; or the cancellation.
    fn failure(&mut self, cause: &str, progress: &dyn Progress) -> Error {
        let status = match self.wait(EXIT_TIMEOUT, progress) {
            Ok(status) => status,
            Err(error) => return error,
        };
        let messages = self.stderr_reader.take().and_then(|thread| thread.join().ok());
        let messages = messages.unwrap_or_default();
        let messages = String::from_utf8_lossy(&messages);
        let lines = messages.lines().map(str::trim).filter(|line| !line.is_empty());
        match lines.take(3).collect::<Vec<_>>().join(", ") {
            empty if empty.is_empty() => self.error(format!("{cause} ({status})")),
            message => self.error(message),
        }
    }

    /// Closes the input and waits for the program until `progress` cancels. A program that still runs after
    /// `timeout` is killed.
    fn wait(&mut self, timeout: Duration, progress: &dyn Progress) -> Result<ExitStatus> {
        drop(self.stdin.take());
        let start = Instant::now();
        loop {
            // The keys that cancel this work also end the program, so cancellation is checked first.
            progress.check()?;
            if let Some(status) = self.child.try_wait().map_err(|e| self.error(e.to_string()))? {
                return Ok(status);
            }
            if timeout < start.elapsed() {
                self.child.kill().map_err(|e| self.error(e.to_string()))?;
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    fn error(&self, message: String) -> Error {
        let (file, program) = (self.file.clone(), self.program.clone());
        Error::EncoderFailed { file, program, message, advice: self.advice }
    }
}

impl Drop for FfmpegProcess {
    fn drop(&mut self) {
        // Both fail only if the program has already exited. The thread that reads its messages exits with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the first 4096 bytes of `pipe`; reads the rest as well, so that its writer is not blocked, and
/// discards it.
fn drain(mut pipe: impl Read) -> Vec<u8> {
    let mut start = Vec::new();
    // A read error is no message; the exit status is reported instead.
    let _ = pipe.by_ref().take(4096).read_to_end(&mut start);
    let _ = io::copy(&mut pipe, &mut io::sink());
    start
}

#[cfg(all(test, unix))]
mod tests {
    //! Tests of the end of a process that would not end by itself.

    use std::fs;

    use surfel_core::progress::NoProgress;

    use super::*;

    #[test]
    fn cancelling_kills_a_program_that_never_exits() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let name = format!("surfel-ffmpeg-hangs-{}", std::process::id());
        let pid_file = std::env::temp_dir().join(name);
        let script = format!("echo $$ > '{}'; exec sleep 1000", pid_file.display());
        let arguments = ["-c".into(), script.into()];
        let mut process =
            FfmpegProcess::start("turn.mp4".into(), OsStr::new("sh"), &arguments, "").unwrap();
        while !fs::read_to_string(&pid_file).is_ok_and(|text| text.ends_with('\n')) {
            thread::sleep(POLL_INTERVAL);
        }
        process.write_frame(&[0; 8 * 8 * 3], &NoProgress).unwrap();
        let error = process.finish(&Cancelled).unwrap_err();
        assert!(matches!(error, Error::Core(surfel_core::Error::Cancelled)));
        let pid = fs::read_to_string(&pid_file).unwrap();
        fs::remove_file(&pid_file).unwrap();
        let probe = format!("kill -0 {}", pid.trim());
        let is_alive = Command::new("sh").args(["-c", &probe]).stderr(Stdio::null()).status();
        assert!(!is_alive.unwrap().success());
    }
}
