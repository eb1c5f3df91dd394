//! Video writer: the arguments of ffmpeg and the frames it receives.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};

use surfel_core::progress::{NoProgress, Progress};

use crate::error::Result;
use crate::file::write_temp;

use super::ffmpeg::FfmpegProcess;
use super::format::VideoContainer;
use super::spec::MovieSpec;

const CHECK_ADVICE: &str = "list the encoders of this ffmpeg with `ffmpeg -encoders`, or write .gif, .png or \
    frame_####.png, which need no other program";
const RESUME_ADVICE: &str =
    "the frames are kept: correct the cause, then continue from there [resume]";

/// Encodes one black frame and discards the result.
///
/// A missing program, a missing encoder and an unsupported size are thereby reported before the render.
pub(super) fn check(spec: &MovieSpec, container: VideoContainer, program: &OsStr) -> Result<()> {
    let null_output = ["-f", "null", "-"].map(OsString::from);
    let arguments = arguments(spec, container, &null_output);
    let mut encoder = FfmpegProcess::start(spec.file(), program, &arguments, CHECK_ADVICE)?;
    let (width, height) = spec.size();
    let black = vec![0; width as usize * height as usize * 3];
    encoder.write_frame(&pad_to_even(&black, spec.size()), &NoProgress)?;
    encoder.finish(&NoProgress)
}

/// Encodes all frames.
pub(super) fn write(
    spec: &MovieSpec,
    container: VideoContainer,
    program: &OsStr,
    progress: &dyn Progress,
) -> Result<()> {
    let n_frames = spec.options.n_frames;
    progress.begin(&format!("write {}", spec.file()), n_frames.into());
    write_temp(&spec.path, |aside, file| {
        // ffmpeg opens the file by its name. The explicit protocol allows a colon in that name.
        drop(file);
        let mut target = OsString::from("file:");
        target.push(aside);
        let arguments = arguments(spec, container, &["-f".into(), muxer(container).into(), target]);
        let mut encoder = FfmpegProcess::start(spec.file(), program, &arguments, RESUME_ADVICE)?;
        for frame in 0..n_frames {
            progress.check()?;
            let samples = spec.read_frame(frame)?;
            encoder.write_frame(&pad_to_even(&samples, spec.size()), progress)?;
            progress.advance(1);
        }
        encoder.finish(progress)
    })
}

fn arguments(spec: &MovieSpec, container: VideoContainer, output: &[OsString]) -> Vec<OsString> {
    let input = input_arguments(spec).into_iter().map(OsString::from);
    let codec = codec_arguments(container).into_iter().map(OsString::from);
    input.chain(codec).chain(output.iter().cloned()).collect()
}

fn input_arguments(spec: &MovieSpec) -> Vec<String> {
    let (width, height) = even_size(spec.size());
    let rate = format!("{}/{}", spec.rate.frames, spec.rate.seconds);
    let size = format!("{width}x{height}");
    let quiet = ["-hide_banner", "-loglevel", "error", "-y"];
    let raw = ["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", &size];
    let timed = ["-framerate", &rate, "-i", "pipe:0"];
    [&quiet[..], &raw, &timed].concat().into_iter().map(String::from).collect()
}

fn codec_arguments(container: VideoContainer) -> Vec<&'static str> {
    // Nearly visually lossless; at this quality, the fine grain of scans still takes less space than as GIF.
    let codec: &[&str] = match container {
        VideoContainer::Mp4 | VideoContainer::Mov => {
            &["-c:v", "libx264", "-crf", "18", "-movflags", "+faststart"]
        }
        VideoContainer::Mkv => &["-c:v", "libx264", "-crf", "18"],
        VideoContainer::Webm => &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"],
        VideoContainer::Avi => &["-c:v", "mpeg4", "-q:v", "2", "-tag:v", "xvid"],
    };
    // Today's players expect BT.709 at any size; by default ffmpeg converts as for older television.
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
    // Without dates and random numbers, the same frames give the same file.
    let deterministic = ["-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1"];
    [codec, &color, &deterministic].concat()
}

fn muxer(container: VideoContainer) -> &'static str {
    match container {
        VideoContainer::Mp4 => "mp4",
        VideoContainer::Mov => "mov",
        VideoContainer::Mkv => "matroska",
        VideoContainer::Webm => "webm",
        VideoContainer::Avi => "avi",
    }
}

/// Rounds both sides up to even numbers, which 4:2:0 chroma subsampling requires.
fn even_size((width, height): (u32, u32)) -> (u32, u32) {
    (width.next_multiple_of(2), height.next_multiple_of(2))
}

