// Counter-based random numbers. A 64-bit integer is a vector of its lower and its upper half.

fn add_u64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn multiply_u32(a: u32, b: u32) -> vec2<u32> {
    let a_low = a & 0xffffu;
    let a_high = a >> 16u;
    let b_low = b & 0xffffu;
    let b_high = b >> 16u;
    let low = a_low * b_low;
    let cross_a = a_high * b_low;
    let cross_b = a_low * b_high;
    let middle = (low >> 16u) + (cross_a & 0xffffu) + (cross_b & 0xffffu);
    let high = a_high * b_high + (cross_a >> 16u) + (cross_b >> 16u) + (middle >> 16u);
    return vec2<u32>((middle << 16u) | (low & 0xffffu), high);
}

fn multiply_u64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = multiply_u32(a.x, b.x);
    return vec2<u32>(low.x, low.y + a.x * b.y + a.y * b.x);
}

// `n_bits` is from 1 to 31.
fn shift_right_u64(a: vec2<u32>, n_bits: u32) -> vec2<u32> {
    return vec2<u32>((a.x >> n_bits) | (a.y << (32u - n_bits)), a.y >> n_bits);
}

// Hashes by mixing all bits (the finaliser of SplitMix64, Steele et al. 2014).
fn hash(key: vec2<u32>) -> vec2<u32> {
    var value = add_u64(key, vec2<u32>(0x7f4a7c15u, 0x9e3779b9u));
    value = multiply_u64(value ^ shift_right_u64(value, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
    value = multiply_u64(value ^ shift_right_u64(value, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
    return value ^ shift_right_u64(value, 31u);
}
