//! What moves: tracks of keys after glTF 2.0, orbits and paths.

use super::graph::{Graph, Transform};
use crate::math::{DQuat, DVec3};
use std::f64::consts::TAU;

/// Channels that change nodes over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    pub channels: Vec<Channel>,
}

/// One property of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub node: usize,
    pub track: Track,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    Translation(Keys<DVec3>),
    Rotation(Keys<DQuat>),
    Scale(Keys<DVec3>),
    MorphWeights(Keys<Vec<f32>>),
    /// Never between keys: each holds until the next.
    Visible(Keys<bool>),
}

/// Values at times; before the first and after the last they hold still.
#[derive(Clone, Debug, PartialEq)]
pub struct Keys<T> {
    /// Rising.
    pub times_secs: Vec<f64>,
    /// One a time; for `Interpolation::Cubic` three: arriving tangent, value, leaving tangent.
    pub values: Vec<T>,
    pub interpolation: Interpolation,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    Step,
    #[default]
    Linear,
    /// Slow at each key.
    Ease,
    /// Hermite splines with given tangents, as in glTF.
    Cubic,
}

impl Animation {
    /// Takes in `other`, whose nodes now begin at `first_node`.
    pub fn append(&mut self, other: Self, first_node: usize) {
        self.channels.extend(other.channels.into_iter().map(|mut channel| {
            channel.node += first_node;
            channel
        }));
    }

    /// When the last key is reached.
    pub fn duration_secs(&self) -> f64 {
        let ends = self.channels.iter().filter_map(|channel| channel.track.times_secs().last());
        ends.copied().fold(0.0, f64::max)
    }
}

impl Track {
    pub fn times_secs(&self) -> &[f64] {
        match self {
            Self::Translation(keys) | Self::Scale(keys) => &keys.times_secs,
            Self::Rotation(keys) => &keys.times_secs,
            Self::MorphWeights(keys) => &keys.times_secs,
            Self::Visible(keys) => &keys.times_secs,
        }
    }
}

impl Graph {
    /// Sets the nodes to where the animation has them at a time.
    pub fn pose(&mut self, time_secs: f64) {
        let Self { nodes, animation, .. } = self;
        for Channel { node, track } in &animation.channels {
            let node = &mut nodes[*node];
            match track {
                Track::MorphWeights(keys) => node.morph_weights = keys.at(time_secs),
                Track::Visible(keys) => node.is_visible = keys.at(time_secs),
                Track::Translation(keys) => *parts(&mut node.transform).0 = keys.at(time_secs),
                Track::Rotation(keys) => *parts(&mut node.transform).1 = keys.at(time_secs),
                Track::Scale(keys) => *parts(&mut node.transform).2 = keys.at(time_secs),
            }
        }
    }
}

/// Translation, rotation and scale of a transform; a matrix is taken apart.
fn parts(transform: &mut Transform) -> (&mut DVec3, &mut DQuat, &mut DVec3) {
    if let Transform::Matrix(matrix) = transform {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        *transform = Transform::Parts { translation, rotation, scale };
    }
    match transform {
        Transform::Parts { translation, rotation, scale } => (translation, rotation, scale),
        Transform::Matrix(_) => unreachable!("taken apart above"),
    }
}

/// What keys can hold.
pub trait Value: Clone {
    /// Between `self` at 0 and `other` at 1.
    fn mix(&self, other: &Self, share: f64) -> Self;

    /// Hermite spline over a span of `secs` from `self`, leaving at rate `leaving`, to `other`, reached at
    /// rate `arriving`.
    fn spline(&self, leaving: &Self, other: &Self, arriving: &Self, share: f64, secs: f64) -> Self;
}

impl<T: Value> Keys<T> {
    /// The value at a time. Needs a key at least.
    pub fn at(&self, time_secs: f64) -> T {
        let next = self.times_secs.partition_point(|&time| time <= time_secs);
        let Some(last) = next.checked_sub(1) else { return self.value(0).clone() };
        if next == self.times_secs.len() {
            return self.value(last).clone();
        }
        let (from, to) = (self.times_secs[last], self.times_secs[next]);
        let (secs, share) = (to - from, (time_secs - from) / (to - from));
        let (start, end) = (self.value(last), self.value(next));
        match self.interpolation {
            Interpolation::Step => start.clone(),
            Interpolation::Linear => start.mix(end, share),
            Interpolation::Ease => start.mix(end, share * share * (3.0 - 2.0 * share)),
            Interpolation::Cubic => {
                let (leaving, arriving) = (&self.values[3 * last + 2], &self.values[3 * next]);
                start.spline(leaving, end, arriving, share, secs)
            }
        }
    }

    fn value(&self, key: usize) -> &T {
        match self.interpolation {
            Interpolation::Cubic => &self.values[3 * key + 1],
            _ => &self.values[key],
        }
    }
}

impl Keys<DVec3> {
    /// The same keys with a smooth way between them (Catmull and Rom 1974): at each key the rate is that from
    /// the key before to the one after.
    pub fn smoothed(self) -> Self {
        let Self { times_secs, values, .. } = self;
        let last = values.len().saturating_sub(1);
        let rate = |i: usize| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let secs = times_secs[after] - times_secs[before];
            if 0.0 < secs { (values[after] - values[before]) / secs } else { DVec3::ZERO }
        };
        let values = (0..values.len()).flat_map(|i| [rate(i), values[i], rate(i)]).collect();
        Self { times_secs, values, interpolation: Interpolation::Cubic }
    }
}

