//! Eigenvectors of symmetric 3x3 matrices.

use super::DVec3;

/// A symmetric 3x3 matrix, given by its six distinct entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SymmetricMatrix {
    /// Entry in the first row and first column.
    pub xx: f64,
    /// Entry in the first row and second column.
    pub xy: f64,
    /// Entry in the first row and third column.
    pub xz: f64,
    /// Entry in the second row and second column.
    pub yy: f64,
    /// Entry in the second row and third column.
    pub yz: f64,
    /// Entry in the third row and third column.
    pub zz: f64,
}

impl SymmetricMatrix {
    /// Adds `weight * v * v^T`.
    pub fn add_outer(&mut self, v: DVec3, weight: f64) {
        self.xx += weight * v.x * v.x;
        self.xy += weight * v.x * v.y;
        self.xz += weight * v.x * v.z;
        self.yy += weight * v.y * v.y;
        self.yz += weight * v.y * v.z;
        self.zz += weight * v.z * v.z;
    }

    fn scaled(&self, factor: f64) -> Self {
        Self {
            xx: factor * self.xx,
            xy: factor * self.xy,
            xz: factor * self.xz,
            yy: factor * self.yy,
            yz: factor * self.yz,
            zz: factor * self.zz,
        }
    }

    /// Returns the adjugate of this matrix minus `shift` times the identity.
    fn adjugate(&self, shift: f64) -> Self {
        let (xx, yy, zz) = (self.xx - shift, self.yy - shift, self.zz - shift);
        Self {
            xx: yy * zz - self.yz * self.yz,
            xy: self.xz * self.yz - self.xy * zz,
            xz: self.xy * self.yz - self.xz * yy,
            yy: xx * zz - self.xz * self.xz,
            yz: self.xy * self.xz - xx * self.yz,
            zz: xx * yy - self.xy * self.xy,
        }
    }

    /// Returns the eigenvalues in rising order and their unit eigenvectors (cyclic Jacobi rotations, Jacobi
    /// 1846).
    pub fn eigen(&self) -> ([f64; 3], [DVec3; 3]) {
        let mut a =
            [[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]];
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let scale = a.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        // Convergence is quadratic: 3x3 needs at most five or six sweeps.
        for _ in 0..12 {
            if a[0][1].abs() + a[0][2].abs() + a[1][2].abs() <= 1e-18 * scale {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut a, &mut v, p, q);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
        let column = |k: usize| DVec3::new(v[0][k], v[1][k], v[2][k]);
        (order.map(|k| a[k][k]), order.map(column))
    }
}

/// Returns the unit eigenvector of the smallest eigenvalue, and all eigenvalues in rising order.
///
/// It is fast for positive semidefinite matrices such as covariances; others take Jacobi rotations.
pub fn smallest_eigenvector(matrix: &SymmetricMatrix) -> (DVec3, [f64; 3]) {
    closed_form(matrix).unwrap_or_else(|| {
        let (values, vectors) = matrix.eigen();
        (vectors[0], values)
    })
}

/// Solves the well-separated case without iterated rotations; returns `None` where digits would be lost.
fn closed_form(matrix: &SymmetricMatrix) -> Option<(DVec3, [f64; 3])> {
    let trace = matrix.xx + matrix.yy + matrix.zz;
    // NaN fails this test.
    if !(f64::MIN_POSITIVE.sqrt() < trace && trace < f64::MAX.sqrt()) {
        return None;
    }
    let unit = matrix.scaled(1.0 / trace);
    let adjugate = unit.adjugate(0.0);
    let minors = adjugate.xx + adjugate.yy + adjugate.zz;
    // A nearly linear covariance has its second eigenvalue near this bound. NaN fails this test, too.
    let is_plane = 1e-5 < minors;
    if !is_plane {
        return None;
    }
    let determinant = unit.xx * adjugate.xx + unit.xy * adjugate.xy + unit.xz * adjugate.xz;
    let smallest = smallest_root(minors, determinant)?;
    let projector = unit.adjugate(smallest);
    let columns = [
        DVec3::new(projector.xx, projector.xy, projector.xz),
        DVec3::new(projector.xy, projector.yy, projector.yz),
        DVec3::new(projector.xz, projector.yz, projector.zz),
    ];
    // The adjugate of A - l0 is (l1 - l0)(l2 - l0) v v^T: its largest diagonal entry has the best column.
    let best = DVec3::new(projector.xx, projector.yy, projector.zz).max_position();
    let is_separate = 1e-6 < columns[best][best];
    if !is_separate {
        return None;
    }
    let sum = 1.0 - smallest;
    let product = minors - smallest * sum;
    let spread = (0.25 * sum * sum - product).max(0.0).sqrt();
    let values = [smallest, 0.5 * sum - spread, 0.5 * sum + spread];
    Some((columns[best].normalize(), values.map(|value| trace * value)))
}

/// Returns the smallest root of x^3 - x^2 + minors x - determinant, found by Newton's method from the left,
/// which rises without overshoot.
fn smallest_root(minors: f64, determinant: f64) -> Option<f64> {
    let mut x = 0.0;
    for _ in 0..12 {
        let value = ((x - 1.0) * x + minors) * x - determinant;
        let slope = (3.0 * x - 2.0) * x + minors;
        let step = value / slope;
        x -= step;
        if step.abs() <= 1e-15 {
            return Some(x.max(0.0));
        }
    }
    None
}

/// Zeroes `a[p][q]` by a rotation and applies it to the columns of `v`.
fn rotate(a: &mut [[f64; 3]; 3], v: &mut [[f64; 3]; 3], p: usize, q: usize) {
    if a[p][q] == 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let cos = 1.0 / (t * t + 1.0).sqrt();
    let sin = t * cos;
    let shift = t * a[p][q];
    a[p][p] -= shift;
    a[q][q] += shift;
    a[p][q] = 0.0;
    a[q][p] = 0.0;
    let r = 3 - p - q;
    let (arp, arq) = (a[r][p], a[r][q]);
    a[r][p] = cos * arp - sin * arq;
    a[p][r] = a[r][p];
    a[r][q] = sin * arp + cos * arq;
    a[q][r] = a[r][q];
    for row in v {
        let (vp, vq) = (row[p], row[q]);
        row[p] = cos * vp - sin * vq;
        row[q] = sin * vp + cos * vq;
    }
}

#[cfg(test)]
mod tests {
    //! Eigenvectors satisfy their equation, and the closed form agrees with Jacobi rotations.

