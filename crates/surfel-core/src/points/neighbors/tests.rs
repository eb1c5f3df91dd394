//! Every method finds the same neighbours as a brute-force search, to the bit and in the same order.

use super::neighbor::{checked_square, distance_squared};
use super::*;
use crate::math::Random;
use crate::progress::NoProgress;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

fn brute_force(positions: &[Vec3], neighborhood: Neighborhood) -> Vec<Vec<Neighbor>> {
    let neighbors_of = |point: usize| {
        let others = (0..positions.len()).filter(|&other| other != point);
        let mut all: Vec<Neighbor> = others
            .map(|other| Neighbor {
                index: other as u32,
                distance_squared: distance_squared(positions[other], positions[point]),
            })
            .filter(|neighbor| !neighbor.distance_squared.is_nan())
            .filter(|neighbor| positions[neighbor.index as usize].is_finite())
            .collect();
        all.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
        match neighborhood {
            Neighborhood::Nearest(k) => all.truncate(k),
            Neighborhood::Within(d) => all.retain(|neighbor| neighbor.distance_squared <= d * d),
        }
        if positions[point].is_finite() { all } else { Vec::new() }
    };
    (0..positions.len()).map(neighbors_of).collect()
}

fn found(
    positions: &[Vec3],
    method: NeighborMethod,
    neighborhood: Neighborhood,
) -> Vec<Vec<Neighbor>> {
    let lists = Mutex::new(vec![Vec::new(); positions.len()]);
    let visited =
        map_neighborhoods(positions, method, neighborhood, &NoProgress, |point, neighbors| {
            lists.lock().unwrap()[point] = neighbors.to_vec();
            point
        });
    assert!(
        visited.unwrap().into_iter().eq(0..positions.len()),
        "values are in the order of the points"
    );
    lists.into_inner().unwrap()
}

fn points(n_points: usize, mut sample: impl FnMut(&mut Random) -> Vec3) -> Vec<Vec3> {
    let mut random = Random::new(11, n_points as u64);
    (0..n_points).map(|_| sample(&mut random)).collect()
}

fn in_a_box(random: &mut Random) -> Vec3 {
    10.0 * Vec3::new(random.next_f32(), random.next_f32(), random.next_f32())
}

fn clouds() -> Vec<(&'static str, Vec<Vec3>)> {
    let mut lattice = Vec::new();
    for i in 0..1000 {
        lattice.push(Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32));
    }
    let mut with_outliers = points(500, in_a_box);
    with_outliers.extend([Vec3::new(1e3, 2e3, -1e3), Vec3::splat(1e15), Vec3::X * -1e19]);
    let mut with_nan = points(100, in_a_box);
    with_nan[7].y = f32::NAN;
    with_nan[50].x = f32::INFINITY;
    let mut twice = points(200, in_a_box);
    twice.extend_from_within(..);
    vec![
        ("empty", Vec::new()),
        ("one", vec![Vec3::ONE]),
        ("two", vec![Vec3::ONE, Vec3::X]),
        ("equal", vec![Vec3::splat(3.0); 300]),
        ("line", points(300, |random| Vec3::X * 10.0 * random.next_f32())),
        ("lattice", lattice),
        ("random", points(1500, in_a_box)),
        ("plane", points(1500, |random| in_a_box(random) * Vec3::new(1.0, 1.0, 0.0))),
        ("far away", points(400, |random| in_a_box(random) + Vec3::splat(5e5))),
        ("far in one direction", points(900, |r| in_a_box(r) + Vec3::X * 4e6)),
        ("huge", points(400, |random| 1e18 * in_a_box(random))),
        ("vanishing squares", points(400, |random| 1e-22 * in_a_box(random))),
        ("tiny", points(400, |random| 1e-15 * in_a_box(random))),
        ("outliers", with_outliers),
        ("not finite", with_nan),
        ("twice", twice),
        ("zeros", vec![Vec3::ZERO, -Vec3::ZERO, Vec3::X, -Vec3::X]),
    ]
}

#[test]
fn nearest_equals_a_brute_force_search() {
    for (name, positions) in clouds() {
        for k in [1, 2, 7, 16, 47, 48, 200] {
            let neighborhood = Neighborhood::Nearest(k);
            assert_eq!(
                found(&positions, NeighborMethod::Knn, neighborhood),
                brute_force(&positions, neighborhood),
                "{name}, k = {k}"
            );
        }
    }
}

#[test]
fn nearest_to_single_positions_equal_a_brute_force_search() {
    for (name, positions) in clouds() {
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        for k in [1, 16, 47, 48, 100, 192] {
            let expected = brute_force(&positions, Neighborhood::Nearest(k));
            for (point, expected) in expected.iter().enumerate().step_by(7) {
                let found = tree.nearest(positions[point], k, Some(point as u32));
                assert_eq!(found, *expected, "{name}, k = {k}, point {point}");
            }
        }
    }
}

