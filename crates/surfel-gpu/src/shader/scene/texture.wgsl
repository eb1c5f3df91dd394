// Textures of triangles.

// Returns the linear value of a texture at the coordinates of a hit.
fn sample_texture(texture: TextureRecord, uvs: vec4<f32>, is_srgb: bool) -> vec4<f32> {
    let given = select(uvs.xy, uvs.zw, (texture.flags & TEXTURE_SECOND_UV_SET) != 0u);
    let scaled = texture.scale * given;
    // The rotation is counter-clockwise if the second coordinate points down.
    let rotated = vec2<f32>(
        texture.cos * scaled.x + texture.sin * scaled.y,
        texture.cos * scaled.y - texture.sin * scaled.x,
    );
    let position = (texture.offset + rotated) * vec2<f32>(f32(texture.width), f32(texture.height));
    if (texture.flags & TEXTURE_IS_NEAREST) != 0u {
        return texel(texture, floor(position), is_srgb);
    }
    let corner = floor(position - 0.5);
    let weight = position - 0.5 - corner;
    let right = vec2<f32>(1.0, 0.0);
    let below = vec2<f32>(0.0, 1.0);
    let above_edge = mix(texel(texture, corner, is_srgb), texel(texture, corner + right, is_srgb), weight.x);
    let below_edge =
        mix(texel(texture, corner + below, is_srgb), texel(texture, corner + below + right, is_srgb), weight.x);
    return mix(above_edge, below_edge, weight.y);
}

fn texel(texture: TextureRecord, position: vec2<f32>, is_srgb: bool) -> vec4<f32> {
    let x = wrapped(position.x, texture.width, texture.flags >> TEXTURE_WRAP_X);
    let y = wrapped(position.y, texture.height, texture.flags >> TEXTURE_WRAP_Y);
    let value = words[texture.first_word + y * texture.width + x];
    let bytes = (vec4<u32>(value) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
    let linear = vec4<f32>(bytes) / 255.0;
    if is_srgb {
        return vec4<f32>(decode(bytes.x), decode(bytes.y), decode(bytes.z), linear.w);
    }
    return linear;
}

fn decode(encoded: u32) -> f32 {
    return tables.srgb[encoded >> 2u][encoded & 3u];
}

// Returns the index of the texel at `position`, of `size` texels.
fn wrapped(position: f32, size: u32, wrap: u32) -> u32 {
    let n = i32(size);
    let at = i32(clamp(position, -1e9, 1e9));
    if (wrap & 3u) == WRAP_CLAMP {
        return u32(clamp(at, 0, n - 1));
    }
    if (wrap & 3u) == WRAP_MIRRORED {
        let folded = remainder(at, 2 * n);
        return u32(min(folded, 2 * n - 1 - folded));
    }
    return u32(remainder(at, n));
}

// Returns the remainder that is not negative.
fn remainder(value: i32, divisor: i32) -> i32 {
    let rest = value % divisor;
    return select(rest, rest + divisor, rest < 0);
}
