//! Cameras: who looks, from where, and the rays through a picture's pixels.

use crate::math::{DVec3, Ray, Vec3};

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
}

/// A camera with its picture's size, relative to a scene's origin: the source of primary rays.
#[derive(Clone, Copy, Debug)]
pub struct View {
    position: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    is_perspective: bool,
    /// World units (orthographic), or units at distance 1, from one pixel to the next.
    pixel_size: f32,
    center: (f32, f32),
}

impl Camera {
    /// Directions to the right, up and forward of the picture, unit and orthogonal.
    pub fn axes(&self) -> [DVec3; 3] {
        let forward = (self.focal_point - self.position).try_normalize().unwrap_or(-DVec3::Z);
        let right = forward.cross(self.view_up).try_normalize();
        let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
        [right, right.cross(forward), forward]
    }

    /// For a picture of `width` x `height` pixels of a scene about `origin`.
    pub fn view(&self, origin: DVec3, width: u32, height: u32) -> View {
        let [right, up, forward] = self.axes().map(|axis| axis.as_vec3());
        let (is_perspective, extent) = match self.projection {
            Projection::Perspective { view_angle_deg } => {
                (true, 2.0 * (view_angle_deg.to_radians() / 2.0).tan())
            }
            Projection::Orthographic { height } => (false, height),
        };
        View {
            position: (self.position - origin).as_vec3(),
            forward,
            right,
            up,
            is_perspective,
            pixel_size: (extent / f64::from(height)) as f32,
            center: (width as f32 / 2.0, height as f32 / 2.0),
        }
    }
}

impl View {
    /// The ray through a place in the picture, in pixels from its top left corner.
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let across = self.pixel_size * (x - self.center.0) * self.right;
        let along = self.pixel_size * (self.center.1 - y) * self.up;
        if self.is_perspective {
            Ray::new(self.position, (self.forward + across + along).normalize())
        } else {
            Ray::new(self.position + across + along, self.forward)
        }
    }

    /// Place in the picture in pixels, and depth along the view axis, of a point before the camera.
    pub fn project(&self, position: Vec3) -> Option<(f32, f32, f32)> {
        let offset = position - self.position;
        let depth = offset.dot(self.forward);
        let scale = if self.is_perspective { depth * self.pixel_size } else { self.pixel_size };
        let place = |axis: Vec3| offset.dot(axis) / scale;
        (0.0 < depth)
            .then(|| (self.center.0 + place(self.right), self.center.1 - place(self.up), depth))
    }

    /// What a pixel spans at distance 1 (perspective), or anywhere (orthographic), in world units.
    pub fn pixel_size(&self) -> f32 {
        self.pixel_size
    }

    /// Distance of `position` along the view axis.
    pub fn depth(&self, position: Vec3) -> f32 {
        (position - self.position).dot(self.forward)
    }

    /// Unit vector from `position` toward the camera.
    pub fn toward_camera(&self, position: Vec3) -> Vec3 {
        if self.is_perspective { (self.position - position).normalize() } else { -self.forward }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> [Camera; 2] {
        let perspective = Projection::Perspective { view_angle_deg: 40.0 };
        [perspective, Projection::Orthographic { height: 8.0 }].map(|projection| Camera {
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
            assert!((x - 32.0).abs() < 1e-3 && (y - 24.0).abs() < 1e-3);
            assert!(view.project(focal + 0.1 * Vec3::Z).unwrap().1 < y);
        }
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
