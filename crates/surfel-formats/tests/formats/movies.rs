//! Movies from complete and interrupted runs, read back by format crates and by ffmpeg.

use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use surfel_core::image::{Image, decode_srgb};
use surfel_core::progress::NoProgress;
use surfel_formats::{
    Alpha, BitDepth, Error, ImageOptions, Movie, MovieOptions, check_movie, save_image,
};

use crate::common::{Folder, Listener};
use crate::skipped::report_skipped;

/// Returns the 8-bit sRGB colour of a pixel: a smooth gradient of more than 256 colours that changes per frame.
fn color_at(frame: u32, x: u32, y: u32) -> [u8; 3] {
    [(40 + x) as u8, (60 + y * 2) as u8, (30 + frame * 40) as u8]
}

fn picture(options: &MovieOptions, frame: u32) -> Image {
    let mut image = Image::new(options.width, options.height);
    for (pixel, color) in image.color.iter_mut().enumerate() {
        let (x, y) = (pixel as u32 % options.width, pixel as u32 / options.width);
        let [r, g, b] =
            color_at(frame, x, y).map(|channel| decode_srgb(f32::from(channel) / 255.0));
        *color = [r, g, b, 1.0];
    }
    image
}

fn options() -> MovieOptions {
    MovieOptions {
        width: 48,
        height: 32,
        fps: 30.0,
        n_frames: 5,
        image: ImageOptions::default(),
        fingerprint: "church\nturntable".into(),
    }
}

/// Adds at most `max` missing frames and returns their indices.
fn add_missing(movie: &mut Movie, options: &MovieOptions, max: usize) -> Vec<u32> {
    let missing = (0..options.n_frames).filter(|&frame| !movie.has_frame(frame));
    let missing: Vec<u32> = missing.take(max).collect();
    for &frame in &missing {
        movie.add_frame(frame, &picture(options, frame)).unwrap();
    }
    missing
}

fn write_movie(path: &Path, options: &MovieOptions) {
    let mut movie = Movie::open(path, options, false).unwrap();
    add_missing(&mut movie, options, usize::MAX);
    movie.finish(&NoProgress).unwrap();
}

/// Returns true if ffmpeg is installed; otherwise prints that the test is skipped.
fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).status().is_ok();
    if !found {
        report_skipped("ffmpeg is absent");
    }
    found
}

fn bytes_of(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let mut names = folder.names();
    names.sort();
    names.into_iter().map(|name| (name.clone(), fs::read(folder.path(&name)).unwrap())).collect()
}

#[test]
fn animated_png_is_lossless() {
    let folder = Folder::new("apng");
    for (depth, alpha, fps, delay) in [
        (BitDepth::Eight, Alpha::Keep, 30.0, (1, 30)),
        (BitDepth::Eight, Alpha::Drop, 23.976, (125, 2997)),
        (BitDepth::Sixteen, Alpha::Keep, 0.5, (2, 1)),
    ] {
        let path = folder.path("movie.png");
        let image = ImageOptions { depth, alpha, ..Default::default() };
        let options = MovieOptions { image, fps, ..options() };
        write_movie(&path, &options);

        let decoder = png::Decoder::new(BufReader::new(fs::File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (5, 0));
        let mut samples = vec![0; reader.output_buffer_size().unwrap()];
        for frame in 0..options.n_frames {
            reader.next_frame(&mut samples).unwrap();
            let control = reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), delay);
            assert_eq!(samples, still_samples(&folder.path("still.png"), &options, frame));
        }
    }
    assert_eq!(folder.names().len(), 2);
}

/// Returns the samples of a frame that is saved as a single image.
fn still_samples(path: &Path, options: &MovieOptions, frame: u32) -> Vec<u8> {
    save_image(path, &picture(options, frame), &options.image).unwrap();
    let mut reader =
        png::Decoder::new(BufReader::new(fs::File::open(path).unwrap())).read_info().unwrap();
    let mut samples = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut samples).unwrap();
    samples
}

