//! Eigenvectors of symmetric 3x3 matrices.

use super::DVec3;

/// A symmetric 3x3 matrix by its six different entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SymmetricMatrix {
    pub xx: f64,
    pub xy: f64,
    pub xz: f64,
    pub yy: f64,
    pub yz: f64,
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

    /// Eigenvalues in rising order with unit eigenvectors (cyclic Jacobi rotations, Jacobi 1846).
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

/// Unit eigenvector of the smallest eigenvalue, and all eigenvalues in rising order.
pub fn smallest_eigenvector(matrix: &SymmetricMatrix) -> (DVec3, [f64; 3]) {
    let (values, vectors) = matrix.eigen();
    (vectors[0], values)
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
    fn a_zero_matrix_gives_the_axes() {
        let (values, vectors) = SymmetricMatrix::default().eigen();
        assert_eq!(values, [0.0; 3]);
        assert_eq!(vectors[0], DVec3::X);
    }
}
