//! Vertex attributes: columns that must be as long as the positions.

use surfel_core::math::{Vec2, Vec3, Vec4};
use surfel_core::scene::{Morph, Skin};
use surfel_core::words::counted;

use super::accessor::{Accessor, IntegerPolicy};
use super::document::Document;
use super::json::Json;
use crate::error::Result;

/// A reader of the vertex attributes of a primitive, or of the vertices that it uses.
pub(super) struct VertexAttributes<'d, 'a> {
    /// The document of the primitive.
    pub document: &'d Document<'a>,
    /// The primitive's JSON.
    pub primitive: &'d Json<'a>,
    /// The JSON of its attributes.
    pub attributes: &'d Json<'a>,
    /// Number of vertices in the accessors.
    pub count: usize,
    /// Indices of the vertices to read; all if absent.
    pub selected: Option<&'d [u32]>,
}

impl<'a> VertexAttributes<'_, 'a> {
    /// Reads the positions.
    pub fn positions(&self) -> Result<Vec<Vec3>> {
        let positions = self.vectors(self.attributes, "POSITION")?;
        Ok(positions.unwrap_or_default())
    }

    /// Reads unit normals. A normal of length zero stays zero.
    pub fn normals(&self) -> Result<Option<Vec<Vec3>>> {
        let normals = self.vectors(self.attributes, "NORMAL")?;
        Ok(normals.map(|column| column.into_iter().map(Vec3::normalize_or_zero).collect()))
    }

    /// Reads unit tangents with the sign of the bitangent in w.
    pub fn tangents(&self) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.open(self.attributes, "TANGENT")? else { return Ok(None) };
        let column = accessor.floats(self.document, IntegerPolicy::AsDeclared, self.selected)?;
        let tangents = column.into_iter().map(|[x, y, z, sign]: [f32; 4]| {
            let tangent = Vec3::new(x, y, z).normalize_or_zero();
            tangent.extend(if sign < 0.0 { -1.0 } else { 1.0 })
        });
        let tangents: Vec<Vec4> = tangents.collect();
        let is_valid = tangents.iter().all(|tangent| tangent.truncate() != Vec3::ZERO);
        Ok(self.keep_if(tangents, is_valid, "TANGENT", "some have length zero"))
    }

    /// Reads a set of texture coordinates.
    pub fn uvs(&self, name: &str) -> Result<Option<Vec<Vec2>>> {
        let Some(accessor) = self.open(self.attributes, name)? else { return Ok(None) };
        let column = accessor.floats(self.document, IntegerPolicy::AsDeclared, self.selected)?;
        let uvs: Vec<Vec2> = column.into_iter().map(Vec2::from_array).collect();
        let is_valid = uvs.iter().all(|uv| uv.is_finite());
        Ok(self.keep_if(uvs, is_valid, name, "some are not finite"))
    }

    /// Reads linear colours with alpha.
    pub fn colors(&self) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.open(self.attributes, "COLOR_0")? else { return Ok(None) };
        let document = self.document;
        let colors: Vec<Vec4> = if accessor.element_type() == "VEC3" {
            let column = accessor.floats(document, IntegerPolicy::Normalize, self.selected)?;
            column.into_iter().map(|[r, g, b]: [f32; 3]| Vec4::new(r, g, b, 1.0)).collect()
        } else {
            let column = accessor.floats(document, IntegerPolicy::Normalize, self.selected)?;
            column.into_iter().map(Vec4::from_array).collect()
        };
        let is_valid = colors.iter().all(|color| color.is_finite());
        let colors = colors.into_iter().map(|color| color.clamp(Vec4::ZERO, Vec4::ONE)).collect();
        Ok(self.keep_if(colors, is_valid, "COLOR_0", "some are not finite"))
    }

    /// Reads up to four joints and weights per vertex.
    pub fn skin(&self) -> Result<Option<Skin>> {
        let joints = self.open(self.attributes, "JOINTS_0")?;
        let weights = self.open(self.attributes, "WEIGHTS_0")?;
        let (Some(joints), Some(weights)) = (joints, weights) else { return Ok(None) };
        if self.attributes.get("JOINTS_1").is_some() {
            let line = "vertices with more than four joints use only the first four";
            self.document.warn(line);
        }
        let weights = weights.floats(self.document, IntegerPolicy::Normalize, self.selected)?;
        let column = joints.integers::<4>(self.document, self.selected)?;
        let mut skin = Skin { joints: Vec::with_capacity(column.len()), weights };
        for (joints_of_vertex, weights) in column.iter().zip(&mut skin.weights) {
            normalize_weights(weights);
            let mut narrow = [0; 4];
            for ((narrow, joint), weight) in narrow.iter_mut().zip(joints_of_vertex).zip(&*weights)
            {
                // A joint with weight 0 may have any index.
                if 0.0 < *weight {
                    *narrow = u16::try_from(*joint).map_err(|_| {
                        joints.json.error(format!("joint {joint}"), "at most 65535")
                    })?;
                }
            }
            skin.joints.push(narrow);
        }
        Ok(Some(skin))
    }

    /// Reads the morph targets in the order of the file.
    pub fn morphs(&self) -> Result<Vec<Morph>> {
        let mut morphs = Vec::new();
        for target in self.primitive.array_or_empty("targets")? {
            let n_vertices = self.selected.map_or(self.count, <[u32]>::len);
            let positions = match self.vectors(&target, "POSITION")? {
                Some(positions) => positions,
                None => {
                    self.document.reserve(&target, n_vertices, size_of::<Vec3>())?;
                    vec![Vec3::ZERO; n_vertices]
                }
            };
            let normals = self.vectors(&target, "NORMAL")?;
            let is_valid = normals.iter().flatten().all(|normal| normal.is_finite());
            let normals = normals.and_then(|normals| {
                self.keep_if(normals, is_valid, "NORMAL of a target", "some are not finite")
            });
            let tangents = self.vectors(&target, "TANGENT")?;
            let is_valid = tangents.iter().flatten().all(|tangent| tangent.is_finite());
            let tangents = tangents.and_then(|tangents| {
                self.keep_if(tangents, is_valid, "TANGENT of a target", "some are not finite")
            });
            morphs.push(Morph { positions, normals, tangents, radii: None });
        }
        Ok(morphs)
    }

    fn vectors(&self, attributes: &Json<'a>, name: &str) -> Result<Option<Vec<Vec3>>> {
        let Some(accessor) = self.open(attributes, name)? else { return Ok(None) };
        let column = accessor.floats(self.document, IntegerPolicy::AsDeclared, self.selected)?;
        Ok(Some(column.into_iter().map(Vec3::from_array).collect()))
    }

    /// Opens an accessor and checks its length.
    fn open(&self, attributes: &Json<'a>, name: &str) -> Result<Option<Accessor<'a>>> {
        let Some(reference) = attributes.get(name) else { return Ok(None) };
        let accessor = Accessor::open(self.document, &reference)?;
        if accessor.count == self.count {
            return Ok(Some(accessor));
        }
        let found =
            format!("{} in {}", counted(accessor.count, "element"), accessor.json.pointer());
        Err(reference.error(found, format!("{}, one per position", self.count)))
    }

    /// Returns the column if it is valid; otherwise warns that it is skipped.
    fn keep_if<T>(
        &self,
        column: Vec<T>,
        is_valid: bool,
        name: &str,
        reason: &str,
    ) -> Option<Vec<T>> {
        if !is_valid {
            self.document.warn(format!("{name} of a mesh is skipped: {reason}"));
        }
        is_valid.then_some(column)
    }
}

/// Scales weights so that their sum is 1. Weights that are all zero become 1 for the first joint.
fn normalize_weights(weights: &mut [f32; 4]) {
    // Negative weights become 0, and `max` maps NaN to 0 as well.
    *weights = weights.map(|weight| weight.clamp(0.0, f32::MAX / 8.0).max(0.0));
    let sum: f32 = weights.iter().sum();
    *weights = if 0.0 < sum { weights.map(|weight| weight / sum) } else { [1.0, 0.0, 0.0, 0.0] };
}

#[cfg(test)]
mod tests {
    //! Tests of the normalisation of joint weights.

    use super::*;

    #[test]
    fn weights_sum_to_one_for_any_input() {
        for (input, expected) in [
            ([1.0, 1.0, 2.0, 0.0], [0.25, 0.25, 0.5, 0.0]),
            ([f32::NAN, 2.0, -3.0, 0.0], [0.0, 1.0, 0.0, 0.0]),
            ([0.0; 4], [1.0, 0.0, 0.0, 0.0]),
            ([f32::INFINITY; 4], [0.25; 4]),
            ([1e-45, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]),
        ] {
            let mut weights = input;
            normalize_weights(&mut weights);
            assert_eq!(weights, expected);
        }
    }
}