#[test]
fn gif_frames_have_accurate_times_and_colours() {
    let folder = Folder::new("gif");
    let path = folder.path("movie.GIF");
    let options = MovieOptions { width: 128, height: 96, n_frames: 6, ..options() };
    write_movie(&path, &options);

    let mut decoding = gif::DecodeOptions::new();
    decoding.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = decoding.read_info(fs::File::open(&path).unwrap()).unwrap();
    assert_eq!((decoder.width(), decoder.height()), (128, 96));
    let (mut delays, mut sum) = (Vec::new(), 0);
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        for (pixel, found) in frame.buffer.chunks_exact(4).enumerate() {
            let expected = color_at(delays.len() as u32, pixel as u32 % 128, pixel as u32 / 128);
            for (found, expected) in found.iter().zip(expected) {
                let difference = found.abs_diff(expected);
                assert!(difference <= 32, "{pixel}: {found} for {expected}");
                sum += usize::from(difference);
            }
            assert_eq!(found[3], 255);
        }
        delays.push(frame.delay);
    }
    // About ten thousand colours share a palette of 256.
    let mean = sum as f64 / (delays.len() * 128 * 96 * 3) as f64;
    assert!(mean < 4.0, "{mean}");
    // The delays sum to exactly 0.2 s, although 1/30 s is not a multiple of 0.01 s.
    assert_eq!(delays, [3, 4, 3, 3, 4, 3]);
    assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
    assert_eq!(folder.names(), ["movie.GIF"]);
}

#[test]
fn frame_numbers_have_as_many_digits_as_the_pattern() {
    let folder = Folder::new("numbered");
    let options = MovieOptions { n_frames: 11, ..options() };
    write_movie(&folder.path("shot#2_###.png"), &options);
    write_movie(&folder.path("#.exr"), &options);
    let mut expected: Vec<String> = (1..=11).map(|i| format!("shot#2_{i:03}.png")).collect();
    expected.extend((1..=11).map(|i| format!("{i}.exr")));
    expected.sort();
    let mut names = folder.names();
    names.sort();
    assert_eq!(names, expected);
    let still = folder.path("still.png");
    save_image(&still, &picture(&options, 4), &options.image).unwrap();
    assert_eq!(fs::read(folder.path("shot#2_005.png")).unwrap(), fs::read(&still).unwrap());
}

#[test]
fn a_resumed_run_gives_the_same_bytes() {
    check_resumed_movies(&["movie.png", "movie.gif", "frame_####.png", "frame_##.exr"]);
}

#[test]
fn a_resumed_video_gives_the_same_bytes() {
    if has_ffmpeg() {
        check_resumed_movies(&["movie.mp4", "movie.mov", "movie.mkv", "movie.webm", "movie.avi"]);
    }
}

fn check_resumed_movies(names: &[&str]) {
    for name in names {
        let (whole, resumed) = (Folder::new(&format!("whole-{name}")), Folder::new(name));
        let options = options();
        write_movie(&whole.path(name), &options);

        let path = resumed.path(name);
        let mut movie = Movie::open(&path, &options, true).unwrap();
        assert_eq!(add_missing(&mut movie, &options, 2), [0, 1]);
        drop(movie);
        let mut movie = Movie::open(&path, &options, true).unwrap();
        assert_eq!(movie.n_done(), 2);
        movie.add_frame(4, &picture(&options, 4)).unwrap();
        let error = movie.finish(&NoProgress).unwrap_err().to_string();
        assert!(error.contains("3 of 5 frames"), "{error}");
        let mut movie = Movie::open(&path, &options, true).unwrap();
        assert_eq!(add_missing(&mut movie, &options, 9), [2, 3]);
        movie.finish(&NoProgress).unwrap();
        assert_eq!(bytes_of(&resumed), bytes_of(&whole), "{name}");
    }
}

