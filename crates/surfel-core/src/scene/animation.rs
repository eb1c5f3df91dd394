//! Animation after glTF 2.0: keyframes of node properties, and orbits and paths made of such keyframes.

use crate::math::{DQuat, DVec3};
use std::f64::consts::TAU;
use std::ops::{Div, Sub};

/// Channels that change nodes over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// The channels; a later one overrides earlier ones of the same property.
    pub channels: Vec<Channel>,
}

/// The animation of one property of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index of the node.
    pub node: usize,
    /// The property and its keyframes.
    pub track: Track,
}

/// The keyframes of one property of a node.
#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    /// Translation of the node.
    Translation(Keyframes<DVec3>),
    /// Rotation of the node.
    Rotation(Keyframes<DQuat>),
    /// Scale of the node.
    Scale(Keyframes<DVec3>),
    /// Weights of the morph targets.
    MorphWeights(Keyframes<Vec<f32>>),
    /// Visibility, which is never interpolated: each value holds until the next.
    Visible(Keyframes<bool>),
}

/// Values at times. The first value holds before the first time, the last one after the last time.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes<T> {
    /// Times in seconds, in ascending order.
    pub times_secs: Vec<f64>,
    /// One value for each time, or three for [`Interpolation::Cubic`]: in-tangent, value and out-tangent.
    pub values: Vec<T>,
    /// The interpolation between two values.
    pub interpolation: Interpolation,
}

/// The interpolation between two keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier value.
    Step,
    /// Linear interpolation, spherical for rotations.
    #[default]
    Linear,
    /// Linear interpolation with a smoothstep, so that the motion is slow at each key.
    Ease,
    /// Cubic Hermite splines with given tangents, as in glTF.
    Cubic,
}

impl Animation {
    /// Adds the channels of `other`, whose node indices shift by `first_node`.
    pub fn append(&mut self, other: Self, first_node: usize) {
        self.channels.extend(other.channels.into_iter().map(|mut channel| {
            channel.node += first_node;
            channel
        }));
    }

    /// Returns the time of the last key in seconds.
    pub fn duration_secs(&self) -> f64 {
        let ends = self.channels.iter().filter_map(|channel| channel.track.times_secs().last());
        ends.copied().fold(0.0, f64::max)
    }
}

impl Track {
    /// Returns the times of the keyframes in seconds.
    pub fn times_secs(&self) -> &[f64] {
        match self {
            Self::Translation(keys) | Self::Scale(keys) => &keys.times_secs,
            Self::Rotation(keys) => &keys.times_secs,
            Self::MorphWeights(keys) => &keys.times_secs,
            Self::Visible(keys) => &keys.times_secs,
        }
    }
}

/// A value that keyframes can hold.
pub trait KeyframeValue: Clone {
    /// Returns the linear interpolation from `self` (at weight 0) to `other` (at weight 1).
    fn lerp(&self, other: &Self, weight: f64) -> Self;

    /// Returns the cubic Hermite spline from `self` to `other` at a `weight` of a span of `secs` seconds.
    ///
    /// `out_tangent` is the rate of change a second at `self`, `in_tangent` that at `other`.
    fn hermite(
        &self,
        out_tangent: &Self,
        other: &Self,
        in_tangent: &Self,
        weight: f64,
        secs: f64,
    ) -> Self;
}

impl<T: KeyframeValue> Keyframes<T> {
    /// Returns the value at a time.
    ///
    /// # Panics
    ///
    /// Panics without a key.
    pub fn at(&self, time_secs: f64) -> T {
        let next = self.times_secs.partition_point(|&time| time <= time_secs);
        let Some(last) = next.checked_sub(1) else { return self.value(0).clone() };
        if next == self.times_secs.len() {
            return self.value(last).clone();
        }
        let (from, to) = (self.times_secs[last], self.times_secs[next]);
        let (secs, weight) = (to - from, (time_secs - from) / (to - from));
        let (start, end) = (self.value(last), self.value(next));
        match self.interpolation {
            Interpolation::Step => start.clone(),
            Interpolation::Linear => start.lerp(end, weight),
            Interpolation::Ease => start.lerp(end, weight * weight * (3.0 - 2.0 * weight)),
            Interpolation::Cubic => {
                let (out_tangent, in_tangent) =
                    (&self.values[3 * last + 2], &self.values[3 * next]);
                start.hermite(out_tangent, end, in_tangent, weight, secs)
            }
        }
    }

