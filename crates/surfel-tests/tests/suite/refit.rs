//! Moved points in the tree they had: the same bytes if they have not moved, the same hits if they have;
//! and a word where it does not serve.

use crate::build::flat;
use crate::plain::Plain;
use surfel::flat::{FlatCloud, REBUILD_COST, Refit};
use surfel::math::{Quat, Random, Vec3};
use surfel::points::PointCloud;
use surfel::surface::SurfaceKind;
use surfel_tests::{clouds, scenes};

const KINDS: [SurfaceKind; 3] = [SurfaceKind::Sphere, SurfaceKind::Disc, SurfaceKind::SplatFit];

fn cloud() -> PointCloud {
    scenes::points(clouds::sphere(5000, 1.0), SurfaceKind::Disc).cloud
}

/// Turned about Z by so much for each unit of height.
fn twisted(mut cloud: PointCloud, turn_rad: f32) -> PointCloud {
    let normals = cloud.normals.iter_mut().flatten();
    for (position, normal) in cloud.positions.iter_mut().zip(normals) {
        let turn = Quat::from_rotation_z(turn_rad * position.z);
        (*position, *normal) = (turn * *position, turn * *normal);
    }
    cloud
}

/// Moved by so many radii at random.
fn scattered(mut cloud: PointCloud, by_radii: f32) -> PointCloud {
    let mut random = Random::new(31, 0);
    let mut gaussian = || random.next_gaussian() as f32;
    for (position, radius) in cloud.positions.iter_mut().zip(cloud.radii.iter().flatten()) {
        *position += by_radii * radius * Vec3::new(gaussian(), gaussian(), gaussian());
    }
    cloud
}

fn refit(scene: &mut FlatCloud, cloud: &PointCloud) -> Refit {
    let colors = vec![[188; 3]; cloud.len()];
    scene.points.refit(cloud, scene.surface, &colors).unwrap()
}

fn same_bytes(a: &FlatCloud, b: &FlatCloud) -> bool {
    let (a, b) = (&a.points, &b.points);
    a.nodes == b.nodes && a.blocks == b.blocks && a.ids == b.ids && a.cost == b.cost
}

#[test]
fn points_that_have_not_moved_give_the_same_bytes() {
    for kind in KINDS {
        let mut scene = flat(cloud(), kind);
        let before = scene.clone();
        assert_eq!(refit(&mut scene, &cloud()), Refit::Kept { cost_ratio: 1.0 });
        assert!(same_bytes(&scene, &before));
    }
}

#[test]
fn moved_points_are_hit_where_they_are() {
    let rays = scenes::random_rays(400, 1.2, 32);
    for kind in KINDS {
        let mut scene = flat(cloud(), kind);
        let moved = twisted(cloud(), 0.4);
        assert!(matches!(refit(&mut scene, &moved), Refit::Kept { .. }), "{kind:?}");
        scene.points.validate(kind);
        Plain::new(&scene, rays.clone()).check_in_order("twisted");
        // And back.
        refit(&mut scene, &cloud());
        assert!(same_bytes(&scene, &flat(cloud(), kind)));
    }
}

#[test]
fn cost_grows_with_scatter_until_the_tree_is_unfit() {
    let built = flat(cloud(), SurfaceKind::Disc);
    let mut last = 1.0;
    for by_radii in [0.1, 0.2, 0.3, 0.4] {
        let Refit::Kept { cost_ratio } = refit(&mut built.clone(), &scattered(cloud(), by_radii))
        else {
            panic!("unfit at {by_radii}");
        };
        assert!(last < cost_ratio && cost_ratio <= REBUILD_COST, "{cost_ratio} at {by_radii}");
        last = cost_ratio;
    }
    let mut scene = built.clone();
    assert_eq!(refit(&mut scene, &scattered(cloud(), 3.0)), Refit::Unfit);
    // And back.
    assert_eq!(refit(&mut scene, &cloud()), Refit::Kept { cost_ratio: 1.0 });
    assert!(same_bytes(&scene, &built));
}

#[test]
fn a_block_that_has_lost_its_precision_is_unfit() {
    let mut scene = flat(cloud(), SurfaceKind::Disc);
    let mut moved = cloud();
    moved.radii.as_mut().unwrap()[7] *= 0.01;
    assert_eq!(refit(&mut scene, &moved), Refit::Unfit);
}

#[test]
fn where_points_come_or_go_the_tree_is_unfit() {
    let mut gone = cloud();
    gone.positions[7].x = f32::NAN;
    let mut scene = flat(cloud(), SurfaceKind::Disc);
    assert_eq!(refit(&mut scene, &gone), Refit::Unfit);
    let mut scene = flat(gone.clone(), SurfaceKind::Disc);
    assert_eq!(refit(&mut scene, &gone), Refit::Kept { cost_ratio: 1.0 });
    assert_eq!(refit(&mut scene, &cloud()), Refit::Unfit);
}