#[test]
fn frames_with_other_settings_are_not_reused() {
    for name in ["movie.gif", "frame_####.png"] {
        let folder = Folder::new(&format!("settings-{name}"));
        let (path, first) = (folder.path(name), options());
        let mut movie = Movie::open(&path, &first, true).unwrap();
        add_missing(&mut movie, &first, 2);
        drop(movie);

        let (other, larger) = ("other church".into(), 64);
        for changed in [
            MovieOptions { fingerprint: other, ..options() },
            MovieOptions { width: larger, ..options() },
            MovieOptions { n_frames: 6, ..options() },
        ] {
            let Err(error) = Movie::open(&path, &changed, true) else { panic!("{name}: reused") };
            assert!(matches!(error, Error::ResumeMismatch { .. }), "{error}");
            assert!(
                error.to_string().contains("start again instead of resuming [resume]"),
                "{error}"
            );
        }
        // The rejected attempts keep the frames, and the frame rate does not affect frames.
        let faster = MovieOptions { fps: 50.0, ..options() };
        assert_eq!(Movie::open(&path, &faster, true).unwrap().n_done(), 2);
        assert_eq!(Movie::open(&path, &first, false).unwrap().n_done(), 0);
        assert_eq!(Movie::open(&path, &first, true).unwrap().n_done(), 0);
    }
}

#[test]
fn images_of_an_older_movie_do_not_count_as_done() {
    let folder = Folder::new("stale");
    let (path, older) = (folder.path("frame_##.png"), options());
    write_movie(&path, &older);
    let newer = MovieOptions { fingerprint: "later".into(), ..options() };
    let mut movie = Movie::open(&path, &newer, false).unwrap();
    add_missing(&mut movie, &newer, 1);
    drop(movie);
    assert_eq!(folder.names().len(), 6);
    let movie = Movie::open(&path, &newer, true).unwrap();
    assert!(movie.has_frame(0) && !movie.has_frame(1));
    drop(movie);
    // A frame whose image was removed does not count either.
    fs::remove_file(folder.path("frame_01.png")).unwrap();
    assert_eq!(Movie::open(&path, &newer, true).unwrap().n_done(), 0);
}

#[test]
fn a_truncated_log_line_does_not_count() {
    let folder = Folder::new("torn");
    let (path, options) = (folder.path("movie.gif"), options());
    let mut movie = Movie::open(&path, &options, false).unwrap();
    add_missing(&mut movie, &options, 3);
    drop(movie);
    let note = folder.path("movie.gif.frames/settings");
    let text = fs::read_to_string(&note).unwrap();
    let settings = text.lines().next().unwrap();
    for (frames, n_done) in [("1\n2", 1), ("1\n\n0\n-1\n99999999999\nx\n3\n", 2), ("", 0)] {
        fs::write(&note, format!("{settings}\n{frames}")).unwrap();
        let movie = Movie::open(&path, &options, true).unwrap();
        assert_eq!(movie.n_done(), n_done);
        // Without `drop`, the files survive the empty log of the last case.
        std::mem::forget(movie);
    }
}

#[test]
fn a_movie_without_frames_leaves_no_files() {
    for name in ["movie.png", "frame_####.exr"] {
        let folder = Folder::new(&format!("nothing-{name}"));
        drop(Movie::open(&folder.path(name), &options(), false).unwrap());
        assert_eq!(folder.names(), [""; 0]);
    }
}

#[test]
fn foreign_files_are_never_removed() {
    let folder = Folder::new("foreign");
    let (path, options) = (folder.path("movie.gif"), options());
    let frames = folder.path("movie.gif.frames");
    let refused = || match Movie::open(&path, &options, false) {
        Err(Error::InvalidFrames { found, .. }) => found,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("accepted a foreign folder"),
    };
    fs::write(&frames, "a file").unwrap();
    assert_eq!(refused(), "a file");
    fs::remove_file(&frames).unwrap();
    fs::create_dir(&frames).unwrap();
    fs::write(frames.join("000001.png"), "mine").unwrap();
    assert_eq!(refused(), "files without surfel's `settings`");
    fs::remove_file(frames.join("000001.png")).unwrap();

    let mut movie = Movie::open(&path, &options, false).unwrap();
    fs::write(frames.join("remarks.txt"), "mine").unwrap();
    add_missing(&mut movie, &options, 9);
    movie.finish(&NoProgress).unwrap();
    let left: Vec<PathBuf> =
        fs::read_dir(&frames).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(left, [frames.join("remarks.txt")]);
}

