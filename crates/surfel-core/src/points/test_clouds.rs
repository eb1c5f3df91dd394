//! Clouds for the tests of this folder.

use super::structure::point_shape::Structure;
use super::{PointCloud, Preparation, PreparedCloud, prepare};
use crate::math::Vec3;
use crate::progress::NoProgress;

/// Returns points prepared by default, and their structures.
pub fn prepared(positions: Vec<Vec3>) -> (PreparedCloud, Vec<Structure>) {
    let cloud = PointCloud::from_positions(positions);
    let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
    let structures = cloud.structures().unwrap();
    (cloud, structures)
}
