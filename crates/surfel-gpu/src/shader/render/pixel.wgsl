// Sums of pixels in fixed point, 32 bits before and 32 behind the point: they do not depend on the order of summands.

// The greatest summand. A sum that is full takes no more, so that 128 of them at once are needed to wrap it around.
const MAX_SUMMAND: f32 = 16777216.0;

fn add_radiance(pixel: u32, radiance: vec3<f32>) {
    add_channel(pixel, 0u, radiance.x);
    add_channel(pixel, 1u, radiance.y);
    add_channel(pixel, 2u, radiance.z);
}

fn add_alpha(pixel: u32, alpha: f32) {
    add_channel(pixel, 3u, alpha);
}

fn add_channel(pixel: u32, channel: u32, value: f32) {
    // Bits are compared, because a driver may take no number for NaN: those of NaN and of negative numbers are greater than
    // those of infinity.
    let bits = bitcast<u32>(value);
    if bits == 0u || 0x7f800000u < bits {
        return;
    }
    let summand = min(value, MAX_SUMMAND);
    let whole = floor(summand);
    let fraction = u32((summand - whole) * 4294967296.0);
    let before = atomicAdd(&pixels[pixel][channel], fraction);
    let carry = select(0u, 1u, before + fraction < before);
    let upper = u32(whole) + carry;
    if upper != 0u && atomicLoad(&pixels[pixel][4u + channel]) < FULL_SUM {
        atomicAdd(&pixels[pixel][4u + channel], upper);
    }
}
