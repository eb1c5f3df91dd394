//! Attributes of vertices: columns that have to be as long as that of the positions.

use surfel::math::{Vec2, Vec3, Vec4};
use surfel::scene::{Morph, Skin};

use super::accessor::{Accessor, Meaning};
use super::document::Document;
use super::json::Json;
use crate::error::Result;

/// The vertices of a primitive, or those of them that it uses.
pub(super) struct Vertices<'d, 'a> {
    pub document: &'d Document<'a>,
    pub primitive: &'d Json<'a>,
    pub attributes: &'d Json<'a>,
    /// How many there are, used or not.
    pub count: usize,
    /// The used ones; all if absent.
    pub picked: Option<&'d [u32]>,
}

impl<'a> Vertices<'_, 'a> {
    pub fn positions(&self) -> Result<Vec<Vec3>> {
        let positions = self.vectors(self.attributes, "POSITION")?;
        Ok(positions.unwrap_or_default())
    }

    /// Unit where they have a direction, zero elsewhere.
    pub fn normals(&self) -> Result<Option<Vec<Vec3>>> {
        let normals = self.vectors(self.attributes, "NORMAL")?;
        Ok(normals.map(|column| column.into_iter().map(Vec3::normalize_or_zero).collect()))
    }

    pub fn tangents(&self) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.open(self.attributes, "TANGENT")? else { return Ok(None) };
        let column = accessor.floats(self.document, Meaning::Quantized, self.picked)?;
        let tangents = column.into_iter().map(|[x, y, z, sign]: [f32; 4]| {
            let tangent = Vec3::new(x, y, z).normalize_or_zero();
            tangent.extend(if sign < 0.0 { -1.0 } else { 1.0 })
        });
        let tangents: Vec<Vec4> = tangents.collect();
        let is_whole = tangents.iter().all(|tangent| tangent.truncate() != Vec3::ZERO);
        Ok(self.kept(tangents, is_whole, "TANGENT", "some have no direction"))
    }

    pub fn uvs(&self, name: &str) -> Result<Option<Vec<Vec2>>> {
        let Some(accessor) = self.open(self.attributes, name)? else { return Ok(None) };
        let column = accessor.floats(self.document, Meaning::Quantized, self.picked)?;
        let uvs: Vec<Vec2> = column.into_iter().map(Vec2::from_array).collect();
        let is_whole = uvs.iter().all(|uv| uv.is_finite());
        Ok(self.kept(uvs, is_whole, name, "some are not finite"))
    }

    /// Linear, with alpha.
    pub fn colors(&self) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.open(self.attributes, "COLOR_0")? else { return Ok(None) };
        let document = self.document;
        let colors: Vec<Vec4> = if accessor.kind() == "VEC3" {
            let column = accessor.floats(document, Meaning::Share, self.picked)?;
            column.into_iter().map(|[r, g, b]: [f32; 3]| Vec4::new(r, g, b, 1.0)).collect()
        } else {
            let column = accessor.floats(document, Meaning::Share, self.picked)?;
            column.into_iter().map(Vec4::from_array).collect()
        };
        let is_whole = colors.iter().all(|color| color.is_finite());
        let colors = colors.into_iter().map(|color| color.clamp(Vec4::ZERO, Vec4::ONE)).collect();
        Ok(self.kept(colors, is_whole, "COLOR_0", "some are not finite"))
    }

    pub fn skin(&self) -> Result<Option<Skin>> {
        let joints = self.open(self.attributes, "JOINTS_0")?;
        let weights = self.open(self.attributes, "WEIGHTS_0")?;
        let (Some(joints), Some(weights)) = (joints, weights) else { return Ok(None) };
        if self.attributes.get("JOINTS_1").is_some() {
            let line = "vertices with more than four joints keep the first four";
            self.document.note(line);
        }
        let weights = weights.floats(self.document, Meaning::Share, self.picked)?;
        let column = joints.integers::<4>(self.document, self.picked)?;
        let mut skin = Skin { joints: Vec::with_capacity(column.len()), weights };
        for (joints_of_vertex, weights) in column.iter().zip(&mut skin.weights) {
            normalize(weights);
            let mut narrow = [0; 4];
            for ((narrow, joint), weight) in narrow.iter_mut().zip(joints_of_vertex).zip(&*weights)
            {
                // What carries nothing may be any number.
                if 0.0 < *weight {
                    *narrow = u16::try_from(*joint).map_err(|_| {
                        joints.json.error(format!("joint {joint}"), "65535 at most")
                    })?;
                }
            }
            skin.joints.push(narrow);
        }
        Ok(Some(skin))
    }

    /// The morph targets, in their order.
    pub fn morphs(&self) -> Result<Vec<Morph>> {
        let mut morphs = Vec::new();
        for target in self.primitive.list("targets")? {
            let n_vertices = self.picked.map_or(self.count, <[u32]>::len);
            let positions = match self.vectors(&target, "POSITION")? {
                Some(positions) => positions,
                None => {
                    self.document.charge(&target, n_vertices, size_of::<Vec3>())?;
                    vec![Vec3::ZERO; n_vertices]
                }
            };
            let normals = self.vectors(&target, "NORMAL")?;
            let is_whole = normals.iter().flatten().all(|normal| normal.is_finite());
            let normals = normals.and_then(|normals| {
                self.kept(normals, is_whole, "NORMAL of a target", "some are not finite")
            });
            let tangents = self.vectors(&target, "TANGENT")?;
            let is_whole = tangents.iter().flatten().all(|tangent| tangent.is_finite());
            let tangents = tangents.and_then(|tangents| {
                self.kept(tangents, is_whole, "TANGENT of a target", "some are not finite")
            });
            morphs.push(Morph { positions, normals, tangents, radii: None });
        }
        Ok(morphs)
    }

    fn vectors(&self, attributes: &Json<'a>, name: &str) -> Result<Option<Vec<Vec3>>> {
        let Some(accessor) = self.open(attributes, name)? else { return Ok(None) };
        let column = accessor.floats(self.document, Meaning::Quantized, self.picked)?;
        Ok(Some(column.into_iter().map(Vec3::from_array).collect()))
    }

    fn open(&self, attributes: &Json<'a>, name: &str) -> Result<Option<Accessor<'a>>> {
        let Some(reference) = attributes.get(name) else { return Ok(None) };
        let accessor = Accessor::open(self.document, &reference)?;
        if accessor.count == self.count {
            return Ok(Some(accessor));
        }
        let found = format!("{} elements in {}", accessor.count, accessor.json.pointer());
        Err(reference.error(found, format!("{}, one a position", self.count)))
    }

    /// The column, or nothing and a note if something is wrong with it.
    fn kept<T>(&self, column: Vec<T>, is_whole: bool, name: &str, why: &str) -> Option<Vec<T>> {
        if !is_whole {
            self.document.note(format!("{name} of a mesh is left out: {why}"));
        }
        is_whole.then_some(column)
    }
}

/// Makes weights add up to 1.
fn normalize(weights: &mut [f32; 4]) {
    // What is no weight carries nothing; `max` takes NaN to 0 too.
    *weights = weights.map(|weight| weight.clamp(0.0, f32::MAX / 8.0).max(0.0));
    let sum: f32 = weights.iter().sum();
    *weights = if 0.0 < sum { weights.map(|weight| weight / sum) } else { [1.0, 0.0, 0.0, 0.0] };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_to_one_whatever_they_were() {
        for (given, expected) in [
            ([1.0, 1.0, 2.0, 0.0], [0.25, 0.25, 0.5, 0.0]),
            ([f32::NAN, 2.0, -3.0, 0.0], [0.0, 1.0, 0.0, 0.0]),
            ([0.0; 4], [1.0, 0.0, 0.0, 0.0]),
            ([f32::INFINITY; 4], [0.25; 4]),
            ([1e-45, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]),
        ] {
            let mut weights = given;
            normalize(&mut weights);
            assert_eq!(weights, expected);
        }
    }
}