    use super::*;
    use crate::math::Random;

    fn times(m: &SymmetricMatrix, v: DVec3) -> DVec3 {
        DVec3::new(
            m.xx * v.x + m.xy * v.y + m.xz * v.z,
            m.xy * v.x + m.yy * v.y + m.yz * v.z,
            m.xz * v.x + m.yz * v.y + m.zz * v.z,
        )
    }

    #[test]
    fn eigenvectors_satisfy_their_equation() {
        let mut random = Random::new(1, 0);
        for case in 0..2000 {
            let spread = 10f64.powi(case % 13 - 6);
            let mut m = SymmetricMatrix::default();
            for _ in 0..1 + case % 5 {
                let v = DVec3::new(
                    random.next_gaussian(),
                    random.next_gaussian(),
                    random.next_gaussian(),
                );
                m.add_outer(spread * v, 1.0);
            }
            let (values, vectors) = m.eigen();
            assert!(values[0] <= values[1] && values[1] <= values[2]);
            for (value, vector) in values.iter().zip(vectors) {
                let residual = (times(&m, vector) - *value * vector).length();
                assert!(residual <= 1e-12 * values[2].abs(), "case {case}: {residual}");
                assert!((vector.length() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_closed_form_agrees_with_jacobi() {
        let mut random = Random::new(2, 0);
        let mut n_closed = 0;
        for case in 0..4000 {
            let thickness = 10f64.powi(-(case % 9));
            let width = 10f64.powi(-(case / 9 % 4));
            let scale = DVec3::new(1.0, width, thickness) * 10f64.powi(case % 21 - 10);
            let turn = glam::DQuat::from_rotation_z(random.next_f64() * 6.0)
                * glam::DQuat::from_rotation_x(random.next_f64() * 6.0);
            let mut m = SymmetricMatrix::default();
            for _ in 0..16 {
                let v = DVec3::from_array(std::array::from_fn(|_| random.next_gaussian()));
                m.add_outer(turn * (v * scale), 1.0);
            }
            let (exact_values, exact) = m.eigen();
            let (vector, values) = smallest_eigenvector(&m);
            n_closed += usize::from(closed_form(&m).is_some());
            let gap = (exact_values[1] - exact_values[0]) / exact_values[2];
            let sine = vector.cross(exact[0]).length();
            assert!(sine < 1e-12 / gap, "case {case}: {sine} at gap {gap}");
            for (value, exact) in values.iter().zip(exact_values) {
                // The smallest is a difference of products: its error is relative to the widest ratio.
                let tolerance = 1e-13 * exact_values[2] * exact_values[2] / exact_values[1];
                assert!((value - exact).abs() < tolerance, "case {case}: {value} {exact}");
            }
        }
        assert!(2000 < n_closed, "{n_closed}");
    }

    #[test]
    fn matrices_that_are_no_covariance_have_a_result() {
        for xx in [0.0, 1e-300, 1e300, -1.0] {
            let (vector, values) =
                smallest_eigenvector(&SymmetricMatrix { xx, ..SymmetricMatrix::default() });
            assert!(vector.is_normalized() && values[0] <= values[2]);
        }
    }

    #[test]
    fn zero_matrix_gives_the_axes() {
        let (values, vectors) = SymmetricMatrix::default().eigen();
        assert_eq!(values, [0.0; 3]);
        assert_eq!(vectors[0], DVec3::X);
    }
}
