//! Front sides of a scene of many objects that touch, scanned from several stations.

use surfel_core::points::{
    Orientation, POINT_SOURCE, Preparation, StructureChoice, Values, prepare,
};
use surfel_core::progress::NoProgress;
use surfel_scanner::ruin;

/// Columns stand on a floor, and the floor on the ground, with sharp edges between them.
#[test]
fn a_spanning_tree_finds_the_sides_of_a_ruin_that_its_stations_saw() {
    let cloud = ruin::scan(200_000, &NoProgress).unwrap();
    let preparation = Preparation {
        orientation: Orientation::SpanningTree,
        structure: StructureChoice::Surface,
        ..Preparation::default()
    };
    let cloud = prepare(cloud, &preparation, &NoProgress).unwrap().0.into_inner();
    let stations = ruin::stations();
    let Some(Values::U16(station_numbers)) = cloud.scalar(POINT_SOURCE) else { unreachable!() };
    let (classes, normals) =
        (cloud.classification.as_ref().unwrap(), cloud.normals.as_ref().unwrap());
    let fraction_seen = |class: u8| {
        let points = (0..normals.len()).filter(|i| classes[*i] == class);
        let is_seen = |i: &usize| {
            let station = stations[usize::from(station_numbers[*i]) - 1].position;
            let position = cloud.origin - ruin::UTM_ORIGIN + cloud.positions[*i].as_dvec3();
            0.0 < (station - position).dot(normals[*i].as_dvec3())
        };
        points.clone().filter(is_seen).count() as f64 / points.count() as f64
    };
    let fractions = [2, 4, 6].map(fraction_seen);
    let [ground, plants, masonry] = fractions;
    assert!(0.995 < ground && 0.98 < plants && 0.97 < masonry, "{fractions:?}");
}