#[test]
fn a_malformed_frame_is_reported_and_can_be_rendered_again() {
    for name in ["movie.gif", "movie.png"] {
        let folder = Folder::new(&format!("broken-{name}"));
        let (path, options) = (folder.path(name), options());
        fs::write(&path, "old").unwrap();
        let broken = folder.path(&format!("{name}.frames/000003.png"));
        let small = folder.path("small.png");
        save_image(&small, &Image::new(3, 3), &options.image).unwrap();
        let small_bytes = fs::read(&small).unwrap();
        fs::remove_file(&small).unwrap();
        // Truncated, empty, and of another size.
        for bytes in [&small_bytes[..small_bytes.len() / 2], &[], &small_bytes] {
            let mut movie = Movie::open(&path, &options, true).unwrap();
            add_missing(&mut movie, &options, 9);
            fs::write(&broken, bytes).unwrap();
            let error = movie.finish(&NoProgress).unwrap_err().to_string();
            assert!(error.contains("000003.png: found"), "{error}");
            assert_eq!(fs::read_to_string(&path).unwrap(), "old");
            fs::remove_file(&broken).unwrap();
        }
        let mut movie = Movie::open(&path, &options, true).unwrap();
        assert_eq!(add_missing(&mut movie, &options, 9), [2]);
        movie.finish(&NoProgress).unwrap();
        assert_eq!(folder.names(), [name]);
    }
}

#[test]
fn cancelling_finish_keeps_the_frames_and_the_old_movie() {
    let folder = Folder::new("cancelled");
    let (path, options) = (folder.path("movie.gif"), options());
    fs::write(&path, "old").unwrap();
    let mut movie = Movie::open(&path, &options, false).unwrap();
    add_missing(&mut movie, &options, 9);
    let listener = Listener { cancelled: true.into(), ..Default::default() };
    let error = movie.finish(&listener).unwrap_err();
    assert!(matches!(error, Error::Core(surfel_core::Error::Cancelled)));
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    let movie = Movie::open(&path, &options, true).unwrap();
    assert_eq!(movie.n_done(), 5);
    movie.finish(&NoProgress).unwrap();
    assert_eq!(folder.names(), ["movie.gif"]);
}

#[test]
fn frames_of_another_index_or_size_are_rejected() {
    let folder = Folder::new("unannounced");
    let options = options();
    let mut movie = Movie::open(&folder.path("movie.gif"), &options, false).unwrap();
    for (frame, width) in [(5, 48), (0, 47)] {
        let error = movie.add_frame(frame, &Image::new(width, 32)).unwrap_err().to_string();
        assert!(error.contains("expected frames 0 to 4 of 48x32"), "{error}");
    }
    assert_eq!(movie.n_done(), 0);
}

