//! Areas of the XY plane bounded by polygons.

use crate::error::{Error, Result};
use crate::words::counted;

/// Maximum number of strips into which a polygon, or the area of several, is cut.
const MAX_STRIPS: usize = 4096;
/// Maximum mean number of strips that a side or a polygon reaches into: each takes memory.
const MEAN_STRIPS: f64 = 8.0;

/// A side of a polygon that is not level.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Side {
    /// The lower end.
    low: [f64; 2],
    /// Y of the upper end.
    high_y: f64,
    /// Change of X with Y.
    slope: f64,
}

impl Side {
    /// Returns the side between two corners, or `None` if it is level.
    fn new(a: [f64; 2], b: [f64; 2]) -> Option<Self> {
        let [low, high] = if a[1] < b[1] { [a, b] } else { [b, a] };
        let slope = (high[0] - low[0]) / (high[1] - low[1]);
        (low[1] < high[1]).then_some(Self { low, high_y: high[1], slope })
    }

    fn y_range(&self) -> [f64; 2] {
        [self.low[1], self.high_y]
    }

    /// Returns true if a ray from a position along +X crosses the side.
    fn crosses(&self, [x, y]: [f64; 2]) -> bool {
        let spans_y = self.low[1] <= y && y < self.high_y;
        spans_y && x < self.low[0] + (y - self.low[1]) * self.slope
    }
}

/// Ranges of Y by the strips of equal height that they reach into.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Strips {
    /// Least and greatest Y of all ranges.
    y_range: [f64; 2],
    /// Indices of the ranges that reach into each strip.
    pub indices: Vec<Vec<u32>>,
}

impl Strips {
    /// Sorts ranges into strips. Those whose end lies below their start are in none.
    pub fn new(ranges: &[[f64; 2]]) -> Self {
        let filled = || ranges.iter().filter(|[low, high]| low <= high);
        let low = filled().map(|[low, _]| *low).fold(f64::INFINITY, f64::min);
        let high = filled().map(|[_, high]| *high).fold(f64::NEG_INFINITY, f64::max);
        let height = filled().map(|[low, high]| high - low).sum::<f64>();
        let most = MEAN_STRIPS * (high - low) * filled().count() as f64 / height;
        let n_strips = ranges.len().min(MAX_STRIPS).min(most as usize).max(1);
        let mut strips = Self { y_range: [low, high], indices: vec![Vec::new(); n_strips] };
        for (i, [low, high]) in (0..).zip(ranges) {
            if low <= high {
                for strip in strips.index_at(*low)..=strips.index_at(*high) {
                    strips.indices[strip].push(i);
                }
            }
        }
        strips
    }

    /// Returns the strip of a Y within `y_range`. It never falls as Y grows.
    fn index_at(&self, y: f64) -> usize {
        let [low, high] = self.y_range;
        let strip = (y - low) / (high - low) * self.indices.len() as f64;
        (strip as usize).min(self.indices.len() - 1)
    }

    /// Returns the indices of the ranges that may contain a Y.
    fn at(&self, y: f64) -> &[u32] {
        let is_within = self.y_range[0] <= y && y <= self.y_range[1];
        if is_within { &self.indices[self.index_at(y)] } else { &[] }
    }
}

/// A polygon with holes: a point is inside if a line from it to infinity crosses the rings an odd number of times.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Polygon {
    /// Sides; level ones bound nothing.
    sides: Vec<Side>,
    /// Least and greatest X of all corners.
    x_range: [f64; 2],
    strips: Strips,
}

impl Polygon {
    /// Makes a polygon of rings, which are closed if they are not yet.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a ring of fewer than three corners, for corners that are not finite, and without
    /// rings.
    pub fn new(rings: &[Vec<[f64; 2]>]) -> Result<Self> {
        let fail = |found: String| Error::Setting {
            name: "polygon",
            found,
            expected: "rings of at least three finite corners",
        };
        if rings.is_empty() {
            return Err(fail("no ring".to_owned()));
        }
        let mut sides = Vec::new();
        for ring in rings {
            if let Some([x, y]) = ring.iter().find(|corner| !corner.iter().all(|c| c.is_finite())) {
                return Err(fail(format!("the corner {x} {y}")));
            }
            let is_closed = ring.first() == ring.last();
            let n_corners = ring.len() - usize::from(is_closed && !ring.is_empty());
            if n_corners < 3 {
                return Err(fail(format!("a ring of {}", counted(n_corners, "corner"))));
            }
            let next = ring.iter().cycle().skip(1);
            sides.extend(ring.iter().zip(next).filter_map(|(a, b)| Side::new(*a, *b)));
        }
        let xs = rings.iter().flatten().map(|[x, _]| *x);
        let x_range =
            [xs.clone().fold(f64::INFINITY, f64::min), xs.fold(f64::NEG_INFINITY, f64::max)];
        let strips = Strips::new(&sides.iter().map(Side::y_range).collect::<Vec<_>>());
        Ok(Self { sides, x_range, strips })
    }

    /// Returns true if the polygon contains a position.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        if !(self.x_range[0] <= x && x <= self.x_range[1]) {
            return false;
        }
        let crosses = |side: &&u32| self.sides[**side as usize].crosses([x, y]);
        self.strips.at(y).iter().filter(crosses).count() % 2 == 1
    }
}

