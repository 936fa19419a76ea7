//! Rigid transforms.

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::error::PoseError;

/// Largest |R^T R - I| of a rotation. KITTI's printed matrices are off by 8e-8; a matrix off by 1e-3 is a mistake.
const ORTHONORMALITY: f64 = 1e-4;

/// Largest |R^T R - I| that a rotation of two or three digits can have, whose nearest rotation is meant.
const FEW_DIGITS: f64 = 3e-2;

/// Farthest that two frames' origins lie apart, metres. Beyond it float64 tells no tenth of a millimetre from the next, and far
/// beyond it squares and inverses overflow, so that a camera stood nowhere. Earth-centred coordinates in millimetres reach
/// 6.4e9.
const FARTHEST: f64 = 1e12;

/// A rigid transform `dst_from_src`: `p_dst = R p_src + t`, metres.
///
/// The rotation is kept as given, not forced to be orthonormal: calibration files print six or seven digits, and the
/// nearest rotation to KITTI's matrices moves pixels by 1e-3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Pose {
    /// A transform from its parts.
    ///
    /// # Errors
    /// [`PoseError::NotFinite`], [`PoseError::NotRigid`] where `|R^T R - I| > 1e-4` or `det R <= 0`, and
    /// [`PoseError::TooFar`] where a coordinate of the translation exceeds 1e12 m.
    pub fn new(rotation: Matrix3<f64>, translation: Vector3<f64>) -> Result<Self, PoseError> {
        check_rotation(&rotation)?;
        check_finite(translation.as_slice())?;
        if let Some(&got) = translation.iter().find(|along| along.abs() > FARTHEST) {
            return Err(PoseError::TooFar { got });
        }
        Ok(Self { rotation, translation })
    }

    /// A transform from its 4x4 matrix.
    ///
    /// # Errors
    /// Those of [`Pose::new`], and [`PoseError::LastRow`] where the last row is not (0, 0, 0, 1).
    pub fn from_matrix(matrix: &Matrix4<f64>) -> Result<Self, PoseError> {
        let (rotation, translation) = parts(matrix)?;
        Self::new(rotation, translation)
    }

    /// A transform from a 4x4 matrix whose rotation was written with two or three digits: with the nearest rotation, that
    /// of its singular value decomposition.
    ///
    /// # Errors
    /// Those of [`Pose::from_matrix`], [`PoseError::NotRigid`] where `|R^T R - I| > 3e-2` or `det R <= 0`.
    pub fn nearest(matrix: &Matrix4<f64>) -> Result<Self, PoseError> {
        let (rotation, translation) = parts(matrix)?;
        Self::new(nearest_rotation(&rotation)?, translation)
    }

    /// The 3x3 rotation, as given.
    pub fn rotation(&self) -> &Matrix3<f64> {
        &self.rotation
    }

    /// The translation: the source frame's origin in the destination frame.
    pub fn translation(&self) -> &Vector3<f64> {
        &self.translation
    }

    /// The 4x4 matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.rotation);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix
    }

    /// `R p + t`.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// `src_from_dst`: the true inverse, not the transpose, so that there and back is exact also for matrices that
    /// were printed with six digits.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.try_inverse().expect("a checked rotation has det > 0");
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// The transform between frames whose axes are turned over (-1) or not (1); of the six signs an even number is -1.
    pub(crate) fn with_axes(&self, dst: [f64; 3], src: [f64; 3]) -> Self {
        let (dst, src) = (Vector3::from(dst), Vector3::from(src));
        let rotation = Matrix3::from_fn(|row, column| dst[row] * self.rotation[(row, column)] * src[column]);
        Self { rotation, translation: dst.component_mul(&self.translation) }
    }

    /// The transform with both parts replaced by maps that keep it rigid.
    pub(super) fn map(
        &self,
        rotation: impl Fn(&Matrix3<f64>) -> Matrix3<f64>,
        translation: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Self {
        Self { rotation: rotation(&self.rotation), translation: translation(&self.translation) }
    }
}

/// R and t of a 4x4 matrix.
fn parts(matrix: &Matrix4<f64>) -> Result<(Matrix3<f64>, Vector3<f64>), PoseError> {
    let last: [f64; 4] = std::array::from_fn(|column| matrix[(3, column)]);
    if last == [0.0, 0.0, 0.0, 1.0] {
        return Ok((matrix.fixed_view::<3, 3>(0, 0).into(), matrix.fixed_view::<3, 1>(0, 3).into()));
    }
    let is_transposed = (0..3).all(|row| matrix[(row, 3)] == 0.0) && matrix[(3, 3)] == 1.0;
    Err(PoseError::LastRow { got: last, is_transposed })
}

/// The rotation nearest to a matrix that nearly is one.
fn nearest_rotation(matrix: &Matrix3<f64>) -> Result<Matrix3<f64>, PoseError> {
    check_within(matrix, FEW_DIGITS)?;
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { unreachable!("asked for both") };
    Ok(u * v_t)
}

/// Refuses what is not a rotation.
///
/// # Errors
/// [`PoseError::NotRigid`] and [`PoseError::NotFinite`].
pub fn check_rotation(rotation: &Matrix3<f64>) -> Result<(), PoseError> {
    check_within(rotation, ORTHONORMALITY)
}

fn check_finite(entries: &[f64]) -> Result<(), PoseError> {
    match entries.iter().find(|entry| !entry.is_finite()) {
        Some(&got) => Err(PoseError::NotFinite { got }),
        None => Ok(()),
    }
}

