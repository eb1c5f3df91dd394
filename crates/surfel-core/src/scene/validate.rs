//! Checks of a graph's invariants, for tests and after each import in debug builds.

use super::animation::{Channel, Interpolation, Keyframes, Track};
use super::graph::{Geometry, Graph, Node};
use super::mesh::Mesh;
use crate::math::Vec3;
use crate::points::{Morph, PointCloud, Skin};

impl<C: AsRef<PointCloud>> Graph<C> {
    /// Panics unless all indices are in range, all columns have matching lengths, all positions are finite,
    /// and parents come before their children.
    pub fn validate(&self) {
        for geometry in &self.geometries {
            match geometry {
                Geometry::Points(cloud) => validate_cloud(cloud.as_ref()),
                Geometry::Triangles(mesh) => validate_mesh(mesh),
            }
        }
        for texture in &self.textures {
            let n_texels = texture.width as usize * texture.height as usize;
            assert!(0 < n_texels && texture.texels.len() == n_texels, "texels of a texture");
        }
        for mut material in self.materials.iter().cloned() {
            material.textures.for_each_mut(|reference| {
                assert!(reference.texture < self.textures.len(), "texture of a material");
                assert!(reference.uv_set < 2, "texture coordinates of a material");
            });
        }
        for (i, node) in self.nodes.iter().enumerate() {
            assert!(node.parent.is_none_or(|parent| parent < i), "parent of node {i}");
            self.validate_node(node);
        }
        for channel in &self.animation.channels {
            assert!(channel.node < self.nodes.len(), "node of a channel");
            validate_track(channel);
        }
    }

    fn validate_node(&self, node: &Node) {
        for joint in &node.joints {
            assert!(joint.node < self.nodes.len(), "joint of {}", node.name);
            assert!(joint.joint_from_mesh.is_finite(), "joint of {}", node.name);
        }
        assert!(node.transform.matrix().is_finite(), "transform of {}", node.name);
        for primitive in &node.primitives {
            assert!(primitive.material < self.materials.len(), "material in {}", node.name);
            assert!(primitive.geometry < self.geometries.len(), "geometry in {}", node.name);
            let geometry = &self.geometries[primitive.geometry];
            check_column("morph targets", node.morph_weights.len(), geometry.morphs().len());
            if let Some(skin) = geometry.skin().filter(|_| !node.joints.is_empty()) {
                let used = skin.joints.as_flattened().iter();
                assert!(used.max().is_none_or(|max| usize::from(*max) < node.joints.len()));
            }
        }
    }
}

fn validate_mesh(mesh: &Mesh) {
    let n = mesh.positions.len();
    assert!(mesh.origin.is_finite() && all_finite(&mesh.positions), "positions of a mesh");
    let corners = mesh.triangles.as_flattened();
    assert!(corners.iter().all(|corner| (*corner as usize) < n), "corners of triangles");
    let check =
        |name: &str, length: Option<usize>| assert!(length.is_none_or(|l| l == n), "{name}");
    check("normals", mesh.normals.as_ref().map(Vec::len));
    check("tangents", mesh.tangents.as_ref().map(Vec::len));
    check("colours", mesh.colors.as_ref().map(Vec::len));
    for uvs in &mesh.uvs {
        check("texture coordinates", uvs.as_ref().map(Vec::len));
        assert!(uvs.iter().flatten().all(|uv| uv.is_finite()), "texture coordinates");
    }
    assert!(all_finite(mesh.normals.as_deref().unwrap_or_default()), "normals of a mesh");
    validate_deformation(&mesh.morphs, mesh.skin.as_ref(), n);
}

/// Checks the morph targets and skin of `n` points or vertices.
fn validate_deformation(morphs: &[Morph], skin: Option<&Skin>, n: usize) {
    let check =
        |name: &str, length: Option<usize>| assert!(length.is_none_or(|l| l == n), "{name}");
    for morph in morphs {
        check("positions of a morph target", Some(morph.positions.len()));
        check("normals of a morph target", morph.normals.as_ref().map(Vec::len));
        check("tangents of a morph target", morph.tangents.as_ref().map(Vec::len));
        check("radii of a morph target", morph.radii.as_ref().map(Vec::len));
        assert!(all_finite(&morph.positions), "positions of a morph target");
        assert!(all_finite(morph.normals.as_deref().unwrap_or_default()), "normals of a target");
        assert!(all_finite(morph.tangents.as_deref().unwrap_or_default()), "tangents of a target");
    }
    if let Some(skin) = skin {
        check("joints", Some(skin.joints.len()));
        check("weights", Some(skin.weights.len()));
        let sums = skin.weights.iter().map(|weights| weights.iter().sum::<f32>());
        assert!(sums.into_iter().all(|sum| (sum - 1.0).abs() < 1e-3), "weights add up to 1");
    }
}

fn validate_cloud(cloud: &PointCloud) {
    assert!(cloud.origin.is_finite() && all_finite(&cloud.positions), "positions of points");
    for (column, length) in cloud.column_lengths() {
        assert_eq!(length, cloud.len(), "{column} of points");
    }
    validate_deformation(&cloud.morphs, cloud.skin.as_ref(), cloud.len());
}

fn validate_track(channel: &Channel) {
    match &channel.track {
        Track::Translation(keys) | Track::Scale(keys) => validate_keys(keys),
        Track::Rotation(keys) => validate_keys(keys),
        Track::MorphWeights(keys) => validate_keys(keys),
        Track::Visible(keys) => validate_keys(keys),
    }
}

fn validate_keys<T>(keys: &Keyframes<T>) {
    let n_values = match keys.interpolation {
        Interpolation::Cubic => 3 * keys.times_secs.len(),
        _ => keys.times_secs.len(),
    };
    assert!(0 < n_values && keys.values.len() == n_values, "values of a track");
    assert!(keys.times_secs.is_sorted(), "times of a track");
    assert!(keys.times_secs.iter().all(|time| time.is_finite()), "times of a track");
}

/// Panics unless a column is absent (empty) or as long as it should be.
fn check_column(name: &str, length: usize, expected: usize) {
    assert!(length == 0 || expected == 0 || length == expected, "{name}: {length}, {expected}");
}

fn all_finite(vectors: &[Vec3]) -> bool {
    vectors.iter().all(|vector| vector.is_finite())
}
