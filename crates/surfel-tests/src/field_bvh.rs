//! The field of weighted planes searched through the bounding volume hierarchy of the points, in place of its kd-tree.
//!
//! The kd-tree of Wald and Seidel (2005) tells in which cells the field has a zero. The search here knows only which
//! supports a ray enters, nearest first, and steps through their union.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use surfel_core::bvh::{BvhNode, Child, NO_PRIMITIVE, refit_boxes};
use surfel_core::flat::{FlatCloud, FlatPoints};
use surfel_core::math::{Aabb, LANES, Ray, Vec3, clip_to_box, finite_inverse_vec3};
use surfel_core::surface::{FIELD_SUPPORT, FieldPoint, FieldSums};

/// Length of a step along a ray, in supports. The field is taken for linear between its ends.
const STEP: f32 = 1.0 / 32.0;

/// The hierarchy of a cloud's points with boxes around their supports.
pub struct FieldBvh<'c> {
    points: &'c FlatPoints,
    nodes: Vec<BvhNode>,
}

/// Evaluations of searches.
#[derive(Clone, Copy, Debug, Default)]
pub struct SearchCounts {
    /// Nodes whose children are tested.
    pub nodes: usize,
    /// Supports that are tested.
    pub supports: usize,
    /// Points in sums of the field.
    pub terms: usize,
}

/// A child or a support, which a ray enters.
#[derive(Clone, Copy)]
enum Entered {
    Child(Child),
    Support { point: FieldPoint, leave: f32 },
}

/// The distance at which a ray enters something.
struct Entry {
    enter: f32,
    what: Entered,
}

impl<'c> FieldBvh<'c> {
    /// Fits the boxes of a cloud's hierarchy to the supports.
    pub fn new(cloud: &'c FlatCloud) -> Self {
        let points = &cloud.points;
        let mut nodes = points.nodes.clone();
        refit_boxes(&mut nodes, |block| {
            let boxes = block_points(points, block).map(|point| Aabb {
                min: point.center - point.support,
                max: point.center + point.support,
            });
            boxes.fold(Aabb::EMPTY, Aabb::union)
        });
        Self { points, nodes }
    }

    /// Returns the distance of the first zero along a ray at which the field grows along the normals.
    pub fn first_zero(&self, ray: &Ray, counts: &mut SearchCounts) -> Option<f32> {
        let mut entries = BinaryHeap::new();
        if !self.nodes.is_empty() {
            let what = Entered::Child(Child::Node(0));
            entries.push(Reverse(Entry { enter: f32::NEG_INFINITY, what }));
        }
        let mut supports: Vec<(FieldPoint, f32)> = Vec::new();
        let mut start = f32::NEG_INFINITY;
        loop {
            if supports.is_empty() {
                // Between supports there is nothing to step through.
                start = start.max(self.open_next(ray, &mut entries, &mut supports, counts)?);
                continue;
            }
            let end = start + STEP * supports[0].0.support;
            while entries.peek().is_some_and(|Reverse(entry)| entry.enter <= end) {
                self.open_next(ray, &mut entries, &mut supports, counts);
            }
            counts.terms += 2 * supports.len();
            let points = supports.iter().map(|(point, _)| point);
            let zero = zero_between(points, ray, [start, end]);
            if let Some(zero) = zero.filter(|zero| ray.t_min <= *zero && *zero <= ray.t_max) {
                return Some(zero);
            }
            start = end;
            supports.retain(|(_, leave)| start <= *leave);
        }
    }

