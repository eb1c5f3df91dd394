//! Clouds moved, turned and scaled with all that their points have a place or a direction in.

use super::gaussians::{GAUSSIAN_COLUMNS, GaussianColumns, MAX_REST_COLUMNS, rest_column};
use super::point_cloud::{PointCloud, Scalar, Values};
use crate::math::{DAffine3, DMat3, DQuat, DVec3, SymmetricMatrix, Vec3, rotation_of};

/// First of the columns of the logarithms of a Gaussian's deviations; those of its rotation follow.
const FIRST_SCALE: usize = 4;
/// Number of these columns.
const N_SHAPE_COLUMNS: usize = 7;

impl PointCloud {
    /// Moves positions, normals, radii, stations, and the shapes of trained Gaussians. Radii grow by the largest scale.
    /// The colours that turned Gaussians have in single directions are left out: the mean of all directions stays.
    pub fn transform(&mut self, transform: &DAffine3) {
        if *transform == DAffine3::IDENTITY {
            return;
        }
        let linear = transform.matrix3;
        self.origin = transform.transform_point3(self.origin);
        let of_normals = linear.inverse().transpose();
        let rotation = rotation_of(&linear);
        let gaussians = self.transformed_shapes(&linear);
        for position in &mut self.positions {
            *position = (linear * position.as_dvec3()).as_vec3();
        }
        for normal in self.normals.iter_mut().flatten() {
            *normal = (of_normals * normal.as_dvec3()).normalize_or_zero().as_vec3();
        }
        let max_scale = lengths_of_axes(&linear).into_iter().fold(0.0, f64::max) as f32;
        for radius in self.radii.iter_mut().flatten() {
            *radius *= max_scale;
        }
        for station in &mut self.stations {
            let position = &mut station.position;
            *position = position.map(|position| transform.transform_point3(position));
            station.rotation = rotation * station.rotation;
        }
        if let Some(columns) = gaussians {
            let is_turned = !rotation.is_near_identity() || linear.determinant() < 0.0;
            if is_turned {
                let rest: Vec<String> = (0..MAX_REST_COLUMNS).map(rest_column).collect();
                self.scalars.retain(|scalar| !rest.contains(&scalar.name));
            }
            for (name, values) in GAUSSIAN_COLUMNS[FIRST_SCALE..].iter().zip(columns) {
                let column = self.scalars.iter_mut().find(|scalar| scalar.name == *name);
                let Scalar { values: old, .. } = column.expect("Gaussians have all their columns");
                *old = Values::F32(values);
            }
        }
    }

    /// Returns the columns of deviations and rotation of trained Gaussians after a linear map; none if the points are no
    /// Gaussians. Invalid Gaussians keep theirs.
    fn transformed_shapes(&self, linear: &DMat3) -> Option<[Vec<f32>; N_SHAPE_COLUMNS]> {
        let columns = GaussianColumns::new(self)?;
        let old: Vec<&Values> =
            GAUSSIAN_COLUMNS[FIRST_SCALE..].iter().filter_map(|name| self.scalar(name)).collect();
        let mut shapes: [Vec<f32>; N_SHAPE_COLUMNS] = Default::default();
        for i in 0..self.len() {
            let shape = columns.gaussian(i).map(|gaussian| {
                let axes = linear * DMat3::from_quat(gaussian.rotation.as_dquat());
                ellipsoid(&axes, gaussian.deviations)
            });
            let shape = shape.unwrap_or_else(|| std::array::from_fn(|k| old[k].get(i) as f32));
            shapes.iter_mut().zip(shape).for_each(|(column, value)| column.push(value));
        }
        Some(shapes)
    }
}

/// Returns the logarithms of the deviations and the rotation (w, x, y, z) of a Gaussian with deviations along axes that
/// need not be perpendicular.
fn ellipsoid(axes: &DMat3, deviations: Vec3) -> [f32; N_SHAPE_COLUMNS] {
    let scaled = [axes.x_axis, axes.y_axis, axes.z_axis];
    let mut covariance = SymmetricMatrix::default();
    for (axis, deviation) in scaled.into_iter().zip(deviations.as_dvec3().to_array()) {
        covariance.add_outer(axis, deviation * deviation);
    }
    let (variances, [x, y, _]) = covariance.eigen();
    let DQuat { x, y, z, w } = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)));
    let [a, b, c] = variances.map(|variance| variance.max(f64::MIN_POSITIVE).ln() / 2.0);
    [a, b, c, w, x, y, z].map(|value| value as f32)
}

fn lengths_of_axes(linear: &DMat3) -> [f64; 3] {
    [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length)
}