fn check_within(rotation: &Matrix3<f64>, tolerance: f64) -> Result<(), PoseError> {
    check_finite(rotation.as_slice())?;
    let gram = rotation.transpose() * rotation;
    let deviation = (gram - Matrix3::identity()).abs().max();
    let det = rotation.determinant();
    if deviation <= tolerance && det > 0.0 {
        return Ok(());
    }
    let scale = (gram.trace() / 3.0).sqrt();
    let is_scaled = (gram / (scale * scale) - Matrix3::identity()).abs().max() <= ORTHONORMALITY;
    Err(PoseError::NotRigid {
        deviation,
        det,
        scale: (is_scaled && deviation > ORTHONORMALITY).then_some(scale),
        is_mirrored: det <= 0.0 && (deviation <= FEW_DIGITS || is_scaled),
        is_coarse: deviation <= FEW_DIGITS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_from_euler;

    #[test]
    fn inverse_undoes_also_a_coarsely_printed_rotation() {
        let coarse = rotation_from_euler(0.1, 0.2, 0.3).map(|v| (v * 1e6).round() / 1e6);
        let pose = Pose::new(coarse, Vector3::new(1.0, -2.0, 3.0)).unwrap();
        let point = Vector3::new(10.0, 20.0, 30.0);
        assert!((pose.inverse().transform(&pose.transform(&point)) - point).abs().max() < 1e-13);
        assert_eq!(pose.rotation(), &coarse);
    }

    #[test]
    fn frames_lie_at_most_so_far_apart() {
        for far in [1.1e12, -1e300, f64::MAX] {
            let refused = Pose::new(Matrix3::identity(), Vector3::new(0.0, far, 1.0));
            assert_eq!(refused, Err(PoseError::TooFar { got: far }));
        }
        let pose = Pose::new(rotation_from_euler(0.1, 0.2, 0.3), Vector3::new(1e12, -1e12, 1e12)).unwrap();
        assert!(pose.inverse().translation().iter().all(|along| along.is_finite()));
    }

    #[test]
    fn few_digits_are_mended_by_the_nearest_rotation() {
        let rotation = rotation_from_euler(0.2, -0.3, 1.1);
        for digits in [1e-2, 1e-3, 1e-4] {
            let coarse = rotation.map(|v| (v / digits).round() * digits);
            let mut matrix = Matrix4::identity();
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&coarse);
            matrix[(0, 3)] = 1.7;
            let Err(refused) = Pose::from_matrix(&matrix) else { continue };
            assert!(matches!(refused, PoseError::NotRigid { is_coarse: true, .. }), "{refused}");
            let pose = Pose::nearest(&matrix).unwrap();
            let found = pose.rotation();
            assert!((found.transpose() * found - Matrix3::identity()).abs().max() < 1e-14);
            // the nearest one: R^T M is symmetric
            let product = found.transpose() * coarse;
            assert!((product - product.transpose()).abs().max() < 1e-14);
            assert!((found - rotation).abs().max() < digits);
            assert_eq!(pose.translation().x, 1.7);
        }
    }

    #[test]
    fn what_is_known_of_a_mistake_is_told() {
        let rotation = rotation_from_euler(0.1, 0.2, 0.3);
        let told = |matrix: Matrix3<f64>| match Pose::new(matrix, Vector3::zeros()) {
            Err(PoseError::NotRigid { scale, is_mirrored, is_coarse, .. }) => {
                (scale.map(|scale| (scale * 1e6).round() / 1e6), is_mirrored, is_coarse)
            }
            other => panic!("{other:?}"),
        };
        let mirrored = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)) * rotation;
        assert_eq!(told(mirrored), (None, true, true));
        assert_eq!(told(mirrored.map(|v| (v * 1e3).round() / 1e3)), (None, true, true));
        assert_eq!(told(mirrored * 5.0), (Some(5.0), true, false));
        assert_eq!(told(rotation * 1000.0), (Some(1000.0), false, false));
        assert_eq!(told(rotation * 1.002), (Some(1.002), false, true));
        let sheared = rotation + Matrix3::new(0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        assert_eq!(told(sheared), (None, false, false));
        for matrix in [mirrored, rotation * 1.1, sheared] {
            let mut pose = Matrix4::identity();
            pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&matrix);
            assert!(matches!(Pose::nearest(&pose), Err(PoseError::NotRigid { .. })));
        }
        let pose = Pose::new(rotation, Vector3::new(1.0, 2.0, 3.0)).unwrap().matrix();
        for (matrix, expected) in [(pose.transpose(), true), (pose * 2.0, false)] {
            let got = Pose::from_matrix(&matrix);
            assert!(matches!(got, Err(PoseError::LastRow { is_transposed, .. }) if is_transposed == expected));
        }
    }

    #[test]
    fn refuses_scale_mirror_and_transposed_matrices() {
        let rotation = rotation_from_euler(0.1, 0.2, 0.3);
        let zero = Vector3::zeros();
        assert!(matches!(Pose::new(rotation * 1.001, zero), Err(PoseError::NotRigid { .. })));
        let mirrored = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)) * rotation;
        assert!(matches!(Pose::new(mirrored, zero), Err(PoseError::NotRigid { det, .. }) if det < 0.0));
        let transposed = Pose::new(rotation, Vector3::new(1.0, 2.0, 3.0)).unwrap().matrix().transpose();
        assert!(matches!(Pose::from_matrix(&transposed), Err(PoseError::LastRow { .. })));
        assert!(matches!(Pose::new(rotation * f64::NAN, zero), Err(PoseError::NotFinite { .. })));
        assert!(Pose::new(rotation * 1.00001, zero).is_ok());
    }
}