    fn value(&self, key_idx: usize) -> &T {
        match self.interpolation {
            Interpolation::Cubic => &self.values[3 * key_idx + 1],
            _ => &self.values[key_idx],
        }
    }
}

impl<T: KeyframeValue + Copy + Default + Sub<Output = T> + Div<f64, Output = T>> Keyframes<T> {
    /// Returns the same keys with a smooth path between them (Catmull and Rom 1974).
    ///
    /// The tangent at each key is the mean velocity from the key before to the key after.
    pub fn with_catmull_rom_tangents(self) -> Self {
        let Self { times_secs, values, .. } = self;
        let last = values.len().saturating_sub(1);
        let tangent = |i: usize| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let secs = times_secs[after] - times_secs[before];
            if 0.0 < secs { (values[after] - values[before]) / secs } else { T::default() }
        };
        let values = (0..values.len()).flat_map(|i| [tangent(i), values[i], tangent(i)]).collect();
        Self { times_secs, values, interpolation: Interpolation::Cubic }
    }
}

/// Returns a smooth path through two or more positions that takes `secs` seconds.
///
/// The mean speed between neighbouring positions is the same everywhere. Of a single position the path stays there.
pub fn catmull_rom_path(positions: &[DVec3], secs: f64) -> Keyframes<DVec3> {
    let mut lengths = vec![0.0];
    for pair in positions.windows(2) {
        // Times must ascend, so equal positions take a little time, too.
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]).max(1e-9));
    }
    let total = lengths[lengths.len() - 1].max(f64::MIN_POSITIVE);
    let times_secs = lengths.iter().map(|length| secs * length / total).collect();
    Keyframes { times_secs, values: positions.to_vec(), interpolation: Interpolation::Linear }
        .with_catmull_rom_tangents()
}

/// Returns `turns` uniform rotations about `axis` in `secs` seconds, counter-clockwise seen against the axis.
pub fn orbit(axis: DVec3, turns: f64, secs: f64) -> Keyframes<DQuat> {
    let axis = axis.try_normalize().unwrap_or(DVec3::Z);
    // Interpolation takes the shorter way between two keys, so they must be less than half a turn apart.
    let n = (3.0 * turns.abs()).ceil().max(1.0) as usize;
    let fraction = |i: usize| i as f64 / n as f64;
    Keyframes {
        times_secs: (0..=n).map(|i| secs * fraction(i)).collect(),
        values: (0..=n).map(|i| DQuat::from_axis_angle(axis, TAU * turns * fraction(i))).collect(),
        interpolation: Interpolation::Linear,
    }
}

/// Returns the weights of a Hermite spline: start, out-tangent, end, in-tangent.
fn hermite_weights(weight: f64, secs: f64) -> [f64; 4] {
    let (t, t2, t3) = (weight, weight * weight, weight * weight * weight);
    [2.0 * t3 - 3.0 * t2 + 1.0, secs * (t3 - 2.0 * t2 + t), 3.0 * t2 - 2.0 * t3, secs * (t3 - t2)]
}

impl KeyframeValue for f64 {
    fn lerp(&self, other: &Self, weight: f64) -> Self {
        self + weight * (other - self)
    }

    fn hermite(
        &self,
        out_tangent: &Self,
        other: &Self,
        in_tangent: &Self,
        weight: f64,
        secs: f64,
    ) -> Self {
        let [a, b, c, d] = hermite_weights(weight, secs);
        a * self + b * out_tangent + c * other + d * in_tangent
    }
}

impl KeyframeValue for DVec3 {
    fn lerp(&self, other: &Self, weight: f64) -> Self {
        DVec3::lerp(*self, *other, weight)
    }