    /// Takes the nearest entry: puts what a child has among the entries, and a support among `supports`. Returns its distance,
    /// or none without an entry.
    fn open_next(
        &self,
        ray: &Ray,
        entries: &mut BinaryHeap<Reverse<Entry>>,
        supports: &mut Vec<(FieldPoint, f32)>,
        counts: &mut SearchCounts,
    ) -> Option<f32> {
        let Reverse(Entry { enter, what }) = entries.pop()?;
        match what {
            Entered::Support { point, leave } => supports.push((point, leave)),
            Entered::Child(Child::Node(node)) => {
                counts.nodes += 1;
                let node = &self.nodes[node as usize];
                let children = (0..LANES).filter_map(|lane| Some((lane, node.child(lane)?)));
                entries.extend(children.filter_map(|(lane, child)| {
                    let (enter, leave) = interval_in_box(ray, &node.bounds(lane));
                    (enter <= leave)
                        .then_some(Reverse(Entry { enter, what: Entered::Child(child) }))
                }));
            }
            Entered::Child(Child::Block(block)) => {
                let points = block_points(self.points, block);
                entries.extend(points.filter_map(|point| {
                    counts.supports += 1;
                    let (enter, leave) = interval_in_support(ray, &point)?;
                    let what = Entered::Support { point, leave };
                    Some(Reverse(Entry { enter, what }))
                }));
            }
        }
        Some(enter)
    }
}

/// Returns the support of the point at a slot.
pub fn field_point(points: &FlatPoints, slot: u32) -> FieldPoint {
    FieldPoint {
        center: points.center(slot),
        normal: points.normal(slot),
        support: FIELD_SUPPORT * points.radius(slot),
    }
}

/// Returns the zero between two distances along a ray, between which the field of some points is linear, if the field
/// grows along the normals there.
pub fn zero_between<'p>(
    points: impl Iterator<Item = &'p FieldPoint> + Clone,
    ray: &Ray,
    [start, end]: [f32; 2],
) -> Option<f32> {
    let middle = ray.at(0.5 * (start + end));
    let distance = |point: &FieldPoint| point.center.distance_squared(middle);
    let guide = points.clone().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let at = |t: f32| field_at(points.clone(), guide, ray.at(t));
    let ((Some(a), normals), (Some(b), _)) = (at(start), at(end)) else { return None };
    let is_surface = 0.0 <= normals.dot(ray.direction) * (b - a);
    ((0.0 < a) != (0.0 < b) && is_surface).then(|| start + (end - start) * a / (a - b))
}

/// Returns the field of some points at a position, if it has a value, and the sum of their weighted normals. Normals are
/// turned to the side of the guide's.
fn field_at<'p>(
    points: impl Iterator<Item = &'p FieldPoint>,
    guide: &FieldPoint,
    position: Vec3,
) -> (Option<f32>, Vec3) {
    let (mut sums, mut normals) = (FieldSums::new(), Vec3::ZERO);
    for point in points {
        let normal = if point.is_flipped(guide) { -point.normal } else { point.normal };
        let offset = position - point.center;
        let inside = 1.0 - (offset.length() / point.support).powi(2);
        let weight = inside.max(0.0).powi(4);
        sums.add(weight, normal.dot(offset));
        normals += weight * normal;
    }
    let (value, has_value) = sums.value();
    (has_value.then_some(value), normals)
}

fn block_points(points: &FlatPoints, block: u32) -> impl Iterator<Item = FieldPoint> {
    let slots = block * LANES as u32..(block + 1) * LANES as u32;
    let is_used = |slot: &u32| points.ids[*slot as usize] != NO_PRIMITIVE;
    slots.filter(is_used).map(|slot| field_point(points, slot))
}

fn interval_in_box(ray: &Ray, bounds: &Aabb) -> (f32, f32) {
    let inverse = Vec3::from(finite_inverse_vec3(ray.direction.into())).to_array();
    let line = (f32::NEG_INFINITY, f32::INFINITY);
    let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
    clip_to_box(line, &ray.origin.to_array(), &inverse, &min, &max)
}

fn interval_in_support(ray: &Ray, point: &FieldPoint) -> Option<(f32, f32)> {
    let along = (point.center - ray.origin).dot(ray.direction);
    let squared = point.support.powi(2) - ray.at(along).distance_squared(point.center);
    (0.0 < squared).then(|| (along - squared.sqrt(), along + squared.sqrt()))
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.enter.total_cmp(&other.enter)
    }
}
