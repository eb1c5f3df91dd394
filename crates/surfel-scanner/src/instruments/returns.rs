//! Returns of an instrument's pulses, and clouds of them.

use crate::sdf::{DRay, SdfHit, SdfScene};
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;
use surfel_core::points::{
    COLOR_8_TO_16, COLUMN_INDEX, PointCloud, ROW_INDEX, STATION, Scalar, ScanStation, Values,
};

/// The return of one ray.
pub struct Return {
    pub position: Vec3,
    color: [u16; 3],
    intensity: f32,
    class: u8,
    source: u16,
    /// Row and column in the grid of the station or picture.
    cell: [u32; 2],
}

impl Return {
    /// Describes the surface at `hit`. The point lies on the ray at the measured `range`; `source` is the number of the
    /// station, flight line or picture from 1.
    pub fn new(scene: &SdfScene, ray: &DRay, hit: SdfHit, range: f64, source: u16) -> Self {
        let point = ray.origin + hit.distance * ray.direction;
        let normal = scene.normal(hit.part_idx, point);
        let sdf = scene.part(hit.part_idx);
        let color = sdf.color(point, normal).clamp(Vec3::ZERO, Vec3::ONE);
        let incidence = normal.dot(-ray.direction).max(0.0);
        Self {
            position: (ray.origin + range * ray.direction).as_vec3(),
            color: color.to_array().map(|c| (c * 255.0).round() as u16 * COLOR_8_TO_16),
            intensity: intensity(f64::from(color.element_sum()) / 3.0, incidence, hit.distance),
            class: sdf.class(),
            source,
            cell: [0; 2],
        }
    }

    /// Returns the return of the ray of a row and column.
    pub fn in_cell(self, row: usize, column: usize) -> Self {
        Self { cell: [row as u32, column as u32], ..self }
    }
}

/// Returns the cloud of all returns; `origin` are the world coordinates of the scene's origin.
pub fn into_cloud(returns: &[Return], origin: DVec3) -> PointCloud {
    fn column<T>(returns: &[Return], value: impl Fn(&Return) -> T) -> Vec<T> {
        returns.iter().map(value).collect()
    }
    PointCloud {
        origin,
        positions: column(returns, |r| r.position),
        colors: Some(column(returns, |r| r.color)),
        intensity: Some(column(returns, |r| r.intensity)),
        classification: Some(column(returns, |r| r.class)),
        scalars: vec![Scalar {
            name: "point_source_id".to_owned(),
            values: Values::U16(column(returns, |r| r.source)),
        }],
        ..PointCloud::default()
    }
}

/// Adds the stations at `positions` in the scene, and the columns of the station, row and column of each return.
pub fn add_grid(cloud: &mut PointCloud, returns: &[Return], positions: &[DVec3]) {
    let station = |(i, position): (usize, &DVec3)| ScanStation {
        name: format!("scan {}", i + 1),
        position: Some(cloud.origin + *position),
        ..ScanStation::default()
    };
    cloud.stations = positions.iter().enumerate().map(station).collect();
    let index = |axis: usize| Values::I32(returns.iter().map(|r| r.cell[axis] as i32).collect());
    let station = Values::U16(returns.iter().map(|r| r.source - 1).collect());
    let columns = [(STATION, station), (ROW_INDEX, index(0)), (COLUMN_INDEX, index(1))];
    let columns = columns.map(|(name, values)| Scalar { name: name.to_owned(), values });
    cloud.scalars.extend(columns);
}

/// Returns the intensity from 0 to 65535 by Lambert's cosine law and an inverse square law that levels off near the
/// scanner.
fn intensity(reflectance: f64, incidence_cos: f64, distance: f64) -> f32 {
    const HALF_RANGE: f64 = 15.0;
    let falloff = 1.0 / (1.0 + (distance / HALF_RANGE).powi(2));
    (65535.0 * reflectance * incidence_cos * falloff).round() as f32
}

#[cfg(test)]
mod tests {
    //! Intensities of returns.

    use super::*;

    #[test]
    fn intensity_falls_with_distance_and_incidence() {
        assert!(intensity(0.5, 1.0, 30.0) < intensity(0.5, 1.0, 3.0));
        assert!(intensity(0.5, 0.2, 3.0) < intensity(0.5, 1.0, 3.0));
        assert!(intensity(1.0, 1.0, 0.0) <= 65535.0);
    }
}
