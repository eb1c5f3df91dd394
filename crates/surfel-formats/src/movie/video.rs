//! Video: frames go raw into the standard input of ffmpeg, which does the rest.
//!
//! Linking an encoder would bring its patents, its C and its size; the program is on most machines.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::io::{self, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use surfel::progress::{Progress, Silent};

use crate::atomic::write_aside;
use crate::error::{Error, Result};

use super::format::Container;
use super::plan::Plan;

const BUILT_IN: &str = "see what this ffmpeg can do with `ffmpeg -encoders`, or write .gif, .png or \
    frame_####.png, which need no other program";
const KEPT: &str = "the frames are kept: mend this, then run again with --resume";

/// Has the program make a video of one black frame that goes nowhere.
///
/// So a missing program, a missing encoder and a size that the encoder refuses show before the work.
pub(super) fn check(plan: &Plan, container: Container, program: &OsStr) -> Result<()> {
    let nowhere = ["-f", "null", "-"].map(OsString::from);
    let mut encoder = Encoder::start(plan, container, program, &nowhere, BUILT_IN)?;
    let (width, height) = plan.size();
    encoder.add(&vec![0; width as usize * height as usize * 3], &Silent)?;
    encoder.finish(&Silent)
}

pub(super) fn write(
    plan: &Plan,
    container: Container,
    program: &OsStr,
    progress: &dyn Progress,
) -> Result<()> {
    let n_frames = plan.options.n_frames;
    progress.begin(&format!("write {}", plan.file()), n_frames.into());
    write_aside(&plan.path, |aside, file| {
        // The program opens it by its name. The protocol is named for names that have a colon in them.
        drop(file);
        let mut target = OsString::from("file:");
        target.push(aside);
        let output = ["-f".into(), muxer(container).into(), target];
        let mut encoder = Encoder::start(plan, container, program, &output, KEPT)?;
        for frame in 0..n_frames {
            progress.check()?;
            encoder.add(&plan.read_frame(frame)?, progress)?;
            progress.advance(1);
        }
        encoder.finish(progress)
    })
}

/// A run of the program; ended with this, if it has not ended by itself.
struct Encoder<'a> {
    plan: &'a Plan,
    program: &'a OsStr,
    advice: &'static str,
    child: Child,
    input: Option<ChildStdin>,
    /// Reads what the program has to say while it runs: it would wait for its reader.
    messages: Option<JoinHandle<Vec<u8>>>,
}