/// Polygons of an area, of which any number may overlap.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Polygons {
    polygons: Vec<Polygon>,
    strips: Strips,
}

impl Polygons {
    /// Sorts polygons by where they lie.
    pub fn new(polygons: Vec<Polygon>) -> Self {
        let ranges: Vec<[f64; 2]> = polygons.iter().map(|polygon| polygon.strips.y_range).collect();
        Self { strips: Strips::new(&ranges), polygons }
    }

    /// Returns the number of the polygons.
    pub fn len(&self) -> usize {
        self.polygons.len()
    }

    /// Returns true if one of the polygons contains a position.
    pub fn contain(&self, position: [f64; 2]) -> bool {
        let near = self.strips.at(position[1]).iter();
        near.map(|i| &self.polygons[*i as usize]).any(|polygon| polygon.contains(position))
    }
}

#[cfg(test)]
mod tests {
    //! Positions inside and outside of polygons, and polygons that are none.

    use super::*;
    use crate::math::Random;

    #[test]
    fn holes_and_bays_are_outside() {
        let outline = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0], [0.0, 0.0]];
        let hole = vec![[0.5, 0.5], [1.0, 0.5], [0.5, 1.0]];
        let polygon = Polygon::new(&[outline, hole]).unwrap();
        for inside in [[0.1, 3.0], [3.9, 3.0], [2.0, 0.9], [0.9, 0.9]] {
            assert!(polygon.contains(inside), "{inside:?}");
        }
        for outside in [[2.0, 1.1], [0.6, 0.6], [-0.1, 1.0], [4.1, 1.0], [2.0, 4.1], [2.0, -0.1]] {
            assert!(!polygon.contains(outside), "{outside:?}");
        }
        assert!(!polygon.contains([f64::NAN, 1.0]) && !polygon.contains([1.0, f64::NAN]));
    }

    #[test]
    fn strips_change_no_result() {
        let mut random = Random::new(4, 0);
        let mut next = || f64::from(random.next_f32());
        let ring: Vec<[f64; 2]> = (0..300).map(|_| [next(), next()]).collect();
        let polygon = Polygon::new(&[ring]).unwrap();
        let mut one_strip = polygon.clone();
        one_strip.strips.indices = vec![(0..polygon.sides.len() as u32).collect()];
        let positions: Vec<[f64; 2]> = (0..5000).map(|_| [next(), next()]).collect();
        let n_inside = positions.iter().filter(|position| polygon.contains(**position)).count();
        assert!((1000..4000).contains(&n_inside), "{n_inside}");
        assert!(positions.iter().all(|p| polygon.contains(*p) == one_strip.contains(*p)));
    }

    #[test]
    fn tall_sides_take_little_memory() {
        let comb: Vec<[f64; 2]> = (0..20_000).map(|i| [f64::from(i), f64::from(i % 2)]).collect();
        let polygon = Polygon::new(&[comb]).unwrap();
        let n_entries: usize = polygon.strips.indices.iter().map(Vec::len).sum();
        assert!(n_entries < 10 * 20_000, "{n_entries}");
        assert!(polygon.contains([1000.0, 0.5 + 1e-9]) != polygon.contains([1001.0, 0.5 + 1e-9]));
    }

    #[test]
    fn a_position_is_compared_with_few_of_many_polygons() {
        let mut random = Random::new(5, 0);
        let mut next = || f64::from(random.next_f32());
        let mut footprint = || {
            let [x, y] = [100.0 * next(), 100.0 * next()];
            let ring = vec![[x, y], [x + 1.0, y], [x + 1.0, y + 0.5], [x, y + 1.0]];
            Polygon::new(&[ring]).unwrap()
        };
        let mut polygons: Vec<Polygon> = (0..2000).map(|_| footprint()).collect();
        polygons.push(Polygon::new(&[vec![[0.0, 7.0], [9.0, 7.0], [5.0, 7.0]]]).unwrap());
        let all = Polygons::new(polygons.clone());
        let most = all.strips.indices.iter().map(Vec::len).max().unwrap();
        assert!(most < 100, "{most}");
        for _ in 0..2000 {
            let position = [102.0 * next() - 1.0, 102.0 * next() - 1.0];
            let expected = polygons.iter().any(|polygon| polygon.contains(position));
            assert_eq!(all.contain(position), expected, "{position:?}");
        }
        assert!(!Polygons::new(Vec::new()).contain([0.0, 0.0]));
    }

    #[test]
    fn broken_rings_are_rejected() {
        let message = |rings: &[Vec<[f64; 2]>]| Polygon::new(rings).unwrap_err().to_string();
        assert!(message(&[]).contains("no ring"));
        assert!(message(&[vec![]]).contains("a ring of 0 corners"));
        assert!(
            message(&[vec![[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]).contains("a ring of 2 corners")
        );
        let infinite = vec![[0.0, 0.0], [1.0, f64::INFINITY], [1.0, 0.0]];
        assert!(message(&[infinite]).contains("the corner 1 inf"));
        let level = Polygon::new(&[vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]]).unwrap();
        assert!(!level.contains([1.0, 0.0]));
    }
}
