// The arrays of a tree in pages, each as large as an array may be, and the records of its instances.

@group(2) @binding(0) var<storage, read> visits: array<Visit>;
@group(2) @binding(1) var<storage, read> nodes_0: array<vec4<u32>>;
@group(2) @binding(2) var<storage, read> nodes_1: array<vec4<u32>>;
@group(2) @binding(3) var<storage, read> blocks_0: array<vec4<u32>>;
@group(2) @binding(4) var<storage, read> blocks_1: array<vec4<u32>>;
@group(2) @binding(5) var<storage, read> blocks_2: array<vec4<u32>>;
@group(2) @binding(6) var<storage, read> blocks_3: array<vec4<u32>>;

const PAGE_MASK: u32 = (1u << PAGE_SHIFT) - 1u;

fn node_vector(idx: u32) -> vec4<u32> {
    if idx >> PAGE_SHIFT == 0u {
        return nodes_0[idx];
    }
    return nodes_1[idx & PAGE_MASK];
}

fn block_vector(idx: u32) -> vec4<u32> {
    let at = idx & PAGE_MASK;
    switch idx >> PAGE_SHIFT {
        case 0u: {
            return blocks_0[at];
        }
        case 1u: {
            return blocks_1[at];
        }
        case 2u: {
            return blocks_2[at];
        }
        default: {
            return blocks_3[at];
        }
    }
}

fn block_word(idx: u32) -> u32 {
    let component = idx & 3u;
    let at = (idx >> 2u) & PAGE_MASK;
    switch idx >> (PAGE_SHIFT + 2u) {
        case 0u: {
            return blocks_0[at][component];
        }
        case 1u: {
            return blocks_1[at][component];
        }
        case 2u: {
            return blocks_2[at][component];
        }
        default: {
            return blocks_3[at][component];
        }
    }
}
