// The last pass of a part: means of samples, composited over the background.

// Linear colours of pixels, and their coverage in w.
@group(2) @binding(0) var<storage, read_write> colors: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP_SIZE)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.x;
    if frame.n_rays <= pixel {
        return;
    }
    let sum = vec4<f32>(channel(pixel, 0u), channel(pixel, 1u), channel(pixel, 2u), channel(pixel, 3u));
    let mean = sum / f32(frame.n_samples);
    var color = mean.xyz;
    if frame.background == GRADIENT {
        color += (1.0 - mean.w) * pixel_background(pixel);
    }
    colors[pixel] = vec4<f32>(color, mean.w);
}

// Returns the sum of a channel. Each half of the fixed point is rounded once, and their sum once more. A full sum is
// the same whatever was added last.
fn channel(pixel: u32, i: u32) -> f32 {
    let lower = f32(atomicLoad(&pixels[pixel][i])) * 2.3283064365386963e-10;
    return f32(min(atomicLoad(&pixels[pixel][4u + i]), FULL_SUM)) + lower;
}
