//! Cameras, and the rays through the pixels of their pictures.

use crate::math::{DQuat, DVec3, Ray, Vec3};
use std::f64::consts::{PI, TAU};

/// A camera in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the camera.
    pub position: DVec3,
    /// Point in the middle of the picture.
    pub focal_point: DVec3,
    /// Direction that is up in the picture: any but that of the view, of any length but zero.
    pub view_up: DVec3,
    /// Perspective, orthographic or panorama.
    pub projection: Projection,
}

/// The projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A perspective projection.
    Perspective {
        /// Vertical angle of view in degrees.
        view_angle_deg: f64,
    },
    /// A parallel projection.
    Orthographic {
        /// Height of the picture in world units.
        height: f64,
    },
    /// An equirectangular projection of all directions.
    ///
    /// The width of the picture is a full turn about the view's up, with the focal point above or below the
    /// middle. The height spans straight up to straight down.
    Panorama,
}

/// A camera for pictures of one size, relative to a scene's origin. It makes the primary rays.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Position of the camera.
    pub position: Vec3,
    /// Unit direction of the view.
    pub forward: Vec3,
    /// Unit direction to the right of the picture.
    pub right: Vec3,
    /// Unit direction to the top of the picture.
    pub up: Vec3,
    /// The mapping from positions in the picture to rays.
    pub lens: Lens,
    /// Position of the picture's centre, in pixels from its upper left corner.
    pub center: (f32, f32),
}

/// The mapping from positions in the picture to rays.
#[derive(Clone, Copy, Debug)]
pub enum Lens {
    /// A perspective projection.
    Perspective {
        /// Size of a pixel in world units at distance 1.
        pixel_size: f32,
    },
    /// A parallel projection.
    Orthographic {
        /// Size of a pixel in world units.
        pixel_size: f32,
    },
    /// An equirectangular projection of all directions.
    Panorama {
        /// Angles in radians that a pixel spans, horizontally and vertically.
        pixel_rad: (f32, f32),
    },
}

impl Camera {
    /// Returns the directions to the right, up and forward of the picture, unit and orthogonal.
    pub fn axes(&self) -> [DVec3; 3] {
        let forward = (self.focal_point - self.position).try_normalize().unwrap_or(-DVec3::Z);
        let right = forward.cross(self.view_up).try_normalize();
        let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
        [right, right.cross(forward), forward]
    }

    /// Returns the camera rotated about its focal point.
    pub fn rotated_about_focal_point(self, rotation: DQuat) -> Self {
        let position = self.focal_point + rotation * (self.position - self.focal_point);
        Self { position, view_up: rotation * self.view_up, ..self }
    }

    /// Returns the axes of a picture that stays level, whatever the height of the focal point.
    fn level_axes(&self) -> [DVec3; 3] {
        let [right, ..] = self.axes();
        let up = self.view_up.try_normalize().unwrap_or(DVec3::Z);
        let right = (right - right.dot(up) * up).try_normalize();
        let right = right.unwrap_or_else(|| up.any_orthonormal_vector());
        [right, up, up.cross(right)]
    }

    /// Returns the view for a picture of `width` x `height` pixels, relative to `origin`.
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
                Lens::Panorama { pixel_rad: ((TAU / width) as f32, (PI / height) as f32) }
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
    /// Returns the ray through a position in the picture, in pixels from its upper left corner.
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let (across, along) = (x - self.center.0, self.center.1 - y);
        let offset =
            |pixel_size: f32| pixel_size * across * self.right + pixel_size * along * self.up;
        match self.lens {
            Lens::Perspective { pixel_size } => {
                Ray::new(self.position, (self.forward + offset(pixel_size)).normalize())
            }
            Lens::Orthographic { pixel_size } => {
                Ray::new(self.position + offset(pixel_size), self.forward)
            }
            Lens::Panorama { pixel_rad } => {
                let (sin_across, cos_across) = (pixel_rad.0 * across).sin_cos();
                let (sin_along, cos_along) = (pixel_rad.1 * along).sin_cos();
                let level = cos_across * self.forward + sin_across * self.right;
                Ray::new(self.position, (cos_along * level + sin_along * self.up).normalize())
            }
        }
    }

    /// Returns the position in the picture in pixels and the depth of a point, or `None` if the point is
    /// behind the camera.
    pub fn project(&self, position: Vec3) -> Option<(f32, f32, f32)> {
        let offset = position - self.position;
        let (right, up) = (offset.dot(self.right), offset.dot(self.up));
        let forward = offset.dot(self.forward);
        let depth = self.depth(position);
        let (across, along) = match self.lens {
            Lens::Perspective { pixel_size } => {
                (right / (depth * pixel_size), up / (depth * pixel_size))
            }
            Lens::Orthographic { pixel_size } => (right / pixel_size, up / pixel_size),
            Lens::Panorama { pixel_rad } => {
                let height = up.atan2(right.hypot(forward));
                (right.atan2(forward) / pixel_rad.0, height / pixel_rad.1)
            }
        };
        (0.0 < depth).then_some((self.center.0 + across, self.center.1 - along, depth))
    }

    /// True if the picture shows all directions, so that its right edge continues at its left one.
    pub fn is_panorama(&self) -> bool {
        matches!(self.lens, Lens::Panorama { .. })
    }

    /// Returns the size of a pixel in the middle of the picture in world units: at distance 1, or at any
    /// distance in an orthographic picture.
    pub fn pixel_size(&self) -> f32 {
        match self.lens {
            Lens::Perspective { pixel_size } | Lens::Orthographic { pixel_size } => pixel_size,
            Lens::Panorama { pixel_rad } => pixel_rad.1,
        }
    }

    /// Returns the distance of `position` along the view axis, or from the camera in a panorama.
    pub fn depth(&self, position: Vec3) -> f32 {
        let offset = position - self.position;
        match self.lens {
            Lens::Panorama { .. } => offset.length(),
            _ => offset.dot(self.forward),
        }
    }

    /// Returns the unit vector from `position` toward the camera.
    pub fn toward_camera(&self, position: Vec3) -> Vec3 {
        match self.lens {
            Lens::Orthographic { .. } => -self.forward,
            _ => (self.position - position).normalize(),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Rays and projections of all cameras agree.

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
    fn a_panorama_shows_all_directions() {
        let camera = Camera {
            position: DVec3::new(1.0, 2.0, 3.0),
            focal_point: DVec3::new(1.0, 5.0, 4.0),
            view_up: DVec3::Z,
            projection: Projection::Panorama,
        };
        let view = camera.view(DVec3::ZERO, 80, 40);
        // North is in the middle, east to the right, south at both ends, up and down at the upper and lower
        // edge.
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
    fn a_view_along_up_has_orthonormal_axes() {
        let mut camera = cameras()[0];
        camera.view_up = camera.focal_point - camera.position;
        for axis in camera.axes() {
            assert!((axis.length() - 1.0).abs() < 1e-9);
        }
    }
}
