//! From where to look at a cloud that nothing is known of.

use super::framing::{Framing, fit_along, range};
use super::light::ground_axes;
use super::{Camera, Projection};
use crate::math::{DVec3, Vec3};

/// The automatic camera stands in the south, a little to the east, if no place is better.
const FRONT_AZIMUTH_DEG: f64 = 155.0;
/// Height over width below which a cloud is land.
const LAND: f64 = 0.25;

/// Direction of view toward `points`: the flatter the cloud, the higher up. Land has no front: it is
/// turned so that it fills the picture. Of anything else, the side is shown that most points face.
pub(super) fn automatic_direction(points: &[Vec3], framing: &Framing) -> DVec3 {
    let (east, north) = ground_axes(framing.up);
    let extent = |axis: Vec3| {
        let (low, high) = range(points, axis);
        high - low
    };
    let flatness = f64::from(extent(framing.up) / extent(east).max(extent(north)).max(1e-9));
    let elevation_deg =
        framing.elevation_deg.unwrap_or_else(|| 40.0 - 25.0 * (flatness / 0.6).min(1.0));
    let azimuth_deg = if flatness < LAND {
        filling_azimuth_deg(points, elevation_deg, framing)
    } else {
        revealing_azimuth_deg(points, elevation_deg, framing)
    };
    direction_from(azimuth_deg + framing.azimuth_deg, elevation_deg, framing.up)
}

/// Of places in the south, the one from which the whole cloud is seen from nearest by.
fn filling_azimuth_deg(points: &[Vec3], elevation_deg: f64, framing: &Framing) -> f64 {
    let some: Vec<Vec3> = points.iter().step_by(points.len().div_ceil(10_000)).copied().collect();
    let distance = |azimuth_deg: f64| {
        let forward = direction_from(azimuth_deg, elevation_deg, framing.up);
        let camera = fit_along(forward, &some, framing);
        match camera.projection {
            Projection::Orthographic { height } => height,
            _ => camera.position.distance(camera.focal_point),
        }
    };
    let places = (0..12).map(|step| FRONT_AZIMUTH_DEG + 15.0 * f64::from(step) - 60.0);
    let nearest = places.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    nearest.unwrap_or(FRONT_AZIMUTH_DEG)
}

/// The place all around from which the most points are in sight. A scan from one side shows every
/// point from where the scanner stood, and its hollow backs from behind.
fn revealing_azimuth_deg(points: &[Vec3], elevation_deg: f64, framing: &Framing) -> f64 {
    /// What another place must show more than the front: closed objects look alike from all sides.
    const CLEARLY: f64 = 0.1;
    let share = |azimuth_deg: f64| {
        let forward = direction_from(azimuth_deg, elevation_deg, framing.up);
        share_in_sight(points, &fit_along(forward, points, framing), framing.aspect)
    };
    let places = (1..12).map(|step| FRONT_AZIMUTH_DEG + 30.0 * f64::from(step));
    let shares = places.map(|place| (share(place), place));
    let best = shares.max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((most, place)) if share(FRONT_AZIMUTH_DEG) + CLEARLY < most => place,
        _ => FRONT_AZIMUTH_DEG,
    }
}

/// Share of the points that no other point hides in a small picture.
fn share_in_sight(points: &[Vec3], camera: &Camera, aspect: f64) -> f64 {
    // About ten points a pixel of the covered part: enough to hide what lies behind.
    let height = (points.len() as f64 / 10.0 / aspect).sqrt().clamp(4.0, 128.0) as u32;
    let width = (f64::from(height) * aspect) as u32;
    let view = camera.view(DVec3::ZERO, width, height);
    let mut nearest = vec![f32::INFINITY; width as usize * height as usize];
    let place = |point: &Vec3| {
        let (x, y, depth) = view.project(*point)?;
        let inside = (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y);
        inside.then(|| (y as usize * width as usize + x as usize, depth))
    };
    for (pixel, depth) in points.iter().filter_map(place) {
        nearest[pixel] = nearest[pixel].min(depth);
    }
    // A surface that leans away within a pixel does not hide itself.
    let span = match camera.projection {
        Projection::Orthographic { .. } => 1.0,
        _ => camera.position.distance(camera.focal_point) as f32,
    };
    let slack = 4.0 * span * view.pixel_size();
    let in_sight =
        |point: &&Vec3| place(point).is_some_and(|(pixel, depth)| depth <= nearest[pixel] + slack);
    points.iter().filter(in_sight).count() as f64 / points.len() as f64
}

/// Direction of view from a place at this azimuth and height over the horizon.
fn direction_from(azimuth_deg: f64, elevation_deg: f64, up: Vec3) -> DVec3 {
    let (east, north) = ground_axes(up);
    let (sin_azimuth, cos_azimuth) = azimuth_deg.to_radians().sin_cos();
    let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
    let (east, north, up) = (east.as_dvec3(), north.as_dvec3(), up.as_dvec3());
    -(cos_elevation * (sin_azimuth * east + cos_azimuth * north) + sin_elevation * up)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two upright sheets, one behind the other as seen from `front`, the nearer one half as wide.
    fn sheets(front: Vec3) -> Vec<Vec3> {
        let side = front.cross(Vec3::Z);
        let sheet = |depth: f32, width: f32| {
            (0..10_000).map(move |i| {
                let (u, v) = ((i % 100) as f32 / 99.0 - 0.5, (i / 100) as f32 / 99.0 - 0.5);
                depth * front + 2.0 * width * u * side + 2.0 * v * Vec3::Z
            })
        };
        // The rear sheet is scanned only where the front one does not hide it.
        let rear = sheet(-1.0, 1.0).filter(|p| 0.5 < p.dot(side).abs());
        sheet(1.0, 0.5).chain(rear).collect()
    }

    #[test]
    fn a_scan_is_shown_from_the_side_of_the_scanner() {
        for front in [Vec3::X, Vec3::NEG_X, Vec3::Y] {
            let framing = Framing::automatic(Vec3::Z, 1.5);
            let forward = automatic_direction(&sheets(front), &framing);
            // The sheets hide each other a little from every side but the front and, as both are flat, the back.
            assert!(0.4 < forward.dot(front.as_dvec3()).abs(), "{front}: {forward}");
        }
    }

    #[test]
    fn a_closed_object_is_shown_from_the_front() {
        let ball = (0..20_000).map(|i| {
            let z = 1.0 - (2.0 * i as f32 + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963 * i as f32).sin_cos();
            Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        });
        let points: Vec<Vec3> = ball.collect();
        let framing = Framing::automatic(Vec3::Z, 1.5);
        let forward = automatic_direction(&points, &framing);
        let expected = direction_from(FRONT_AZIMUTH_DEG, 15.0, Vec3::Z);
        assert!(forward.distance(expected) < 1e-6, "{forward}");
    }
}
