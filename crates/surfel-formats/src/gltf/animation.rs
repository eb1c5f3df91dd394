//! Animation channels.

use surfel_core::math::{DQuat, DVec3};
use surfel_core::scene::{Animation, Channel, Interpolation, Keyframes, Node, Track};
use surfel_core::words::counted;

use super::accessor::{Accessor, IntegerPolicy};
use super::document::Document;
use super::hierarchy::Hierarchy;
use super::json::Json;
use super::transform::unit_quaternion;
use crate::error::{Error, Result, shorten};

/// Reads the animation called `requested`, or the first one with a note that lists the others.
pub(super) fn read<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    nodes: &[Node],
    requested: Option<&str>,
) -> Result<Animation> {
    let animations = document.root.array_or_empty("animations")?;
    let Some(animation) = select(document, &animations, requested)? else {
        return Ok(Animation::default());
    };
    let mut channels = Vec::new();
    for channel in animation.require("channels")?.array()? {
        channels.extend(read_channel(document, hierarchy, nodes, animation, &channel)?);
    }
    Ok(Animation { channels })
}

/// Returns the animation called `requested`, or the first one.
fn select<'j, 'a>(
    document: &Document<'a>,
    animations: &'j [Json<'a>],
    requested: Option<&str>,
) -> Result<Option<&'j Json<'a>>> {
    const MAX_LISTED: usize = 20;
    let name = |(i, animation): (usize, &Json)| match animation.get("name") {
        Some(name) => name.string().map_or(i.to_string(), str::to_owned),
        None => i.to_string(),
    };
    let names: Vec<String> = animations.iter().enumerate().map(name).collect();
    let quoted = names.iter().take(MAX_LISTED).map(|name| format!("`{}`", shorten(name)));
    let known = quoted.collect::<Vec<_>>().join(", ");
    let Some(requested) = requested.filter(|_| !animations.is_empty()) else {
        if 1 < animations.len() {
            let n = animations.len();
            document.warn(format!("the first of {n} animations plays; the file has {known}"));
        }
        return Ok(animations.first());
    };
    let found = names.iter().position(|name| name == requested);
    let Some(found) = found else {
        let (file, requested) = (document.root.file().to_owned(), requested.to_owned());
        return Err(Error::UnknownAnimation { file, requested, known });
    };
    Ok(Some(&animations[found]))
}

fn read_channel<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    nodes: &[Node],
    animation: &Json<'a>,
    channel: &Json<'a>,
) -> Result<Option<Channel>> {
    let sampler = animation.resolve("samplers", &channel.require("sampler")?)?;
    let target = channel.require("target")?;
    // A channel without a node belongs to an extension; a node may also belong to another scene.
    let Some(node) = target.get("node") else { return Ok(None) };
    let Some(node) = hierarchy.graph_idx(document, &node)? else { return Ok(None) };
    let sampler = Sampler { document, animation, channel, json: sampler };
    let track = match target.require("path")?.string()? {
        "translation" => Track::Translation(sampler.vectors()?),
        "rotation" => Track::Rotation(sampler.rotations()?),
        "scale" => Track::Scale(sampler.vectors()?),
        "weights" => {
            let n_weights = nodes.get(node).map_or(0, |node| node.morph_weights.len());
            if n_weights == 0 {
                document.warn("an animation of morph weights is skipped: its node has none");
                return Ok(None);
            }
            Track::MorphWeights(sampler.weights(n_weights)?)
        }
        "pointer" => return Ok(None),
        _ => {
            let expected = "translation, rotation, scale or weights";
            return Err(target.require("path")?.type_error(expected));
        }
    };
    Ok(Some(Channel { node, track }))
}

/// The sampler of a channel.
struct Sampler<'d, 'a> {
    document: &'d Document<'a>,
    animation: &'d Json<'a>,
    channel: &'d Json<'a>,
    json: Json<'a>,
}

