//! `surfel demo`: scans a ruin, writes the cloud, and renders it as a user would.

use crate::animate::animate_description;
use crate::gallery;
use crate::global::Global;
use crate::render::render_to_file;
use crate::report::{Report, print};
use crate::shell::{command_line, quoted};
use anyhow::Context;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfel::SceneDescription;
use surfel::description::RunSettings;
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;
use surfel_formats::SaveOptions;
use surfel_scanner::ruin;
use surfel_scanner::scenes::SceneView;

/// Arguments of `surfel demo`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Folder for demo.laz and demo.png; it is created if it does not exist.
    #[arg(short, long, value_name = "FOLDER", default_value = ".")]
    output: PathBuf,
    /// Approximate number of points of the scan.
    #[arg(long, value_name = "N", default_value_t = 2_500_000,
        value_parser = clap::value_parser!(u64).range(1000..=100_000_000))]
    points: u64,
    /// Also puts glass, a mirror and a mesh into the ruin, and makes a picture and a movie of it.
    #[arg(long)]
    gallery: bool,
}

const EXAMPLES: &str = "\
Examples:
  surfel demo                                   demo.laz and demo.png in this folder
  surfel demo -o /tmp/ruin --points 5000000     twice the points, elsewhere
  surfel demo --gallery                         also glass, a mirror, a mesh, and a movie of them";

/// A clear sky, a sun that lights the front and throws the columns' shadows over the floor, and front sides, by which
/// slits are closed.
const SETTINGS: [(&str, &str); 4] = [
    ("sun.azimuth", "190"),
    ("sun.elevation", "32"),
    ("background", "#4f7fb8,#d5e2ee"),
    ("orient", "mst"),
];

/// Scans the ruin and renders it.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let start = Instant::now();
    let run = global.start()?;
    let folder = &args.output;
    fs::create_dir_all(folder)
        .with_context(|| format!("{}: the folder cannot be created", folder.display()))?;
    let (cloud_path, picture_path) = (folder.join("demo.laz"), folder.join("demo.png"));
    let cloud = ruin::scan(args.points as usize, report)?;
    let options = SaveOptions {
        resolution: Some(DVec3::splat(0.001)),
        coordinate_system: Some("EPSG:32634".into()),
        ..SaveOptions::default()
    };
    surfel_formats::save(&cloud_path, &cloud, &options, report)?;
    report.end();
    let n_points = cloud.len();
    drop(cloud);

    let mut description = SceneDescription::of_files([&cloud_path]);
    set_view(&mut description)?;
    description.run = run.clone();
    description.output.output = Some(picture_path.clone());
    render_to_file(&description, &picture_path, None, report)?;
    description.run = RunSettings::default();
    let command = render_command("render", &cloud_path, description);
    print_summary(&cloud_path, &command, n_points, start)?;
    if args.gallery {
        make_gallery(folder, &run, report)?;
    }
    Ok(())
}

/// The ruin's own view and light.
fn set_view(description: &mut SceneDescription) -> anyhow::Result<()> {
    let SceneView { position, focal_point, view_angle_deg } = ruin::view();
    let camera = &mut description.camera;
    camera.position = Some(ruin::UTM_ORIGIN + position);
    camera.focal_point = Some(ruin::UTM_ORIGIN + focal_point);
    camera.view_angle = Some(view_angle_deg);
    description.picture.resolution = Some((1280, 720));
    for (path, value) in SETTINGS {
        description.set(path, &json!(value), Path::new(""))?;
    }
    Ok(())
}

/// Renders gallery.png and gallery.gif.
fn make_gallery(folder: &Path, run: &RunSettings, report: &Report) -> anyhow::Result<()> {
    gallery::write(folder, report)?;
    let scene = folder.join("gallery.toml");
    let mut lines = Vec::new();
    for (command, output, options) in [
        ("render", "gallery.png", &[("spp", "16")][..]),
        ("animate", "gallery.gif", &[("fps", "10"), ("resolution", "480x270"), ("spp", "2")]),
    ] {
        let mut typed = SceneDescription::default();
        for (path, value) in options {
            typed.set(path, &json!(value), Path::new(""))?;
        }
        let output = folder.join(output);
        typed.output.output = Some(output.clone());
        lines.push(render_command(command, &scene, typed.clone()));
        let mut description = SceneDescription::read(&scene)?;
        description.overlay(typed);
        description.run = run.clone();
        match command {
            "render" => render_to_file(&description, &output, None, report)?,
            _ => animate_description(&description, false, false, report)?,
        }
    }
    print(&format!("The gallery was made by\n  {}", lines.join("\n  ")))?;
    Ok(())
}

/// Writes the command that renders a file with these settings.
fn render_command(command: &str, file: &Path, mut description: SceneDescription) -> String {
    let output = description.output.output.take().unwrap_or("-".into());
    let mut words = vec!["surfel".to_owned(), command.to_owned(), file.display().to_string()];
    words.extend(["-o".to_owned(), output.display().to_string()]);
    words.extend(description.to_options());
    command_line(&words)
}

fn print_summary(
    cloud: &Path,
    command: &str,
    n_points: usize,
    start: Instant,
) -> anyhow::Result<()> {
    let cloud = quoted(&cloud.display().to_string());
    print(&format!(
        "A virtual scanner measured a ruin from six stations: {n_points} points, in {cloud}.\n\
         The picture was made from that file, all in {:.0} s, by\n  {command}\n\
         Try next:\n  \
         surfel view {cloud}\n  \
         surfel info {cloud}\n  \
         surfel render {cloud} -o front.png\n  \
         surfel render {cloud} -o map.png --camera-direction 0,0,-1 --camera-orthographic\n  \
         surfel render {cloud} -o classes.png --color class --light sky\n  \
         surfel render {cloud} -o points.png --surface points",
        start.elapsed().as_secs_f64(),
    ))?;
    Ok(())
}
