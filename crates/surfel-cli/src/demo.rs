//! `surfel demo`: scans a ruin, writes the cloud, and renders it as a user would.

use crate::args::Global;
use crate::gallery;
use crate::report::{Report, print};
use crate::scene_file::Line;
use crate::shell::quoted;
use anyhow::Context;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::math::DVec3;
use surfel::scanner::ruin;
use surfel_formats::SaveOptions;

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Folder for demo.laz and demo.png; made if it does not exist.
    #[arg(short, long, value_name = "FOLDER", default_value = ".")]
    output: PathBuf,
    /// Points of the scan, about.
    #[arg(long, value_name = "N", default_value_t = 2_500_000,
        value_parser = clap::value_parser!(u64).range(1000..=100_000_000))]
    points: u64,
    /// Then put glass, a mirror and a mesh into the ruin, and make a picture and a film of that, too.
    #[arg(long)]
    gallery: bool,
}

const EXAMPLES: &str = "\
Examples:
  surfel demo                                   demo.laz and demo.png in this folder
  surfel demo -o /tmp/ruin --points 5000000     twice the points, elsewhere
  surfel demo --gallery                         also glass, a mirror, a mesh, and a film of them";

/// A clear sky, and a sun that lights the front and throws the columns' shadows over the floor.
const LIGHT: [&str; 6] =
    ["--sun-azimuth", "190", "--sun-elevation", "32", "--background", "#4f7fb8,#d5e2ee"];

pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let start = Instant::now();
    let folder = &args.output;
    fs::create_dir_all(folder)
        .with_context(|| format!("{}: the folder cannot be made", folder.display()))?;
    let (cloud_path, picture_path) = (folder.join("demo.laz"), folder.join("demo.png"));
    let cloud = ruin::scan(args.points as usize, report)?;
    let options = SaveOptions {
        resolution: Some(DVec3::splat(0.001)),
        coordinate_system: Some("EPSG:32634".into()),
    };
    surfel_formats::save(&cloud_path, &cloud, &options, report)?;
    report.end_stage();
    let n_points = cloud.len();
    drop(cloud);

    let mut words = ["surfel", "render"].map(str::to_owned).to_vec();
    words.extend([
        cloud_path.display().to_string(),
        "-o".into(),
        picture_path.display().to_string(),
    ]);
    words.extend(camera_words());
    words.extend(LIGHT.map(str::to_owned));
    let (cli, line) = Line::parse(words.iter().map(OsString::from).collect())?;
    crate::run_command(&cli.command, &line, global, report)?;
    tell(&cloud_path, &words, n_points, start)?;
    if args.gallery {
        make_gallery(folder, global, report)?;
    }
    Ok(())
}

/// gallery.png and gallery.gif, each as a user would make it.
fn make_gallery(folder: &Path, global: &Global, report: &Report) -> anyhow::Result<()> {
    gallery::write(folder, report)?;
    let scene = folder.join("gallery.toml").display().to_string();
    let picture = folder.join("gallery.png").display().to_string();
    let film = folder.join("gallery.gif").display().to_string();
    let mut lines = Vec::new();
    for (command, output, options) in [
        ("render", &picture, &["--spp", "16"][..]),
        ("animate", &film, &["--fps", "10", "--resolution", "480x270", "--spp", "2"]),
    ] {
        let mut words = vec!["surfel", command, &scene, "-o", output];
        words.extend(options);
        lines.push(words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "));
        let (cli, line) = Line::parse(words.into_iter().map(OsString::from).collect())?;
        crate::run_command(&cli.command, &line, global, report)?;
    }
    print(&format!("The gallery was made by\n  {}", lines.join("\n  ")))?;
    Ok(())
}

/// The ruin's own view as options.
fn camera_words() -> Vec<String> {
    let ruin::View { eye, target, vertical_fov_deg } = ruin::view();
    let vector = |p: DVec3| (ruin::UTM_ORIGIN + p).to_array().map(|x| x.to_string()).join(",");
    vec![
        "--resolution".into(),
        "1280x720".into(),
        "--camera-position".into(),
        vector(eye),
        "--camera-focal-point".into(),
        vector(target),
        "--camera-view-angle".into(),
        vertical_fov_deg.to_string(),
    ]
}

fn tell(cloud: &Path, words: &[String], n_points: usize, start: Instant) -> anyhow::Result<()> {
    let cloud = quoted(&cloud.display().to_string());
    print(&format!(
        "A virtual scanner measured a ruin from six stations: {n_points} points, in {cloud}.\n\
         The picture was made from that file, all in {:.0} s, by\n  {}\n\
         Try next:\n  \
         surfel view {cloud}\n  \
         surfel info {cloud}\n  \
         surfel render {cloud} -o front.png\n  \
         surfel render {cloud} -o map.png --camera-direction 0,0,-1 --camera-orthographic\n  \
         surfel render {cloud} -o classes.png --color class --light sky\n  \
         surfel render {cloud} -o points.png --surface points",
        start.elapsed().as_secs_f64(),
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "),
    ))?;
    Ok(())
}