#[test]
fn the_nearest_within_a_distance_are_the_nearest_up_to_it() {
    for (name, positions) in clouds() {
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        for (point, position) in positions.iter().enumerate().step_by(7) {
            let mut expected = tree.nearest(*position, 16, None);
            let middle = expected.get(8).map_or(1.0, |neighbor| neighbor.distance_squared.sqrt());
            expected.retain(|neighbor| neighbor.distance_squared <= middle * middle);
            let found = tree.nearest_within(*position, 16, middle);
            assert_eq!(found, expected, "{name}, point {point}");
        }
    }
}

#[test]
fn within_equals_a_brute_force_search_by_every_method() {
    for (name, positions) in clouds() {
        let bounds = positions.iter().filter(|p| p.is_finite()).copied();
        let size = crate::math::Aabb::of_points(bounds).diagonal().min(1e18);
        for distance in [1.0, 2.0, 1e-3 * size, 0.1 * size, 0.7 * size] {
            if checked_square(distance).is_err() {
                continue;
            }
            let neighborhood = Neighborhood::Within(distance);
            let expected = brute_force(&positions, neighborhood);
            for method in [NeighborMethod::Grid, NeighborMethod::ScanLine, NeighborMethod::Knn] {
                let found = found(&positions, method, neighborhood);
                assert_eq!(found, expected, "{name}, {method}, distance {distance}");
            }
        }
    }
}

#[test]
fn an_outlier_makes_the_scan_line_fall_back_to_the_grid() {
    struct Notes(Mutex<Vec<String>>);
    impl Progress for Notes {
        fn note(&self, line: &str) {
            self.0.lock().unwrap().push(line.to_owned());
        }
    }
    let notes = Notes(Mutex::default());
    let mut positions = points(2000, in_a_box);
    let count = |positions: &[Vec3], method| {
        let neighborhood = Neighborhood::Within(0.5);
        map_neighborhoods(positions, method, neighborhood, &notes, |_, neighbors| neighbors.len())
    };
    assert_eq!(
        count(&positions, NeighborMethod::ScanLine),
        count(&positions, NeighborMethod::Grid)
    );
    assert!(notes.0.lock().unwrap().is_empty());
    positions.push(Vec3::new(1000.0, 1000.0, 1001.0));
    assert_eq!(
        count(&positions, NeighborMethod::ScanLine),
        count(&positions, NeighborMethod::Grid)
    );
    let notes = notes.0.into_inner().unwrap();
    assert!(notes.len() == 1 && notes[0].ends_with("grid used instead"), "{notes:?}");
}

#[test]
fn single_searches_agree_with_the_search_for_all() {
    for (name, positions) in clouds() {
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        let expected = brute_force(&positions, Neighborhood::Nearest(5));
        for (point, expected) in expected.iter().enumerate() {
            let neighbors = tree.nearest(positions[point], 5, Some(point as u32));
            assert_eq!(&neighbors, expected, "{name}, point {point}");
        }
    }
}

#[test]
fn many_equal_points_do_not_take_quadratic_time() {
    let mut positions = vec![Vec3::splat(3.0); 200_000];
    positions.extend(points(1000, in_a_box));
    let last = map_neighborhoods(
        &positions,
        NeighborMethod::Knn,
        Neighborhood::Nearest(16),
        &NoProgress,
        |_, neighbors| neighbors[15],
    );
    assert_eq!(last.unwrap()[100_000], Neighbor { index: 15, distance_squared: 0.0 });
}

#[test]
fn invalid_queries_are_errors() {
    let positions = points(10, in_a_box);
    let error = |method, neighborhood| {
        map_neighborhoods(&positions, method, neighborhood, &NoProgress, |_, _| ())
            .unwrap_err()
            .to_string()
    };
    for method in [NeighborMethod::Grid, NeighborMethod::ScanLine, NeighborMethod::Knn] {
        for distance in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-30, 1e30] {
            assert!(error(method, Neighborhood::Within(distance)).contains("between"));
        }
    }
    assert!(error(NeighborMethod::Grid, Neighborhood::Nearest(3)).ends_with("found grid"));
    assert!(error(NeighborMethod::Knn, Neighborhood::Nearest(0)).contains("at least 1"));
    assert!("kdtree".parse::<NeighborMethod>().is_err());
    assert_eq!("scan-line".parse::<NeighborMethod>().unwrap(), NeighborMethod::ScanLine);
}

#[test]
fn cancellation_stops_every_method() {
    struct AfterSome(AtomicUsize);
    impl Progress for AfterSome {
        fn is_cancelled(&self) -> bool {
            100 < self.0.fetch_add(1, Ordering::Relaxed)
        }
    }
    let positions = points(20_000, in_a_box);
    for method in [NeighborMethod::Grid, NeighborMethod::ScanLine, NeighborMethod::Knn] {
        let progress = AfterSome(AtomicUsize::new(0));
        let neighborhood = Neighborhood::Within(0.5);
        let result = map_neighborhoods(&positions, method, neighborhood, &progress, |_, _| ());
        assert_eq!(result, Err(Error::Cancelled));
    }
}
