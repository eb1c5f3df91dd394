// Orthonormal bases around a direction.

struct Basis {
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    normal: vec3<f32>,
}

// Builds a basis around a unit vector (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
fn basis_around(normal: vec3<f32>) -> Basis {
    let is_negative = (bitcast<u32>(normal.z) >> 31u) == 1u;
    return signed_basis(normal, select(1.0, -1.0, is_negative));
}

// Builds the basis whose tangents the edge test uses: a Z of minus zero counts as positive there.
fn tangent_basis(normal: vec3<f32>) -> Basis {
    return signed_basis(normal, select(1.0, -1.0, normal.z < 0.0));
}

fn signed_basis(normal: vec3<f32>, sign: f32) -> Basis {
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    return Basis(
        vec3<f32>(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        vec3<f32>(b, sign + normal.y * normal.y * a, -normal.y),
        normal,
    );
}

fn basis_to_world(basis: Basis, local: vec3<f32>) -> vec3<f32> {
    return local.x * basis.tangent + local.y * basis.bitangent + local.z * basis.normal;
}