/// Through two places or more, in so many seconds, at a speed that is even from place to place.
pub fn smooth_path(places: &[DVec3], secs: f64) -> Keys<DVec3> {
    let mut way = vec![0.0];
    for pair in places.windows(2) {
        // Places that are the same still take their time: keys rise.
        way.push(way[way.len() - 1] + pair[0].distance(pair[1]).max(1e-9));
    }
    let whole = way[way.len() - 1];
    let times_secs = way.iter().map(|along| secs * along / whole).collect();
    Keys { times_secs, values: places.to_vec(), interpolation: Interpolation::Linear }.smoothed()
}

/// So many even turns about an axis, counter-clockwise as it points to the viewer.
pub fn orbit(axis: DVec3, turns: f64, secs: f64) -> Keys<DQuat> {
    let axis = axis.try_normalize().unwrap_or(DVec3::Z);
    // A third of a turn a key at most: between keys the way is the short one.
    let n = (3.0 * turns.abs()).ceil().max(1.0) as usize;
    let share = |i: usize| i as f64 / n as f64;
    Keys {
        times_secs: (0..=n).map(|i| secs * share(i)).collect(),
        values: (0..=n).map(|i| DQuat::from_axis_angle(axis, TAU * turns * share(i))).collect(),
        interpolation: Interpolation::Linear,
    }
}

/// Weights of a Hermite spline: start, leaving, end, arriving.
fn hermite(share: f64, secs: f64) -> [f64; 4] {
    let (t, t2, t3) = (share, share * share, share * share * share);
    [2.0 * t3 - 3.0 * t2 + 1.0, secs * (t3 - 2.0 * t2 + t), 3.0 * t2 - 2.0 * t3, secs * (t3 - t2)]
}

impl Value for DVec3 {
    fn mix(&self, other: &Self, share: f64) -> Self {
        self.lerp(*other, share)
    }

    fn spline(&self, leaving: &Self, other: &Self, arriving: &Self, share: f64, secs: f64) -> Self {
        let [start, leave, end, arrive] = hermite(share, secs);
        start * self + leave * leaving + end * other + arrive * arriving
    }
}

impl Value for DQuat {
    fn mix(&self, other: &Self, share: f64) -> Self {
        self.slerp(*other, share)
    }

    fn spline(&self, leaving: &Self, other: &Self, arriving: &Self, share: f64, secs: f64) -> Self {
        let [start, leave, end, arrive] = hermite(share, secs);
        let sum = *self * start + *leaving * leave + *other * end + *arriving * arrive;
        if 0.0 < sum.length_squared() { sum.normalize() } else { *self }
    }
}

impl Value for Vec<f32> {
    fn mix(&self, other: &Self, share: f64) -> Self {
        self.iter().zip(other).map(|(a, b)| a + share as f32 * (b - a)).collect()
    }

    fn spline(&self, leaving: &Self, other: &Self, arriving: &Self, share: f64, secs: f64) -> Self {
        let [start, leave, end, arrive] = hermite(share, secs).map(|weight| weight as f32);
        let rates = leaving.iter().zip(arriving);
        let values = self.iter().zip(other).zip(rates);
        values
            .map(|((a, b), (out, into))| start * a + leave * out + end * b + arrive * into)
            .collect()
    }
}

impl Value for bool {
    fn mix(&self, _: &Self, _: f64) -> Self {
        *self
    }

    fn spline(&self, _: &Self, _: &Self, _: &Self, _: f64, _: f64) -> Self {
        *self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(interpolation: Interpolation, values: Vec<f32>) -> Keys<Vec<f32>> {
        let values = values.into_iter().map(|value| vec![value]).collect();
        Keys { times_secs: vec![1.0, 3.0], values, interpolation }
    }

    #[test]
    fn keys_hold_outside_and_go_over_inside() {
        for (interpolation, quarter) in [
            (Interpolation::Step, 10.0),
            (Interpolation::Linear, 12.5),
            (Interpolation::Ease, 10.0 + 10.0 * 0.15625),
        ] {
            let keys = keys(interpolation, vec![10.0, 20.0]);
            assert_eq!(keys.at(-5.0), [10.0]);
            assert_eq!(keys.at(1.0), [10.0]);
            assert_eq!(keys.at(1.5), [quarter]);
            assert_eq!(keys.at(3.0), [20.0]);
            assert_eq!(keys.at(9.0), [20.0]);
        }
    }

    #[test]
    fn a_spline_with_the_slope_of_a_line_is_the_line() {
        // Arriving, value, leaving: rates are a second.
        let keys = keys(Interpolation::Cubic, vec![0.0, 10.0, 5.0, 5.0, 20.0, 0.0]);
        for (time, value) in [(1.0, 10.0), (1.5, 12.5), (2.0, 15.0), (2.75, 18.75), (3.0, 20.0)] {
            assert!((keys.at(time)[0] - value).abs() < 1e-5);
        }
    }

    #[test]
    fn an_orbit_is_even_and_a_path_meets_its_places() {
        let keys = orbit(DVec3::Z, 2.0, 8.0);
        for (time, degrees) in [(0.5, 45.0), (1.0, 90.0), (3.0, 270.0), (7.0, 630.0f64)] {
            let expected = DQuat::from_rotation_z(degrees.to_radians());
            assert!(keys.at(time).angle_between(expected) < 1e-6, "{time}");
        }
        let places = [DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(2.0, 1.0, 0.0)];
        let keys = smooth_path(&places, 6.0);
        for (time, place) in [0.0, 4.0, 6.0].into_iter().zip(places) {
            assert!(keys.at(time).distance(place) < 1e-9);
        }
    }

    #[test]
    fn turning_goes_evenly_the_short_way() {
        let angle = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
        let keys = Keys {
            times_secs: vec![0.0, 1.0],
            values: vec![angle(0.0), angle(120.0)],
            interpolation: Interpolation::Linear,
        };
        assert!(keys.at(0.25).angle_between(angle(30.0)) < 1e-9);
    }
}
