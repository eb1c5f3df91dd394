//! Cameras: who looks, from where, and the rays through a picture's pixels.

use crate::math::{DQuat, DVec3, Ray, Vec3};
use std::f64::consts::{PI, TAU};

/// A camera in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub position: DVec3,
    pub focal_point: DVec3,
    /// Any direction but the view's own.
    pub view_up: DVec3,
    pub projection: Projection,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical angle of view.
    Perspective { view_angle_deg: f64 },
    /// Height of the picture in world units.
    Orthographic { height: f64 },
    /// All directions (equirectangular): the width is a full turn about the view's up, with the focal point
    /// over or under the middle, the height reaches from straight up to straight down.
    Panorama,
}

/// A camera with its picture's size, relative to a scene's origin: the source of primary rays.
#[derive(Clone, Copy, Debug)]
pub struct View {
    position: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    lens: Lens,
    center: (f32, f32),
}

/// How places in the picture become rays.
#[derive(Clone, Copy, Debug)]
enum Lens {
    /// Units at distance 1 from one pixel to the next.
    Perspective { pixel_size: f32 },
    /// World units from one pixel to the next.
    Orthographic { pixel_size: f32 },
    /// Radians from one pixel to the next, across and along.
    Panorama { turn: (f32, f32) },
}

impl Camera {
    /// Directions to the right, up and forward of the picture, unit and orthogonal.
    pub fn axes(&self) -> [DVec3; 3] {
        let forward = (self.focal_point - self.position).try_normalize().unwrap_or(-DVec3::Z);
        let right = forward.cross(self.view_up).try_normalize();
        let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
        [right, right.cross(forward), forward]
    }

    /// The camera carried about its focal point.
    pub fn turned(self, turn: DQuat) -> Self {
        let position = self.focal_point + turn * (self.position - self.focal_point);
        Self { position, view_up: turn * self.view_up, ..self }
    }

    /// Those of a picture that stays level however high the focal point is.
    fn level_axes(&self) -> [DVec3; 3] {
        let [right, ..] = self.axes();
        let up = self.view_up.try_normalize().unwrap_or(DVec3::Z);
        let right = (right - right.dot(up) * up).try_normalize();
        let right = right.unwrap_or_else(|| up.any_orthonormal_vector());
        [right, up, up.cross(right)]
    }

    /// For a picture of `width` x `height` pixels of a scene about `origin`.
    pub fn view(&self, origin: DVec3, width: u32, height: u32) -> View {
        let (width, height) = (f64::from(width), f64::from(height));
        let pixel_size = |extent: f64| (extent / height) as f32;
        let lens = match self.projection {
            Projection::Perspective { view_angle_deg } => {
                let tan = (view_angle_deg.to_radians() / 2.0).tan();
                Lens::Perspective { pixel_size: pixel_size(2.0 * tan) }
            }
            Projection::Orthographic { height } => {
                Lens::Orthographic { pixel_size: pixel_size(height) }
            }
            Projection::Panorama => {
                Lens::Panorama { turn: ((TAU / width) as f32, (PI / height) as f32) }
            }
        };
        let is_level = matches!(lens, Lens::Panorama { .. });
        let axes = if is_level { self.level_axes() } else { self.axes() };
        let [right, up, forward] = axes.map(|axis| axis.as_vec3());
        let center = (width as f32 / 2.0, height as f32 / 2.0);
        View { position: (self.position - origin).as_vec3(), forward, right, up, lens, center }
    }
}

