//! Options of the camera.

use super::{Usage, parse};
use crate::report::Report;
use clap::Args;
use surfel::math::{DVec3, Vec3};
use surfel::points::{PointCloud, guess_up};
use surfel::scene::{Camera, Framing, Projection, frame, look_around, upright};
use surfel_formats::Source;

/// Heading of the options.
pub const CAMERA: &str = "Camera (in the file's own coordinates)";

#[derive(Args)]
#[command(next_help_heading = CAMERA)]
pub struct CameraArgs {
    /// Where the camera is; chosen so that the whole cloud is seen if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::vector, allow_hyphen_values = true)]
    camera_position: Option<DVec3>,
    /// What the camera looks at: the middle of the picture.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::vector, allow_hyphen_values = true)]
    camera_focal_point: Option<DVec3>,
    /// What is up in the picture.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    camera_view_up: Option<DVec3>,
    /// Vertical angle of view in degrees [default: 35, or that of the file's camera].
    #[arg(long, value_name = "DEG", value_parser = parse::view_angle)]
    pub camera_view_angle: Option<f64>,
    /// Without perspective; HEIGHT of the picture in the cloud's unit, or all of the cloud.
    #[arg(long, value_name = "HEIGHT", num_args = 0..=1, value_parser = parse::positive)]
    camera_orthographic: Option<Option<f64>>,
    /// All around, from a free place inside the cloud if no position is given: the width is a full turn, the height
    /// reaches from straight up to straight down (equirectangular). Best twice as wide as high.
    #[arg(long, conflicts_with_all = ["camera_orthographic", "camera_direction", "camera_elevation_angle",
        "camera_zoom_factor", "camera_view_angle"])]
    camera_panorama: bool,
    /// Direction in which the camera looks at the whole cloud: 0,0,-1 for a map.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true,
        conflicts_with_all = ["camera_azimuth_angle", "camera_elevation_angle"])]
    camera_direction: Option<DVec3>,
    /// Turns the chosen camera about the cloud, or a panorama from north, in degrees, clockwise from above.
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = parse::number_in::<-360, 360>)]
    camera_azimuth_angle: f64,
    /// Height of the chosen camera over the horizon in degrees.
    #[arg(long, value_name = "DEG", value_parser = parse::number_in::<-90, 90>)]
    camera_elevation_angle: Option<f64>,
    /// Values above 1 bring the chosen camera nearer.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::positive,
        conflicts_with = "camera_position")]
    camera_zoom_factor: f64,
    /// The camera stays where it is, even if the scene moves it.
    #[arg(long)]
    pub camera_still: bool,
    /// The axis that points up: +Z, -Y, x,y,z; found out from the cloud if not given.
    #[arg(long, value_name = "AXIS", value_parser = parse::up, allow_hyphen_values = true)]
    up: Option<Vec3>,
}

impl CameraArgs {
    /// The world's up, from the option or the cloud.
    pub fn up(&self, cloud: &PointCloud, sources: &[Source], report: &Report) -> Vec3 {
        self.up.unwrap_or_else(|| {
            if sources.iter().all(|source| source.format.starts_with("glTF")) {
                report.choice("up is +Z, to which glTF files are turned", "--up");
                return Vec3::Z;
            }
            let guess = guess_up(cloud, is_georeferenced(cloud, sources));
            report.choice(&guess.reason, "--up");
            guess.up
        })
    }

    /// Whether nothing is asked of the camera but how wide it sees.
    pub fn is_automatic(&self) -> bool {
        let places = [self.camera_position, self.camera_focal_point, self.camera_view_up];
        places.iter().all(Option::is_none)
            && self.camera_direction.is_none()
            && self.camera_orthographic.is_none()
            && self.camera_elevation_angle.is_none()
            && !self.camera_panorama
            && self.camera_azimuth_angle == 0.0
            && self.camera_zoom_factor == 1.0
    }