/// Repeats the last column and row of a frame where a side is odd.
fn pad_to_even(samples: &[u8], (width, height): (u32, u32)) -> Cow<'_, [u8]> {
    let (width, height) = (width as usize, height as usize);
    if width % 2 == 0 && height % 2 == 0 {
        return samples.into();
    }
    let rows = samples.chunks_exact(width * 3);
    let last_row = rows.clone().last().filter(|_| height % 2 == 1);
    let last_pixel = |row: &[u8]| if width % 2 == 1 { row.len() - 3 } else { row.len() };
    rows.chain(last_row).flat_map(|row| [row, &row[last_pixel(row)..]]).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    //! Tests of video output with scripts in place of ffmpeg.

    use std::fs;
    use std::path::PathBuf;

    use surfel_core::image::Image;

    use super::*;
    use crate::error::Error;
    use crate::image_file::{ImageOptions, save_image};
    use crate::movie::options::MovieOptions;

    /// A temporary folder with the frames of a movie, removed when dropped.
    struct TempMovie(PathBuf);

    impl TempMovie {
        fn new(test: &str, width: u32, height: u32, n_frames: u32) -> (Self, MovieSpec) {
            let folder =
                std::env::temp_dir().join(format!("surfel-video-{test}-{}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            let (image, fingerprint) = (ImageOptions::default(), String::new());
            let options = MovieOptions { width, height, fps: 25.0, n_frames, image, fingerprint };
            let spec = MovieSpec::new(&folder.join("turn.mp4"), &options).unwrap();
            fs::create_dir_all(&spec.names.folder).unwrap();
            for frame in 0..n_frames {
                let image = Image::new(width, height);
                save_image(&spec.names.path(frame), &image, &spec.options.image).unwrap();
            }
            (Self(folder), spec)
        }

        /// Creates an executable shell script with these commands.
        ///
        /// Another process writes the script: a file that is open for writing cannot be executed, and a test
        /// that starts a program in parallel could inherit and hold such a handle.
        #[cfg(unix)]
        fn script(&self, commands: &str) -> OsString {
            use std::process::Command;

            let path = self.0.join("program");
            let write = r#"printf '#!/bin/sh\n%s\n' "$1" > "$0" && chmod +x "$0""#;
            let status =
                Command::new("sh").args(["-c", write]).arg(&path).arg(commands).status().unwrap();
            assert!(status.success());
            path.into()
        }

        #[cfg(unix)]
        fn names(&self) -> Vec<String> {
            let entries = fs::read_dir(&self.0).unwrap();
            let name = |entry: fs::DirEntry| entry.file_name().into_string().unwrap();
            let mut names: Vec<_> = entries.map(|entry| name(entry.unwrap())).collect();
            names.sort();
            names
        }
    }

    impl Drop for TempMovie {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_missing_program_is_named_with_alternatives() {
        let (_movie, spec) = TempMovie::new("missing", 8, 8, 1);
        let program = OsStr::new("surfel-has-no-such-program");
        let error = check(&spec, VideoContainer::Mp4, program).unwrap_err();
        assert!(matches!(error, Error::EncoderNotFound { .. }));
        let message = error.to_string();
        for part in ["surfel-has-no-such-program", "ffmpeg.org", ".gif", ".png", "frame_####.png"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_failing_program_is_reported_and_the_old_movie_stays() {
        // A frame larger than the pipe buffer, so that writing to an exited program fails as well.
        let (movie, spec) = TempMovie::new("fails", 300, 200, 3);
        fs::write(&spec.path, "old").unwrap();
        let failing = [
            ("echo 'Unknown encoder' >&2; exit 1", "Unknown encoder"),
            ("cat >/dev/null; echo 'No space left' >&2; exit 1", "No space left"),
            ("exit 3", "exit status: 3"),
            // A program that fills standard error before it reads its input.
            ("yes 'too much' | head -c 1000000 >&2; exit 1", "too much"),
            ("echo closed >&2; exec <&-; exit 1", "closed"),
        ];
        for (commands, expected) in failing {
            let program = movie.script(commands);
            for error in [
                check(&spec, VideoContainer::Mp4, &program).unwrap_err(),
                write(&spec, VideoContainer::Mp4, &program, &NoProgress).unwrap_err(),
            ] {
                assert!(matches!(error, Error::EncoderFailed { .. }), "{commands}: {error}");
                assert!(error.to_string().contains(expected), "{commands}: {error}");
            }
            assert_eq!(fs::read_to_string(&spec.path).unwrap(), "old");
            assert_eq!(movie.names(), ["program", "turn.mp4", "turn.mp4.frames"]);
        }
    }

    #[cfg(unix)]
    #[test]
    fn the_output_becomes_the_movie_and_no_temporary_file_remains() {
        let (movie, spec) = TempMovie::new("writes", 3, 5, 2);
        // The last argument is the temporary output file.
        let program = movie.script(r#"for last; do :; done; cat > "${last#file:}""#);
        write(&spec, VideoContainer::Mp4, &program, &NoProgress).unwrap();
        assert_eq!(fs::read(&spec.path).unwrap(), [0; 2 * 4 * 6 * 3]);
        assert_eq!(movie.names(), ["program", "turn.mp4", "turn.mp4.frames"]);
    }

    #[test]
    fn odd_sides_repeat_their_last_pixels() {
        let pixel = |value: u8| [value; 3];
        let grid =
            |values: &[u8]| values.iter().flat_map(|&value| pixel(value)).collect::<Vec<_>>();
        let even_grid = grid(&[1, 2, 3, 4]);
        assert_eq!(*pad_to_even(&even_grid, (2, 2)), even_grid);
        assert_eq!(*pad_to_even(&grid(&[1, 2, 3]), (3, 1)), grid(&[1, 2, 3, 3, 1, 2, 3, 3]));
        assert_eq!(*pad_to_even(&grid(&[1, 2]), (1, 2)), grid(&[1, 1, 2, 2]));
        assert_eq!(*pad_to_even(&grid(&[7]), (1, 1)), grid(&[7; 4]));
    }
}
