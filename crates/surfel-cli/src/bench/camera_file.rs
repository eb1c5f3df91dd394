//! Cameras as files: one line `ex,ey,ez,tx,ty,tz,fovy_deg,lx,ly,lz`, with Z up.

use anyhow::Context;
use std::path::Path;
use surfel_core::math::DVec3;
use surfel_core::scene::{Camera, Projection};
use surfel_core::words::counted;

/// A camera and a point light in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFile {
    /// Position of the camera.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub target: DVec3,
    /// Vertical field of view in degrees.
    pub view_angle_deg: f64,
    /// Position of the point light.
    pub light: DVec3,
}

const FORM: &str = "one line of ten numbers separated by commas: eye x,y,z, target x,y,z, vertical angle \
    of view in degrees, light x,y,z";

/// Bytes of the largest camera file: a line is far shorter, so that a longer file is none.
const MAX_BYTES: usize = 4096;

impl CameraFile {
    /// Reads a camera file.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = surfel_formats::load_text(path, MAX_BYTES)?;
        let camera = Self::parse(text.trim()).map_err(anyhow::Error::msg);
        camera.with_context(|| path.display().to_string())
    }

    fn parse(text: &str) -> Result<Self, String> {
        let numbers = text.split(',').enumerate().map(|(i, text)| number(text, i + 1));
        let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
        let &[ex, ey, ez, tx, ty, tz, view_angle_deg, lx, ly, lz] = &numbers[..] else {
            return Err(format!("found {}, expected {FORM}", counted(numbers.len(), "number")));
        };
        let [eye, target, light] = [[ex, ey, ez], [tx, ty, tz], [lx, ly, lz]].map(DVec3::from);
        let camera = Self { eye, target, view_angle_deg, light };
        camera.check().map(|()| camera)
    }

    fn check(&self) -> Result<(), String> {
        if !(0.0 < self.view_angle_deg && self.view_angle_deg < 180.0) {
            let found = self.view_angle_deg;
            return Err(format!("found an angle of view of {found}, expected 0 to 180 degrees"));
        }
        let forward = (self.target - self.eye).try_normalize();
        let forward = forward.ok_or("found eye and target at one place, expected two places")?;
        if forward.cross(DVec3::Z).length() < 1e-6 {
            return Err("found a view straight up or down, expected one with Z up".into());
        }
        Ok(())
    }

    /// Returns the camera, with Z up.
    pub fn camera(&self) -> Camera {
        let projection = Projection::Perspective { view_angle_deg: self.view_angle_deg };
        Camera { position: self.eye, focal_point: self.target, view_up: DVec3::Z, projection }
    }
}

fn number(text: &str, ordinal: usize) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok();
    // Beyond this the squares of lengths are no longer finite in f32.
    number.filter(|number| number.abs() < 1e15).ok_or_else(|| {
        let found: String = text.trim().chars().take(40).collect();
        format!("number {ordinal}: found `{}`, expected {FORM}", found.escape_debug())
    })
}

#[cfg(test)]
mod tests {
    //! Camera files are parsed, and errors name the number.

    use super::*;

    #[test]
    fn a_camera_file_is_parsed() {
        let camera = CameraFile::parse("-11,-25, 4.5,1.5,0,6.2,42,14,-3e1,22").unwrap();
        assert_eq!(camera.eye, DVec3::new(-11.0, -25.0, 4.5));
        assert_eq!(camera.target, DVec3::new(1.5, 0.0, 6.2));
        assert_eq!((camera.view_angle_deg, camera.light), (42.0, DVec3::new(14.0, -30.0, 22.0)));
    }

    #[test]
    fn invalid_camera_files_are_errors() {
        let wrong = [
            ("", "number 1: found ``, expected one line of ten numbers separated by commas"),
            ("1 2 3 4 5 6 40 8 9 10", "number 1: found `1 2 3 4 5 6 40 8 9 10`"),
            ("1,2,3", "found 3 numbers, expected one line of ten numbers"),
            ("1,2,3,4,5,6,40,8,9,10,11", "found 11 numbers"),
            ("1,2,3,4,5,6,40,8,9,10\n1,2,3,4,5,6,40,8,9,10", "number 10: found `10\\n1`"),
            ("1,2,3,4,5,6,40,8,9,nan", "found `nan`"),
            ("1,2,3,4,5,6,40,8,9,1e300", "found `1e300`"),
            ("1,2,x,4,5,6,40,8,9,10", "number 3: found `x`"),
            ("1,2,3,4,5,6,180,8,9,10", "found an angle of view of 180, expected 0 to 180"),
            ("1,2,3,1,2,3,40,8,9,10", "found eye and target at one place"),
            ("1,2,3,1,2,9,40,8,9,10", "found a view straight up or down"),
        ];
        for (text, words) in wrong {
            let error = CameraFile::parse(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
