//! Animations: the channels of one of them.

use surfel::math::{DQuat, DVec3};
use surfel::scene::{Animation, Channel, Interpolation, Keys, Node, Track};

use super::accessor::{Accessor, Meaning};
use super::document::Document;
use super::hierarchy::Hierarchy;
use super::json::{Json, shortened};
use super::transform::rotation;
use crate::error::{Error, Result};

/// The animation called `wanted`, or the first; the others are told.
pub(super) fn read<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    nodes: &[Node],
    wanted: Option<&str>,
) -> Result<Animation> {
    let animations = document.root.list("animations")?;
    let Some(chosen) = choose(document, &animations, wanted)? else {
        return Ok(Animation::default());
    };
    let mut channels = Vec::new();
    for channel in chosen.need("channels")?.items()? {
        channels.extend(read_channel(document, hierarchy, nodes, chosen, &channel)?);
    }
    Ok(Animation { channels })
}

fn choose<'j, 'a>(
    document: &Document<'a>,
    animations: &'j [Json<'a>],
    wanted: Option<&str>,
) -> Result<Option<&'j Json<'a>>> {
    const MOST_TOLD: usize = 20;
    let name = |(i, animation): (usize, &Json)| match animation.get("name") {
        Some(name) => name.text().map_or(i.to_string(), str::to_owned),
        None => i.to_string(),
    };
    let names: Vec<String> = animations.iter().enumerate().map(name).collect();
    let quoted = names.iter().take(MOST_TOLD).map(|name| format!("`{}`", shortened(name)));
    let known = quoted.collect::<Vec<_>>().join(", ");
    let Some(wanted) = wanted.filter(|_| !animations.is_empty()) else {
        if 1 < animations.len() {
            let n = animations.len();
            document.note(format!("the first of {n} animations plays; they are {known}"));
        }
        return Ok(animations.first());
    };
    let found = names.iter().position(|name| name == wanted);
    let Some(found) = found else {
        let (file, wanted) = (document.root.file().to_owned(), wanted.to_owned());
        return Err(Error::NoAnimation { file, wanted, known });
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
    let sampler = animation.referred("samplers", &channel.need("sampler")?)?;
    let target = channel.need("target")?;
    // Without a node it is for an extension, and other scenes have nodes of their own.
    let Some(node) = target.get("node") else { return Ok(None) };
    let Some(node) = hierarchy.node(document, &node)? else { return Ok(None) };
    let sampler = Sampler { document, animation, channel, json: sampler };
    let track = match target.need("path")?.text()? {
        "translation" => Track::Translation(sampler.vectors()?),
        "rotation" => Track::Rotation(sampler.rotations()?),
        "scale" => Track::Scale(sampler.vectors()?),
        "weights" => {
            let n_weights = nodes.get(node).map_or(0, |node| node.morph_weights.len());
            if n_weights == 0 {
                document.note("an animation of morph weights of a node without any is left out");
                return Ok(None);
            }
            Track::MorphWeights(sampler.weights(n_weights)?)
        }
        "pointer" => return Ok(None),
        _ => {
            let expected = "translation, rotation, scale or weights";
            return Err(target.need("path")?.unlike(expected));
        }
    };
    Ok(Some(Channel { node, track }))
}

/// The keys of a channel.
struct Sampler<'d, 'a> {
    document: &'d Document<'a>,
    animation: &'d Json<'a>,
    channel: &'d Json<'a>,
    json: Json<'a>,
}

impl<'a> Sampler<'_, 'a> {
    fn vectors(&self) -> Result<Keys<DVec3>> {
        self.keys(1, |accessor| {
            let column = accessor.floats::<3>(self.document, Meaning::Float, None)?;
            let vector = |value: [f32; 3]| DVec3::from_array(value.map(f64::from));
            self.finite(column.into_iter().map(vector).collect(), |vector| vector.is_finite())
        })
    }

    fn rotations(&self) -> Result<Keys<DQuat>> {
        let mut keys = self.keys(1, |accessor| {
            let column = accessor.floats::<4>(self.document, Meaning::Share, None)?;
            let quaternion = |value: [f32; 4]| DQuat::from_array(value.map(f64::from));
            self.finite(column.into_iter().map(quaternion).collect(), |value| value.is_finite())
        })?;
        let step = per_key(keys.interpolation);
        // The tangents of splines are no rotations.
        for (at, value) in keys.values.iter_mut().enumerate().skip(step / 2).step_by(step) {
            *value = rotation(value.to_array()).ok_or_else(|| {
                let found = format!("the quaternion {:?} at {at}", value.to_array());
                self.error("output", found, "one of length 1")
            })?;
        }
        Ok(keys)
    }

    fn weights(&self, n_weights: usize) -> Result<Keys<Vec<f32>>> {
        self.keys(n_weights, |accessor| {
            let column = accessor.floats::<1>(self.document, Meaning::Share, None)?;
            let column = self.finite(column, |[value]| value.is_finite())?;
            // Each key is a small vector on the heap.
            let n_keys = column.len() / n_weights;
            self.document.charge(&accessor.json, n_keys, size_of::<Vec<f32>>() + 16)?;
            Ok(column.as_flattened().chunks_exact(n_weights).map(<[f32]>::to_vec).collect())
        })
    }

    /// Times, and the values that `read` makes of `n_values` elements each.
    fn keys<T>(
        &self,
        n_values: usize,
        read: impl Fn(&Accessor<'a>) -> Result<Vec<T>>,
    ) -> Result<Keys<T>> {
        let interpolation = match self.json.get("interpolation") {
            None => Interpolation::Linear,
            Some(json) => match json.text()? {
                "LINEAR" => Interpolation::Linear,
                "STEP" => Interpolation::Step,
                "CUBICSPLINE" => Interpolation::Cubic,
                _ => return Err(json.unlike("LINEAR, STEP or CUBICSPLINE")),
            },
        };
        let times_secs = self.times()?;
        let values = Accessor::open(self.document, &self.json.need("output")?)?;
        let needed = times_secs.len().saturating_mul(n_values * per_key(interpolation));
        if values.count != needed {
            let found = format!("{} values for {} keys", values.count, times_secs.len());
            return Err(self.error("output", found, format!("{needed}")));
        }
        Ok(Keys { times_secs, values: read(&values)?, interpolation })
    }

    fn times(&self) -> Result<Vec<f64>> {
        let times = Accessor::open(self.document, &self.json.need("input")?)?;
        let times = times.floats::<1>(self.document, Meaning::Float, None)?;
        let times: Vec<f64> = times.into_iter().map(|[time]| f64::from(time)).collect();
        if times.is_empty() {
            return Err(self.error("input", "no keys", "one at least"));
        }
        if let Some(at) = times.iter().position(|time| !time.is_finite()) {
            return Err(self.error("input", format!("{} at key {at}", times[at]), "finite times"));
        }
        if let Some(at) = (1..times.len()).find(|&at| times[at] < times[at - 1]) {
            let found = format!("{} s after {} s at key {at}", times[at], times[at - 1]);
            return Err(self.error("input", found, "times that rise"));
        }
        Ok(times)
    }

    fn finite<T>(&self, values: Vec<T>, is_finite: impl Fn(&T) -> bool) -> Result<Vec<T>> {
        match values.iter().position(|value| !is_finite(value)) {
            Some(at) => Err(self.error("output", format!("no number at {at}"), "finite numbers")),
            None => Ok(values),
        }
    }

    /// Something is wrong with the accessor `key`; tells for which animation and channel.
    fn error(&self, key: &str, found: impl Into<String>, expected: impl Into<String>) -> Error {
        let (title, channel) = (self.animation.title(), self.channel.pointer());
        let found = format!("{} (animation{title}, {channel})", found.into());
        self.json.get(key).as_ref().unwrap_or(&self.json).error(found, expected)
    }
}

/// Splines have a tangent on both sides of each value.
fn per_key(interpolation: Interpolation) -> usize {
    if interpolation == Interpolation::Cubic { 3 } else { 1 }
}