impl<'a> Encoder<'a> {
    fn start(
        plan: &'a Plan,
        container: Container,
        program: &'a OsStr,
        output: &[OsString],
        advice: &'static str,
    ) -> Result<Self> {
        let mut command = Command::new(program);
        command.args(input_arguments(plan)).args(codec_arguments(container)).args(output);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|cause| {
            let (file, program) = (plan.file(), program.to_string_lossy().into_owned());
            match cause.kind() {
                io::ErrorKind::NotFound => Error::NoEncoder { file, program },
                _ => Error::Encoder { file, program, message: cause.to_string(), advice },
            }
        })?;
        let input = child.stdin.take();
        let messages = child.stderr.take().map(|from| thread::spawn(|| read_start(from)));
        Ok(Self { plan, program, advice, child, input, messages })
    }

    /// Gives the program one frame; if it takes none, its message is the error.
    fn add(&mut self, samples: &[u8], progress: &dyn Progress) -> Result<()> {
        let samples = even(samples, self.plan.size());
        let Some(input) = &mut self.input else { return Ok(()) };
        match input.write_all(&samples) {
            Ok(()) => Ok(()),
            Err(cause) => Err(self.failure(&cause.to_string(), progress)),
        }
    }

    /// Waits until the program has written all.
    fn finish(mut self, progress: &dyn Progress) -> Result<()> {
        if self.wait(Duration::MAX, progress)?.success() {
            return Ok(());
        }
        Err(self.failure("it stopped before its work was done", progress))
    }

    /// What the program said, or `cause` if it said nothing; or that the user wanted it to end.
    fn failure(&mut self, cause: &str, progress: &dyn Progress) -> Error {
        let status = match self.wait(Duration::from_secs(5), progress) {
            Ok(status) => status,
            Err(error) => return error,
        };
        let messages = self.messages.take().and_then(|thread| thread.join().ok());
        let messages = messages.unwrap_or_default();
        let messages = String::from_utf8_lossy(&messages);
        let lines = messages.lines().map(str::trim).filter(|line| !line.is_empty());
        match lines.take(3).collect::<Vec<_>>().join(", ") {
            silence if silence.is_empty() => self.error(format!("{cause} ({status})")),
            said => self.error(said),
        }
    }

    /// Ends the input and waits for the program, but no longer than the user wants; one that has not
    /// ended after `patience` is ended.
    fn wait(&mut self, patience: Duration, progress: &dyn Progress) -> Result<ExitStatus> {
        drop(self.input.take());
        let start = Instant::now();
        loop {
            // Asked first: the keys that cancel this work also end the program.
            progress.check()?;
            if let Some(status) = self.child.try_wait().map_err(|e| self.error(e.to_string()))? {
                return Ok(status);
            }
            if patience < start.elapsed() {
                self.child.kill().map_err(|e| self.error(e.to_string()))?;
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn error(&self, message: String) -> Error {
        let (file, program) = (self.plan.file(), self.program.to_string_lossy().into_owned());
        Error::Encoder { file, program, message, advice: self.advice }
    }
}

impl Drop for Encoder<'_> {
    fn drop(&mut self) {
        // Both fail only where it has ended already. The reader of its messages ends with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn input_arguments(plan: &Plan) -> Vec<String> {
    let (width, height) = even_size(plan.size());
    let rate = format!("{}/{}", plan.rate.frames, plan.rate.seconds);
    let size = format!("{width}x{height}");
    let quiet = ["-hide_banner", "-loglevel", "error", "-y"];
    let raw = ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", &size];
    let timed = ["-framerate", &rate, "-i", "pipe:0"];
    [&quiet[..], &raw, &timed].concat().into_iter().map(String::from).collect()
}

fn codec_arguments(container: Container) -> Vec<&'static str> {
    // Nearly without visible loss, at which scans with their fine grain still get smaller than as GIF.
    let codec: &[&str] = match container {
        Container::Mp4 | Container::Mov => {
            &["-c:v", "libx264", "-crf", "18", "-movflags", "+faststart"]
        }
        Container::Mkv => &["-c:v", "libx264", "-crf", "18"],
        Container::Webm => &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"],
        Container::Avi => &["-c:v", "mpeg4", "-q:v", "2", "-tag:v", "xvid"],
    };
    // What players expect of video of any size today; unless told, ffmpeg converts as for old television.
    let color = [
        "-vf",
        "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd",
        "-pix_fmt",
        "yuv420p",
        "-colorspace",
        "bt709",
        "-color_primaries",
        "bt709",
        "-color_trc",
        "iec61966-2-1",
        "-color_range",
        "tv",
    ];
    // Neither dates nor random numbers: the same frames give the same file.
    let plain = ["-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1"];
    [codec, &color, &plain].concat()
}

fn muxer(container: Container) -> &'static str {
    match container {
        Container::Mp4 => "mp4",
        Container::Mov => "mov",
        Container::Mkv => "matroska",
        Container::Webm => "webm",
        Container::Avi => "avi",
    }
}

/// Colours of 2x2 pixels are stored together, so both sides must be even.
fn even_size((width, height): (u32, u32)) -> (u32, u32) {
    (width.next_multiple_of(2), height.next_multiple_of(2))
}

/// The frame with its last column and row repeated where a side is odd, so that nothing is lost.
fn even(samples: &[u8], (width, height): (u32, u32)) -> Cow<'_, [u8]> {
    let (width, height) = (width as usize, height as usize);
    if width % 2 == 0 && height % 2 == 0 {
        return samples.into();
    }
    let rows = samples.chunks_exact(width * 3);
    let last_row = rows.clone().last().filter(|_| height % 2 == 1);
    let last_pixel = |row: &[u8]| if width % 2 == 1 { row.len() - 3 } else { row.len() };
    rows.chain(last_row).flat_map(|row| [row, &row[last_pixel(row)..]]).flatten().copied().collect()
}

