//! Rigid transforms.

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::error::{Error, Result, finite};

/// Largest |R^T R - I| of a rotation. KITTI's printed matrices are off by 8e-8; a matrix off by 1e-3 is a mistake.
const ORTHONORMALITY: f64 = 1e-4;

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
    /// A transform from its parts; `what` names it in errors.
    ///
    /// # Errors
    /// [`Error::NotFinite`], and [`Error::NotRigid`] where `|R^T R - I| > 1e-4` or `det R <= 0`.
    pub fn new(what: &'static str, rotation: Matrix3<f64>, translation: Vector3<f64>) -> Result<Self> {
        check_rotation(what, &rotation)?;
        for &value in translation.iter() {
            finite(what, value)?;
        }
        Ok(Self { rotation, translation })
    }

    /// A transform from its 4x4 matrix.
    ///
    /// # Errors
    /// Those of [`Pose::new`], and [`Error::LastRow`] where the last row is not (0, 0, 0, 1).
    pub fn from_matrix(what: &'static str, matrix: &Matrix4<f64>) -> Result<Self> {
        let last: [f64; 4] = std::array::from_fn(|column| matrix[(3, column)]);
        if last != [0.0, 0.0, 0.0, 1.0] {
            return Err(Error::LastRow { what, got: last });
        }
        Self::new(what, matrix.fixed_view::<3, 3>(0, 0).into(), matrix.fixed_view::<3, 1>(0, 3).into())
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

/// Refuses what is not a rotation.
pub(crate) fn check_rotation(what: &'static str, rotation: &Matrix3<f64>) -> Result<()> {
    for &value in rotation.iter() {
        finite(what, value)?;
    }
    let deviation = (rotation.transpose() * rotation - Matrix3::identity()).abs().max();
    let det = rotation.determinant();
    if deviation > ORTHONORMALITY {
        let mend = "check its order, units and whether a scale is mixed in";
        return Err(Error::NotRigid { what, deviation, det, mend });
    }
    if det <= 0.0 {
        let mend = "one of its two frames is left-handed: mirror that one, T @ diag(1, -1, 1, 1) for the source frame or diag(1, -1, 1, 1) @ T for the destination";
        return Err(Error::NotRigid { what, deviation, det, mend });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_from_euler;

    #[test]
    fn inverse_undoes_also_a_coarsely_printed_rotation() {
        let coarse = rotation_from_euler(0.1, 0.2, 0.3).map(|v| (v * 1e6).round() / 1e6);
        let pose = Pose::new("pose", coarse, Vector3::new(1.0, -2.0, 3.0)).unwrap();
        let point = Vector3::new(10.0, 20.0, 30.0);
        assert!((pose.inverse().transform(&pose.transform(&point)) - point).abs().max() < 1e-13);
        assert_eq!(pose.rotation(), &coarse);
    }

    #[test]
    fn refuses_scale_mirror_and_transposed_matrices() {
        let rotation = rotation_from_euler(0.1, 0.2, 0.3);
        let zero = Vector3::zeros();
        assert!(matches!(Pose::new("T", rotation * 1.001, zero), Err(Error::NotRigid { .. })));
        let mirrored = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)) * rotation;
        assert!(matches!(Pose::new("T", mirrored, zero), Err(Error::NotRigid { det, .. }) if det < 0.0));
        let transposed = Pose::new("T", rotation, Vector3::new(1.0, 2.0, 3.0)).unwrap().matrix().transpose();
        assert!(matches!(Pose::from_matrix("T", &transposed), Err(Error::LastRow { .. })));
        assert!(matches!(Pose::new("T", rotation * f64::NAN, zero), Err(Error::NotFinite { .. })));
        assert!(Pose::new("T", rotation * 1.00001, zero).is_ok());
    }
}
