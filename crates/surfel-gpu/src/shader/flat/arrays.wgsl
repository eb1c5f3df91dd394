// The arrays of a tree, and the records of its instances.

@group(2) @binding(0) var<storage, read> visits: array<Visit>;
@group(2) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(2) @binding(2) var<storage, read> blocks: array<vec4<u32>>;

fn node_vector(idx: u32) -> vec4<u32> {
    return nodes[idx];
}

fn block_vector(idx: u32) -> vec4<u32> {
    return blocks[idx];
}

fn block_word(idx: u32) -> u32 {
    return blocks[idx >> 2u][idx & 3u];
}