/// The first messages; the others are read too, so that their writer need not wait, and forgotten.
fn read_start(mut from: impl Read) -> Vec<u8> {
    let mut start = Vec::new();
    // A pipe that cannot be read says nothing; how the program ended will be told then.
    let _ = from.by_ref().take(4096).read_to_end(&mut start);
    let _ = io::copy(&mut from, &mut io::sink());
    start
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use surfel::image::Image;

    use super::*;
    use crate::movie::MovieOptions;
    use crate::picture::{ImageOptions, save_image};

    /// A folder with a film's frames; removed at the end.
    struct Scratch(PathBuf);

    impl Scratch {
        fn new(test: &str, width: u32, height: u32, n_frames: u32) -> (Self, Plan) {
            let folder =
                std::env::temp_dir().join(format!("surfel-video-{test}-{}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            let (image, fingerprint) = (ImageOptions::default(), String::new());
            let options = MovieOptions { width, height, fps: 25.0, n_frames, image, fingerprint };
            let plan = Plan::new(&folder.join("film.mp4"), &options).unwrap();
            fs::create_dir_all(&plan.names.folder).unwrap();
            for frame in 0..n_frames {
                let image = Image::new(width, height);
                save_image(&plan.names.path(frame), &image, &plan.options.image).unwrap();
            }
            (Self(folder), plan)
        }

        /// A program of these commands of the shell.
        ///
        /// Written by another process: while a file is open for writing here, it cannot be run, and a
        /// test beside this one that starts a program would hold it open a little longer.
        #[cfg(unix)]
        fn program(&self, commands: &str) -> OsString {
            let path = self.0.join("program");
            let write = r#"printf '#!/bin/sh\n%s\n' "$1" > "$0" && chmod +x "$0""#;
            let status =
                Command::new("sh").args(["-c", write]).arg(&path).arg(commands).status().unwrap();
            assert!(status.success());
            path.into()
        }

        fn names(&self) -> Vec<String> {
            let entries = fs::read_dir(&self.0).unwrap();
            let name = |entry: fs::DirEntry| entry.file_name().into_string().unwrap();
            let mut names: Vec<_> = entries.map(|entry| name(entry.unwrap())).collect();
            names.sort();
            names
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_missing_program_is_named_with_its_remedies() {
        let (_scratch, plan) = Scratch::new("missing", 8, 8, 1);
        let program = OsStr::new("surfel-has-no-such-program");
        let error = check(&plan, Container::Mp4, program).unwrap_err();
        assert!(matches!(error, Error::NoEncoder { .. }));
        let message = error.to_string();
        for part in ["surfel-has-no-such-program", "ffmpeg.org", ".gif", ".png", "frame_####.png"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_fails_gives_its_message_and_the_old_film_stays() {
        // Larger than a pipe's buffer, so that writing to the dead program fails too.
        let (scratch, plan) = Scratch::new("fails", 300, 200, 3);
        fs::write(&plan.path, "old").unwrap();
        let failing = [
            ("echo 'Unknown encoder' >&2; exit 1", "Unknown encoder"),
            ("cat >/dev/null; echo 'No space left' >&2; exit 1", "No space left"),
            ("exit 3", "exit status: 3"),
            // Much to say, and no ear before it is said.
            ("yes 'too much' | head -c 1000000 >&2; exit 1", "too much"),
            ("exec <&-; echo deaf >&2; exit 1", "deaf"),
        ];
        for (commands, expected) in failing {
            let program = scratch.program(commands);
            for error in [
                check(&plan, Container::Mp4, &program).unwrap_err(),
                write(&plan, Container::Mp4, &program, &Silent).unwrap_err(),
            ] {
                assert!(matches!(error, Error::Encoder { .. }), "{commands}: {error}");
                assert!(error.to_string().contains(expected), "{commands}: {error}");
            }
            assert_eq!(fs::read_to_string(&plan.path).unwrap(), "old");
            assert_eq!(scratch.names(), ["film.mp4", "film.mp4.frames", "program"]);
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_never_ends_is_ended_with_the_work() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let (scratch, plan) = Scratch::new("hangs", 8, 8, 1);
        let pid = scratch.0.join("pid");
        let program = scratch.program(&format!("echo $$ > '{}'; exec sleep 1000", pid.display()));
        let mut encoder = Encoder::start(&plan, Container::Mp4, &program, &[], KEPT).unwrap();
        while !fs::read_to_string(&pid).is_ok_and(|text| text.ends_with('\n')) {
            thread::sleep(Duration::from_millis(5));
        }
        encoder.add(&[0; 8 * 8 * 3], &Silent).unwrap();
        let error = encoder.finish(&Cancelled).unwrap_err();
        assert!(matches!(error, Error::Surfel(surfel::Error::Cancelled)));
        let pid = fs::read_to_string(&pid).unwrap();
        let ask = format!("kill -0 {}", pid.trim());
        let is_alive = Command::new("sh").args(["-c", &ask]).stderr(Stdio::null()).status();
        assert!(!is_alive.unwrap().success());
    }

    #[cfg(unix)]
    #[test]
    fn the_film_is_what_the_program_wrote_and_nothing_is_left_beside_it() {
        let (scratch, plan) = Scratch::new("writes", 3, 5, 2);
        // The last argument is the name aside.
        let program = scratch.program(r#"for last; do :; done; cat > "${last#file:}""#);
        write(&plan, Container::Mp4, &program, &Silent).unwrap();
        assert_eq!(fs::read(&plan.path).unwrap(), [0; 2 * 4 * 6 * 3]);
        assert_eq!(scratch.names(), ["film.mp4", "film.mp4.frames", "program"]);
    }

    #[test]
    fn odd_sides_repeat_their_last_pixels() {
        let pixel = |value: u8| [value; 3];
        let grid =
            |values: &[u8]| values.iter().flat_map(|&value| pixel(value)).collect::<Vec<_>>();
        let even_grid = grid(&[1, 2, 3, 4]);
        assert_eq!(*even(&even_grid, (2, 2)), even_grid);
        assert_eq!(*even(&grid(&[1, 2, 3]), (3, 1)), grid(&[1, 2, 3, 3, 1, 2, 3, 3]));
        assert_eq!(*even(&grid(&[1, 2]), (1, 2)), grid(&[1, 1, 2, 2]));
        assert_eq!(*even(&grid(&[7]), (1, 1)), grid(&[7; 4]));
    }
}
