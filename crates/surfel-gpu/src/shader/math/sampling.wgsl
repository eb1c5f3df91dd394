// Maps from the unit square to directions, and the stratified points for them.

const PI: f32 = 3.1415927;
const TAU: f32 = 6.2831855;

// Maps the unit square to the unit disk and preserves areas (concentric map, Shirley and Chiu 1997).
fn disk(uv: vec2<f32>) -> vec2<f32> {
    let a = 2.0 * uv.x - 1.0;
    let b = 2.0 * uv.y - 1.0;
    if a == 0.0 && b == 0.0 {
        return vec2<f32>(0.0);
    }
    if abs(b) < abs(a) {
        return a * cos_sin_of_eighth(TAU / 8.0 * (b / a));
    }
    return b * cos_sin_of_eighth(TAU / 8.0 * (a / b)).yx;
}

// Returns the cosine and the sine of an angle of a few turns at most, to a unit in the last place. Devices have functions
// of their own with a hundred times the error, by which rays pass other sides of rims than on the CPU.
fn cos_sin(angle: f32) -> vec2<f32> {
    let n_quarters = round(angle * (4.0 / TAU));
    // A quarter of a turn in two parts: products with the first one are exact.
    let found = cos_sin_of_eighth((angle - n_quarters * 1.5703125) - n_quarters * 4.838267949e-4);
    let quarter = u32(i32(n_quarters)) & 3u;
    let turned = select(found, vec2<f32>(-found.y, found.x), (quarter & 1u) == 1u);
    return select(turned, -turned, 2u <= quarter);
}

// Returns the cosine and the sine of an angle of at most an eighth of a turn (polynomials of Moshier's Cephes library).
fn cos_sin_of_eighth(angle: f32) -> vec2<f32> {
    let square = angle * angle;
    let of_cos = (2.4433157118e-5 * square - 1.3887316255e-3) * square + 4.1666645683e-2;
    let of_sin = (-1.9515295891e-4 * square + 8.3321608736e-3) * square - 1.6666654611e-1;
    return vec2<f32>(1.0 - 0.5 * square + of_cos * square * square, angle + of_sin * square * angle);
}

// Maps the unit square to directions around +Z with density cos / pi (Malley's method).
fn cosine_hemisphere(uv: vec2<f32>) -> vec3<f32> {
    let on_disk = disk(uv);
    return vec3<f32>(on_disk, sqrt(max(1.0 - dot(on_disk, on_disk), 0.0)));
}

// Maps the unit square to directions around +Z, uniform within the cone of half angle acos(cos_max).
fn uniform_cone(uv: vec2<f32>, cos_max: f32) -> vec3<f32> {
    let on_disk = disk(uv);
    let height = 1.0 - cos_max;
    // Equal areas of the disk go to equal heights of the cap (Archimedes).
    let z = 1.0 - dot(on_disk, on_disk) * height;
    return vec3<f32>(on_disk * sqrt(max(height * (1.0 + z), 0.0)), z);
}

// Returns point `sample_idx` of an Owen-scrambled (0,2)-sequence.
fn owen_sobol_2d(sample_idx: u32, seed: vec2<u32>) -> vec2<f32> {
    let index = owen_scramble(sample_idx, seed.y >> 8u);
    let x = owen_scramble(reverseBits(index), seed.x);
    let y = owen_scramble(sobol_second_dimension(index), seed.y ^ 0x68bc21ebu);
    return vec2<f32>(unit_interval(x), unit_interval(y));
}

fn sobol_second_dimension(first: u32) -> u32 {
    var index = first;
    var direction = 1u << 31u;
    var result = 0u;
    while index != 0u {
        if (index & 1u) == 1u {
            result ^= direction;
        }
        index >>= 1u;
        direction ^= direction >> 1u;
    }
    return result;
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    var x = reverseBits(value);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverseBits(x);
}

fn unit_interval(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}
