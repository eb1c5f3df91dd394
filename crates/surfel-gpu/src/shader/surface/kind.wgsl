// The shapes that the points of a tree have.

// Returns the distances to four points as shapes of the kernel's kind, -1 without a hit.
fn intersect_four(four: FourPoints, ray: Ray) -> vec4<f32> {
    var distances = vec4<f32>(-1.0);
    if SHAPE == SPHERE {
        distances = intersect_spheres(four, ray);
    } else if SHAPE == CAPSULE {
        distances = intersect_capsules(four, ray);
    } else if SHAPE == LEAVES {
        distances = intersect_leaves(four, ray);
    } else if SHAPE == MLS {
        distances = intersect_balls(four, ray);
    } else {
        distances = intersect_discs(four, ray);
    }
    return select(vec4<f32>(-1.0), distances, vec4<f32>(0.0) < four.radius);
}

// Returns the squares of the distances of four points from the positions at these distances along a ray.
fn squared_offsets(four: FourPoints, distance: vec4<f32>, direction: vec3<f32>) -> vec4<f32> {
    let x = four.x - distance * direction.x;
    let y = four.y - distance * direction.y;
    let z = four.z - distance * direction.z;
    return x * x + y * y + z * z;
}

// Returns the scalar products of four vectors with another one.
fn dot_four(x: vec4<f32>, y: vec4<f32>, z: vec4<f32>, vector: vec3<f32>) -> vec4<f32> {
    return x * vector.x + y * vector.y + z * vector.z;
}