    pub fn check(&self) -> Result<(), Usage> {
        if self.camera_position.is_some() && self.camera_position == self.camera_focal_point {
            let text = "--camera-position and --camera-focal-point are the same; move one of them";
            return Err(Usage(text.into()));
        }
        Ok(())
    }

    pub fn camera(&self, cloud: &PointCloud, up: Vec3, aspect: f64, report: &Report) -> Camera {
        if self.camera_panorama {
            return self.panorama(cloud, up, report);
        }
        let framing = self.framing(up, aspect);
        if let Some(camera) = self.given(&framing) {
            return camera;
        }
        let framed = frame(cloud, &framing);
        let focal_point = self.camera_focal_point.unwrap_or(framed.focal_point);
        let beside = framed.position + (focal_point - framed.focal_point);
        let position = self.camera_position.unwrap_or(beside);
        // Places that are given may look elsewhere than the framed camera did.
        let view_up = self.camera_view_up.unwrap_or_else(|| upright(up, focal_point - position));
        let projection = match self.camera_orthographic.flatten() {
            Some(height) => Projection::Orthographic { height },
            None => framed.projection,
        };
        if self.camera_position.is_none() {
            let line = format!("camera at {} looks at {}", short(position), short(focal_point));
            report.choice(&line, "--camera-position, --camera-focal-point, --camera-azimuth-angle");
        }
        Camera { position, focal_point, view_up, projection }
    }

    /// The camera that leaves nothing to be chosen, if it is such a one.
    fn given(&self, framing: &Framing) -> Option<Camera> {
        let projection = match self.camera_orthographic {
            Some(height) => Projection::Orthographic { height: height? },
            None => Projection::Perspective { view_angle_deg: framing.view_angle_deg },
        };
        Some(Camera {
            position: self.camera_position?,
            focal_point: self.camera_focal_point?,
            view_up: self.camera_view_up?,
            projection,
        })
    }

    fn panorama(&self, cloud: &PointCloud, up: Vec3, report: &Report) -> Camera {
        let found = look_around(cloud, up, self.camera_azimuth_angle);
        let position = self.camera_position.unwrap_or(found.position);
        let ahead = position + (found.focal_point - found.position);
        if self.camera_position.is_none() {
            let line = format!("camera at {} looks all around", short(position));
            report.choice(&line, "--camera-position, --camera-azimuth-angle");
        }
        Camera {
            position,
            focal_point: self.camera_focal_point.unwrap_or(ahead),
            view_up: self.camera_view_up.unwrap_or(found.view_up),
            projection: found.projection,
        }
    }

    fn framing(&self, up: Vec3, aspect: f64) -> Framing {
        let automatic = Framing::automatic(up, aspect);
        Framing {
            up,
            aspect,
            is_orthographic: self.camera_orthographic.is_some(),
            view_angle_deg: self.camera_view_angle.unwrap_or(automatic.view_angle_deg),
            direction: self.camera_direction,
            view_up: self.camera_view_up,
            azimuth_deg: self.camera_azimuth_angle,
            elevation_deg: self.camera_elevation_angle,
            zoom: self.camera_zoom_factor,
        }
    }
}

/// Survey formats and coordinates far from zero, as those of national grids, have Z up.
pub fn is_georeferenced(cloud: &PointCloud, sources: &[Source]) -> bool {
    let is_survey = |source: &Source| {
        let formats = ["LAS", "LAZ", "COPC", "E57"];
        let is_of_surveyors = formats.iter().any(|name| source.format.starts_with(name));
        is_of_surveyors || source.coordinate_system.is_some()
    };
    let size = cloud.bounds().max - cloud.bounds().min;
    let is_far = 1e4 < cloud.origin.length() && f64::from(size.length()) < cloud.origin.length();
    is_far || sources.iter().any(is_survey)
}

/// Few digits, for people.
pub fn short(position: DVec3) -> String {
    let digits = if 1000.0 < position.abs().max_element() { 1 } else { 4 };
    position.to_array().map(|x| format!("{x:.digits$}")).join(",")
}
