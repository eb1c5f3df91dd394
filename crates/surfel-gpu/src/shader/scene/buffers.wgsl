// The arrays of a scene that shading reads.

@group(2) @binding(0) var<storage, read> materials: array<MaterialRecord>;
@group(2) @binding(1) var<storage, read> instances: array<InstanceRecord>;
@group(2) @binding(2) var<storage, read> lights: array<LightRecord>;
// Texels of textures, and the pixels and distributions of environment maps.
@group(2) @binding(3) var<storage, read> words: array<u32>;