#[test]
fn check_movie_rejects_unwritable_movies() {
    let folder = Folder::new("movies-early");
    let message = |name: &str, options: &MovieOptions| {
        check_movie(&folder.path(name), options).unwrap_err().to_string()
    };
    for name in ["movie.mpg", "movie", "movie.exr", "####", "frame_####.jpg", "-"] {
        let message = message(name, &options());
        for part in ["cannot write", ".mp4", ".gif", ".png (animated)", "frame_####.exr"] {
            assert!(message.contains(part), "{message}");
        }
    }
    assert!(message("none/movie.gif", &options()).contains("create it first"));
    assert!(message("none/frame_####.png", &options()).contains("create it first"));
    fs::create_dir(folder.path("folder.gif")).unwrap();
    assert!(message("folder.gif", &options()).contains("name a file, not a folder"));
    let fast = MovieOptions { fps: 60.0, ..options() };
    assert!(message("movie.gif", &fast).contains("at most 50 times a second"));
    check_movie(&folder.path("movie.png"), &fast).unwrap();
    for fps in [0.0, -30.0, f64::NAN, f64::INFINITY, 1e-9, 1e9] {
        let options = MovieOptions { fps, ..options() };
        assert!(message("movie.png", &options).contains("frames a second"));
    }
    for (name, width, n_frames) in [
        ("movie.png", 0, 1),
        ("movie.gif", 65536, 1),
        ("a_#.png", 1 << 31, 1),
        ("a_#.exr", 2_000_000, 1),
        ("a_#.png", 1, 0),
    ] {
        let options = MovieOptions { width, n_frames, ..options() };
        assert!(message(name, &options).contains("choose"));
    }
    assert_eq!(folder.names(), ["folder.gif"]);
}

#[test]
fn no_memory_is_taken_for_frames_of_more_pixels_than_pictures_have() {
    let folder = Folder::new("movies-huge");
    let side = (1 << 31) - 1;
    for (name, width, height) in
        [("a.mp4", side, side), ("a.png", side, side), ("a.webm", 1 << 14, (1 << 14) + 1)]
    {
        let options = MovieOptions { width, height, ..options() };
        let path = folder.path(name);
        let message = check_movie(&path, &options).unwrap_err().to_string();
        assert!(message.contains("at most 2^28 pixels"), "{message}");
        assert!(Movie::open(&path, &options, false).is_err());
    }
    assert_eq!(folder.names(), [""; 0]);
}

#[test]
fn ffmpeg_encodes_every_video_format() {
    if !has_ffmpeg() {
        return;
    }
    let folder = Folder::new("ffmpeg");
    // ffmpeg interprets a colon as a protocol separator and a percent sign as a number placeholder.
    let odd = if cfg!(windows) { "a%d.mov" } else { "a:%d.mov" };
    for name in ["movie.mp4", odd, "-movie.mkv", "movie.webm", "movie.avi"] {
        for (width, height) in [(48, 32), (47, 31)] {
            let path = folder.path(name);
            let options = MovieOptions { width, height, fps: 29.97, ..options() };
            write_movie(&path, &options);
            let found = decode(&path);
            assert_eq!(found.len(), 5 * 48 * 32 * 3, "{name}");
            for (index, (found, pixel)) in found.chunks_exact(3).zip(0..).enumerate() {
                let (frame, pixel) = (pixel / (48 * 32), pixel % (48 * 32));
                let (x, y) = ((pixel % 48).min(width - 1), (pixel / 48).min(height - 1));
                for (found, expected) in found.iter().zip(color_at(frame, x, y)) {
                    assert!(found.abs_diff(expected) <= 12, "{name} {index}: {found} {expected}");
                }
            }
        }
    }
    assert_eq!(folder.names().len(), 5);
}

/// Decodes the frames with ffmpeg to 8-bit RGB, using the colour space that the file declares.
fn decode(path: &Path) -> Vec<u8> {
    let mut input = std::ffi::OsString::from("file:");
    input.push(path);
    let decoded = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-i"])
        .arg(input)
        .args(["-vf", "scale=in_color_matrix=bt709", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(decoded.status.success(), "{}", String::from_utf8_lossy(&decoded.stderr));
    decoded.stdout
}

#[test]
fn check_movie_rejects_sizes_that_ffmpeg_does_not_support() {
    if !has_ffmpeg() {
        return;
    }
    let folder = Folder::new("refused-size");
    let options = MovieOptions { width: 20_000, height: 2, ..options() };
    let error = check_movie(&folder.path("movie.mp4"), &options).unwrap_err();
    assert!(matches!(error, Error::EncoderFailed { .. }), "{error}");
    assert_eq!(folder.names(), [""; 0]);
}
