//! Rigid transforms.

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::error::{Error, Result, finite, readable};

/// Largest |R^T R - I| of a rotation. KITTI's printed matrices are off by 8e-8; a matrix off by 1e-3 is a mistake.
const ORTHONORMALITY: f64 = 1e-4;

/// Largest |R^T R - I| that a rotation of two or three digits can have, whose nearest rotation is meant.
const FEW_DIGITS: f64 = 3e-2;

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
        let (rotation, translation) = parts(what, matrix)?;
        Self::new(what, rotation, translation)
    }

    /// A transform from a 4x4 matrix whose rotation was written with two or three digits: with the nearest rotation, that
    /// of its singular value decomposition.
    ///
    /// # Errors
    /// Those of [`Pose::from_matrix`], [`Error::NotRigid`] where `|R^T R - I| > 3e-2` or `det R <= 0`.
    pub fn nearest(what: &'static str, matrix: &Matrix4<f64>) -> Result<Self> {
        let (rotation, translation) = parts(what, matrix)?;
        Self::new(what, nearest_rotation(what, &rotation)?, translation)
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
fn parts(what: &'static str, matrix: &Matrix4<f64>) -> Result<(Matrix3<f64>, Vector3<f64>)> {
    let last: [f64; 4] = std::array::from_fn(|column| matrix[(3, column)]);
    if last == [0.0, 0.0, 0.0, 1.0] {
        return Ok((matrix.fixed_view::<3, 3>(0, 0).into(), matrix.fixed_view::<3, 1>(0, 3).into()));
    }
    let is_transposed = (0..3).all(|row| matrix[(row, 3)] == 0.0) && matrix[(3, 3)] == 1.0;
    let mend = if is_transposed {
        "it is transposed (row vectors): give its transpose, .T"
    } else {
        "give the pose alone, [R t] above [0, 0, 0, 1], without K or a scale"
    };
    Err(Error::LastRow { what, got: last, mend })
}

/// The rotation nearest to a matrix that nearly is one.
fn nearest_rotation(what: &'static str, matrix: &Matrix3<f64>) -> Result<Matrix3<f64>> {
    check_within(what, matrix, FEW_DIGITS)?;
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { unreachable!("asked for both") };
    Ok(u * v_t)
}

/// Refuses what is not a rotation; `what` is its name in the error.
///
/// # Errors
/// [`Error::NotRigid`] and [`Error::NotFinite`].
pub fn check_rotation(what: &'static str, rotation: &Matrix3<f64>) -> Result<()> {
    check_within(what, rotation, ORTHONORMALITY)
}

fn check_within(what: &'static str, rotation: &Matrix3<f64>, tolerance: f64) -> Result<()> {
    for &value in rotation.iter() {
        finite(what, value)?;
    }
    let gram = rotation.transpose() * rotation;
    let deviation = (gram - Matrix3::identity()).abs().max();
    let det = rotation.determinant();
    if deviation <= tolerance && det > 0.0 {
        return Ok(());
    }
    let scale = (gram.trace() / 3.0).sqrt();
    let is_scaled = (gram / (scale * scale) - Matrix3::identity()).abs().max() <= ORTHONORMALITY;
    let mut mends = Vec::new();
    if det <= 0.0 && (deviation <= FEW_DIGITS || is_scaled) {
        mends.push("one of its two frames is left-handed: mirror that one, T @ diag(1, -1, 1, 1) for the source frame or diag(1, -1, 1, 1) @ T for the destination".to_owned());
    }
    if is_scaled && deviation > ORTHONORMALITY {
        mends.push(format!("a scale is mixed in: divide R by {} and look at the units of t", readable(scale)));
    }
    if mends.is_empty() || det > 0.0 {
        if deviation <= FEW_DIGITS {
            mends.push("if it was written with few digits, pass nearest_rotation=True where a camera takes its pose, or give U V^T of its singular value decomposition".to_owned());
        } else if mends.is_empty() {
            mends.push("check the order of its entries (row by row), and that it is R and not K R".to_owned());
        }
    }
    Err(Error::NotRigid { what, deviation, det, mend: mends.join("; ") })
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
    fn few_digits_are_mended_by_the_nearest_rotation() {
        let rotation = rotation_from_euler(0.2, -0.3, 1.1);
        for digits in [1e-2, 1e-3, 1e-4] {
            let coarse = rotation.map(|v| (v / digits).round() * digits);
            let mut matrix = Matrix4::identity();
            matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&coarse);
            matrix[(0, 3)] = 1.7;
            let Err(refused) = Pose::from_matrix("T", &matrix) else { continue };
            assert!(refused.to_string().contains("nearest_rotation=True"), "{refused}");
            let pose = Pose::nearest("T", &matrix).unwrap();
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
    fn each_mistake_has_its_own_mend() {
        let rotation = rotation_from_euler(0.1, 0.2, 0.3);
        let mend = |matrix: Matrix3<f64>| Pose::new("T", matrix, Vector3::zeros()).unwrap_err().to_string();
        let mirrored = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)) * rotation;
        assert!(mend(mirrored).contains("left-handed") && !mend(mirrored).contains("nearest_rotation"));
        assert!(mend(mirrored.map(|v| (v * 1e3).round() / 1e3)).contains("left-handed"));
        assert!(mend(rotation * 1000.0).contains("divide R by 1000 "), "{}", mend(rotation * 1000.0));
        assert!(mend(rotation * 1.002).contains("nearest_rotation=True"));
        let sheared = rotation + Matrix3::new(0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        assert!(mend(sheared).contains("row by row") && !mend(sheared).contains("nearest_rotation"));
        for matrix in [mirrored, rotation * 1.1, sheared] {
            let mut pose = Matrix4::identity();
            pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&matrix);
            assert!(matches!(Pose::nearest("T", &pose), Err(Error::NotRigid { .. })));
        }
        let pose = Pose::new("T", rotation, Vector3::new(1.0, 2.0, 3.0)).unwrap().matrix();
        assert!(Pose::from_matrix("T", &pose.transpose()).unwrap_err().to_string().contains(".T"));
        assert!(!Pose::from_matrix("T", &(pose * 2.0)).unwrap_err().to_string().contains(".T"));
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