#[cfg(test)]
mod tests {
    //! Places, directions and shapes after a transform.

    use super::*;
    use crate::math::Quat;
    use crate::points::ScanStation;

    #[test]
    fn points_are_moved_with_their_normals() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::new(1.0, 2.0, 3.0)]);
        cloud.origin = DVec3::new(500_000.0, 0.0, 0.0);
        cloud.normals = Some(vec![Vec3::new(0.6, 0.0, 0.8)]);
        let moved = DAffine3::from_translation(DVec3::new(0.0, 7.0, 0.0))
            * DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0));
        cloud.transform(&moved);
        assert_eq!(cloud.world_position(0), DVec3::new(500_001.0, 9.0, 6.0));
        let normal = cloud.normals.unwrap()[0];
        assert!((normal - Vec3::new(0.6, 0.0, 0.4).normalize()).length() < 1e-6, "{normal}");
    }

    #[test]
    fn radii_grow_by_the_largest_scale() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        cloud.radii = Some(vec![0.25, 1.0]);
        let scale = DAffine3::from_scale(DVec3::new(1.0, 4.0, -2.0));
        cloud.transform(&(DAffine3::from_rotation_z(0.5) * scale));
        let radii = cloud.radii.unwrap();
        assert!((radii[0] - 1.0).abs() < 1e-6 && (radii[1] - 4.0).abs() < 1e-6, "{radii:?}");
    }

    #[test]
    fn stations_move_and_turn_with_the_points() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X]);
        let position = Some(DVec3::new(1.0, 0.0, 0.0));
        cloud.stations = vec![ScanStation { position, ..Default::default() }, Default::default()];
        let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let moved = DAffine3::from_translation(DVec3::new(100.0, 200.0, 300.0))
            * turn
            * DAffine3::from_scale(DVec3::splat(2.0));
        cloud.transform(&moved);
        let [first, second] = &cloud.stations[..] else { panic!("two stations") };
        assert!(first.position.unwrap().distance(DVec3::new(100.0, 202.0, 300.0)) < 1e-12);
        assert!((first.rotation * DVec3::X).distance(DVec3::Y) < 1e-12);
        assert_eq!(second.position, None);
    }

    /// A Gaussian with these deviations and this rotation, and harmonics of degree 1.
    fn gaussian(deviations: Vec3, rotation: Quat) -> PointCloud {
        let mut cloud = PointCloud::from_positions(vec![Vec3::ONE]);
        let [a, b, c] = deviations.to_array().map(f32::ln);
        let [x, y, z, w] = rotation.to_array();
        let values = [0.0, 0.0, 0.0, 1.0, a, b, c, w, x, y, z];
        let columns = GAUSSIAN_COLUMNS.iter().map(|name| (*name).to_owned()).zip(values);
        for (name, value) in columns.chain((0..9).map(|i| (rest_column(i), 1.0))) {
            cloud.scalars.push(Scalar { name, values: Values::F32(vec![value]) });
        }
        cloud
    }

    #[test]
    fn gaussians_are_turned_and_stretched() {
        let turned = Quat::from_rotation_z(0.4);
        let mut cloud = gaussian(Vec3::new(3.0, 1.0, 0.5), turned);
        let map = DMat3::from_rotation_y(0.7) * DMat3::from_diagonal(DVec3::new(2.0, 1.0, -1.0));
        cloud.transform(&DAffine3::from_mat3(map));
        let shape = GaussianColumns::new(&cloud).unwrap();
        let new = shape.gaussian(0).unwrap();
        // The ellipsoid is the image of the old one: points at one deviation stay there.
        for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
            let old = turned.as_dquat() * (direction * DVec3::new(3.0, 1.0, 0.5));
            let local = new.rotation.as_dquat().inverse() * (map * old);
            let length = (local / new.deviations.as_dvec3()).length();
            assert!((length - 1.0).abs() < 1e-5, "{direction}: {length}");
        }
        assert_eq!(shape.n_harmonics(), 1);
    }

    #[test]
    fn gaussians_that_are_not_turned_keep_their_harmonics() {
        let mut cloud = gaussian(Vec3::new(3.0, 1.0, 0.5), Quat::IDENTITY);
        cloud.transform(&DAffine3::from_scale(DVec3::splat(10.0)));
        let shape = GaussianColumns::new(&cloud).unwrap();
        let deviations = shape.gaussian(0).unwrap().deviations;
        assert!(deviations.distance(Vec3::new(5.0, 10.0, 30.0)) < 1e-4, "{deviations}");
        assert_eq!(shape.n_harmonics(), 4);
    }
}