impl<'a> Sampler<'_, 'a> {
    fn vectors(&self) -> Result<Keyframes<DVec3>> {
        self.keys(1, |accessor| {
            let column = accessor.floats::<3>(self.document, IntegerPolicy::Reject, None)?;
            let vector = |value: [f32; 3]| DVec3::from_array(value.map(f64::from));
            self.require_finite(column.into_iter().map(vector).collect(), |vector| {
                vector.is_finite()
            })
        })
    }

    fn rotations(&self) -> Result<Keyframes<DQuat>> {
        let mut keys = self.keys(1, |accessor| {
            let column = accessor.floats::<4>(self.document, IntegerPolicy::Normalize, None)?;
            let quaternion = |value: [f32; 4]| DQuat::from_array(value.map(f64::from));
            self.require_finite(column.into_iter().map(quaternion).collect(), |value| {
                value.is_finite()
            })
        })?;
        let step = values_per_key(keys.interpolation);
        // The tangents of splines are not unit quaternions.
        for (at, value) in keys.values.iter_mut().enumerate().skip(step / 2).step_by(step) {
            *value = unit_quaternion(value.to_array()).ok_or_else(|| {
                let found = format!("the quaternion {:?} at {at}", value.to_array());
                self.error("output", found, "one of length 1")
            })?;
        }
        Ok(keys)
    }

    fn weights(&self, n_weights: usize) -> Result<Keyframes<Vec<f32>>> {
        self.keys(n_weights, |accessor| {
            let column = accessor.floats::<1>(self.document, IntegerPolicy::Normalize, None)?;
            let column = self.require_finite(column, |[value]| value.is_finite())?;
            // Each key is a separate heap allocation.
            let n_keys = column.len() / n_weights;
            self.document.reserve(&accessor.json, n_keys, size_of::<Vec<f32>>() + 16)?;
            Ok(column.as_flattened().chunks_exact(n_weights).map(<[f32]>::to_vec).collect())
        })
    }

    /// Reads the times, and the values with `read`. Each value has `n_values` elements.
    fn keys<T>(
        &self,
        n_values: usize,
        read: impl Fn(&Accessor<'a>) -> Result<Vec<T>>,
    ) -> Result<Keyframes<T>> {
        let interpolation = match self.json.get("interpolation") {
            None => Interpolation::Linear,
            Some(json) => match json.string()? {
                "LINEAR" => Interpolation::Linear,
                "STEP" => Interpolation::Step,
                "CUBICSPLINE" => Interpolation::Cubic,
                _ => return Err(json.type_error("LINEAR, STEP or CUBICSPLINE")),
            },
        };
        let times_secs = self.times()?;
        let values = Accessor::open(self.document, &self.json.require("output")?)?;
        let needed = times_secs.len().saturating_mul(n_values * values_per_key(interpolation));
        if values.count != needed {
            let found = format!(
                "{} for {}",
                counted(values.count, "value"),
                counted(times_secs.len(), "key")
            );
            return Err(self.error("output", found, format!("{needed}")));
        }
        Ok(Keyframes { times_secs, values: read(&values)?, interpolation })
    }

    /// Reads the times of the keys in seconds.
    fn times(&self) -> Result<Vec<f64>> {
        let times = Accessor::open(self.document, &self.json.require("input")?)?;
        let times = times.floats::<1>(self.document, IntegerPolicy::Reject, None)?;
        let times: Vec<f64> = times.into_iter().map(|[time]| f64::from(time)).collect();
        if times.is_empty() {
            return Err(self.error("input", "no keys", "at least one"));
        }
        if let Some(at) = times.iter().position(|time| !time.is_finite()) {
            return Err(self.error("input", format!("{} at key {at}", times[at]), "finite times"));
        }
        if let Some(at) = (1..times.len()).find(|&at| times[at] < times[at - 1]) {
            let found = format!("{} s after {} s at key {at}", times[at], times[at - 1]);
            return Err(self.error("input", found, "increasing times"));
        }
        Ok(times)
    }

    /// Returns the values, or an error if one is not finite.
    fn require_finite<T>(&self, values: Vec<T>, is_finite: impl Fn(&T) -> bool) -> Result<Vec<T>> {
        match values.iter().position(|value| !is_finite(value)) {
            Some(at) => Err(self.error(
                "output",
                format!("a value that is not finite at {at}"),
                "finite numbers",
            )),
            None => Ok(values),
        }
    }

    /// Returns an error at the accessor `key` that names the animation and channel.
    fn error(&self, key: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        let (title, channel) = (self.animation.quoted_name(), self.channel.pointer());
        let found = format!("{} (animation{title}, {channel})", found.into());
        self.json.get(key).as_ref().unwrap_or(&self.json).error(found, expected)
    }
}

/// Returns the number of stored elements per key: splines store a tangent on both sides of each value.
fn values_per_key(interpolation: Interpolation) -> usize {
    if interpolation == Interpolation::Cubic { 3 } else { 1 }
}