    fn hermite(
        &self,
        out_tangent: &Self,
        other: &Self,
        in_tangent: &Self,
        weight: f64,
        secs: f64,
    ) -> Self {
        let [a, b, c, d] = hermite_weights(weight, secs);
        a * self + b * out_tangent + c * other + d * in_tangent
    }
}

impl KeyframeValue for DQuat {
    fn lerp(&self, other: &Self, weight: f64) -> Self {
        self.slerp(*other, weight)
    }

    fn hermite(
        &self,
        out_tangent: &Self,
        other: &Self,
        in_tangent: &Self,
        weight: f64,
        secs: f64,
    ) -> Self {
        let [a, b, c, d] = hermite_weights(weight, secs);
        let sum = *self * a + *out_tangent * b + *other * c + *in_tangent * d;
        if 0.0 < sum.length_squared() { sum.normalize() } else { *self }
    }
}

impl KeyframeValue for Vec<f32> {
    fn lerp(&self, other: &Self, weight: f64) -> Self {
        self.iter().zip(other).map(|(a, b)| a + weight as f32 * (b - a)).collect()
    }

    fn hermite(
        &self,
        out_tangent: &Self,
        other: &Self,
        in_tangent: &Self,
        weight: f64,
        secs: f64,
    ) -> Self {
        let [a, b, c, d] = hermite_weights(weight, secs).map(|weight| weight as f32);
        let tangents = out_tangent.iter().zip(in_tangent);
        let values = self.iter().zip(other).zip(tangents);
        values
            .map(|((start, end), (leaving, arriving))| {
                a * start + b * leaving + c * end + d * arriving
            })
            .collect()
    }
}

impl KeyframeValue for bool {
    fn lerp(&self, _: &Self, _: f64) -> Self {
        *self
    }

    fn hermite(&self, _: &Self, _: &Self, _: &Self, _: f64, _: f64) -> Self {
        *self
    }
}

#[cfg(test)]
mod tests {
    //! Keyframes hold outside of their times and are interpolated inside.

    use super::*;

    fn keys(interpolation: Interpolation, values: Vec<f32>) -> Keyframes<Vec<f32>> {
        let values = values.into_iter().map(|value| vec![value]).collect();
        Keyframes { times_secs: vec![1.0, 3.0], values, interpolation }
    }

    #[test]
    fn values_hold_outside_and_are_interpolated_inside() {
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
        // In-tangent, value and out-tangent of each key.
        let keys = keys(Interpolation::Cubic, vec![0.0, 10.0, 5.0, 5.0, 20.0, 0.0]);
        for (time, value) in [(1.0, 10.0), (1.5, 12.5), (2.0, 15.0), (2.75, 18.75), (3.0, 20.0)] {
            assert!((keys.at(time)[0] - value).abs() < 1e-5);
        }
    }

    #[test]
    fn an_orbit_is_uniform_and_a_path_meets_its_positions() {
        let keys = orbit(DVec3::Z, 2.0, 8.0);
        for (time, degrees) in [(0.5, 45.0), (1.0, 90.0), (3.0, 270.0), (7.0, 630.0f64)] {
            let expected = DQuat::from_rotation_z(degrees.to_radians());
            assert!(keys.at(time).angle_between(expected) < 1e-6, "{time}");
        }
        let positions = [DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(2.0, 1.0, 0.0)];
        let keys = catmull_rom_path(&positions, 6.0);
        for (time, position) in [0.0, 4.0, 6.0].into_iter().zip(positions) {
            assert!(keys.at(time).distance(position) < 1e-9);
        }
    }

    #[test]
    fn rotations_are_interpolated_uniformly_along_the_shorter_way() {
        let angle = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
        let keys = Keyframes {
            times_secs: vec![0.0, 1.0],
            values: vec![angle(0.0), angle(120.0)],
            interpolation: Interpolation::Linear,
        };
        assert!(keys.at(0.25).angle_between(angle(30.0)) < 1e-9);
    }
}