impl View {
    /// The ray through a place in the picture, in pixels from its top left corner.
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let (across, along) = (x - self.center.0, self.center.1 - y);
        let aside =
            |pixel_size: f32| pixel_size * across * self.right + pixel_size * along * self.up;
        match self.lens {
            Lens::Perspective { pixel_size } => {
                Ray::new(self.position, (self.forward + aside(pixel_size)).normalize())
            }
            Lens::Orthographic { pixel_size } => {
                Ray::new(self.position + aside(pixel_size), self.forward)
            }
            Lens::Panorama { turn } => {
                let (sin_across, cos_across) = (turn.0 * across).sin_cos();
                let (sin_along, cos_along) = (turn.1 * along).sin_cos();
                let level = cos_across * self.forward + sin_across * self.right;
                Ray::new(self.position, (cos_along * level + sin_along * self.up).normalize())
            }
        }
    }

    /// Place in the picture in pixels, and depth, of a point before the camera.
    pub fn project(&self, position: Vec3) -> Option<(f32, f32, f32)> {
        let offset = position - self.position;
        let [right, up, forward] = [self.right, self.up, self.forward].map(|axis| offset.dot(axis));
        let depth = self.depth(position);
        let (across, along) = match self.lens {
            Lens::Perspective { pixel_size } => {
                (right / (depth * pixel_size), up / (depth * pixel_size))
            }
            Lens::Orthographic { pixel_size } => (right / pixel_size, up / pixel_size),
            Lens::Panorama { turn } => {
                let height = up.atan2(right.hypot(forward));
                (right.atan2(forward) / turn.0, height / turn.1)
            }
        };
        (0.0 < depth).then_some((self.center.0 + across, self.center.1 - along, depth))
    }

    /// What a pixel in the middle spans at distance 1 or, in an orthographic picture, anywhere, in world
    /// units.
    pub fn pixel_size(&self) -> f32 {
        match self.lens {
            Lens::Perspective { pixel_size } | Lens::Orthographic { pixel_size } => pixel_size,
            Lens::Panorama { turn } => turn.1,
        }
    }

    /// Distance of `position` along the view axis; in a panorama, which has none, from the camera.
    pub fn depth(&self, position: Vec3) -> f32 {
        let offset = position - self.position;
        match self.lens {
            Lens::Panorama { .. } => offset.length(),
            _ => offset.dot(self.forward),
        }
    }

    /// Unit vector from `position` toward the camera.
    pub fn toward_camera(&self, position: Vec3) -> Vec3 {
        match self.lens {
            Lens::Orthographic { .. } => -self.forward,
            _ => (self.position - position).normalize(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> [Camera; 3] {
        let perspective = Projection::Perspective { view_angle_deg: 40.0 };
        let orthographic = Projection::Orthographic { height: 8.0 };
        [perspective, orthographic, Projection::Panorama].map(|projection| Camera {
            position: DVec3::new(500_003.0, -4.0, 2.0),
            focal_point: DVec3::new(500_000.0, 1.0, 0.5),
            view_up: DVec3::Z,
            projection,
        })
    }

    #[test]
    fn points_on_a_ray_project_to_its_pixel() {
        for camera in cameras() {
            let view = camera.view(DVec3::new(500_000.0, 0.0, 0.0), 64, 48);
            for (x, y) in [(0.5, 0.5), (32.0, 24.0), (63.5, 10.25)] {
                let (px, py, depth) = view.project(view.ray(x, y).at(5.0)).unwrap();
                assert!((px - x).abs() < 1e-3 && (py - y).abs() < 1e-3, "{px} {py}");
                assert!((depth - view.depth(view.ray(x, y).at(5.0))).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn the_focal_point_is_in_the_middle_and_up_is_up() {
        for camera in cameras() {
            let origin = DVec3::new(500_000.0, 0.0, 0.0);
            let view = camera.view(origin, 64, 48);
            let focal = (camera.focal_point - origin).as_vec3();
            let (x, y, _) = view.project(focal).unwrap();
            assert!((x - 32.0).abs() < 1e-3);
            // A panorama stays level.
            assert!((y - 24.0).abs() < 1e-3 || camera.projection == Projection::Panorama);
            assert!(view.project(focal + 0.1 * Vec3::Z).unwrap().1 < y);
        }
    }

    #[test]
    fn a_panorama_shows_all_around() {
        let camera = Camera {
            position: DVec3::new(1.0, 2.0, 3.0),
            focal_point: DVec3::new(1.0, 5.0, 4.0),
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let view = camera.view(DVec3::ZERO, 80, 40);
        // North in the middle, east to the right, south at both ends; straight up and down at the rims.
        for ((x, y), direction) in [
            ((40.0, 20.0), Vec3::Y),
            ((60.0, 20.0), Vec3::X),
            ((20.0, 20.0), Vec3::NEG_X),
            ((0.0, 20.0), Vec3::NEG_Y),
            ((80.0, 20.0), Vec3::NEG_Y),
            ((13.0, 0.0), Vec3::Z),
            ((70.0, 40.0), Vec3::NEG_Z),
        ] {
            assert!(view.ray(x, y).direction.distance(direction) < 1e-6, "{x}, {y}");
        }
        assert_eq!(view.depth(Vec3::new(1.0, 2.0, 7.0)), 4.0);
    }

    #[test]
    fn looking_along_up_still_gives_a_frame() {
        let mut camera = cameras()[0];
        camera.view_up = camera.focal_point - camera.position;
        for axis in camera.axes() {
            assert!((axis.length() - 1.0).abs() < 1e-9);
        }
    }
}
