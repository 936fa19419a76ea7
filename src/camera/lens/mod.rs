//! Lens models: from a direction in the camera frame to the plane that K takes to pixels, and back.
//!
//! Each model knows its domain: the largest cone around the axis in which no two directions share an image. Outside it
//! there is no image, so nothing is painted twice. Every model is written once, in plain float64 without branches where
//! its formula allows, and used for single points and for the rows of a table alike.

mod angle;
mod brown_conrady;
mod division;
mod double_sphere;
pub(crate) mod error;
mod eucm;
mod fit;
mod fov;
mod ftheta;
mod inverse_brown_conrady;
mod kannala_brandt;
mod line;
mod mei;
mod ocam;
mod of_angle;
mod panorama;
mod planar;
mod polynomial;
mod radial_polynomial;
mod thin_prism;

pub use brown_conrady::BrownConrady;
pub use division::Division;
pub use double_sphere::DoubleSphere;
pub use eucm::Eucm;
pub use fov::Fov;
pub use ftheta::{FTheta, FThetaForm};
pub use inverse_brown_conrady::InverseBrownConrady;
pub use kannala_brandt::KannalaBrandt;
pub use mei::Mei;
pub use ocam::Ocam;
pub use panorama::{Cylindrical, Equirectangular};
pub use radial_polynomial::RadialPolynomial;
pub use thin_prism::ThinPrismFisheye;

pub(crate) use brown_conrady::Terms;
pub(crate) use double_sphere::Spheres;
pub(crate) use ftheta::Way;
pub(crate) use line::Line;
pub(crate) use ocam::Radii;
pub(crate) use thin_prism::Prisms;

use nalgebra::{Matrix3, Vector3};

use crate::error::{Error, LensError, Result};

/// What a model does with a direction: the part that loops over cells are made of.
pub(crate) trait Distort {
    /// The image of direction (x, y, z), of any length, on the plane that K takes to pixels; NaN outside the domain.
    fn distort(&self, x: f64, y: f64, z: f64) -> (f64, f64);

    /// Whether [`Distort::draft`] leaves some answers open.
    const DRAFTS: bool = false;

    /// [`Distort::distort`] without branches or loops of unknown length, so that a loop over it becomes vectors. Where
    /// it cannot tell, the first number is infinite, which no answer is.
    #[inline(always)]
    fn draft(&self, x: f64, y: f64, z: f64) -> (f64, f64) {
        self.distort(x, y, z)
    }

    /// For a model that begins with `(X / Z, Y / Z)`, what it makes of a straight line, in pixels.
    #[inline(always)]
    fn on_line(&self, _line: Line, _intrinsics: &Matrix3<f64>) -> Option<OnLine<impl Fn(f64) -> (f64, f64)>> {
        None::<OnLine<fn(f64) -> (f64, f64)>>
    }
}

/// The images of many directions, to the last bit those of [`Distort::distort`]: first as vectors, then what that left open.
#[inline(always)]
pub(crate) fn distort_all<L: Distort>(lens: &L, direction: impl Fn(usize) -> [f64; 3], xs: &mut [f64], ys: &mut [f64]) {
    let count = xs.len();
    let ys = &mut ys[..count];
    for i in 0..count {
        let [x, y, z] = direction(i);
        (xs[i], ys[i]) = lens.draft(x, y, z);
    }
    // all of them first: seldom is any open, and a loop without branches finds that out
    if L::DRAFTS && xs.iter().fold(false, |open, &x| open | (x == f64::INFINITY)) {
        for i in 0..count {
            if xs[i] == f64::INFINITY {
                let [x, y, z] = direction(i);
                (xs[i], ys[i]) = lens.distort(x, y, z);
            }
        }
    }
}

/// What a lens makes of a [`Line`].
pub(crate) struct OnLine<F> {
    /// The pixel of a point at m on the line, also beyond the domain.
    pub(crate) pixel: F,
    /// Largest m^2 of the domain; negative where the line is outside it.
    pub(crate) end: f64,
}

/// A lens model. `pixel = K [lens(direction); 1]`: most models give what a pinhole would see, so that K holds focal
/// lengths in pixels; [`RadialPolynomial`], [`FTheta`] and [`Ocam`] give pixels, so that K is `[[1, 0, cx], [0, aspect, cy], [0,
/// 0, 1]]`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Lens {
    /// OpenCV's model, plumb_bob, radtan.
    BrownConrady(BrownConrady),
    /// Equidistant, fisheye, KB4.
    KannalaBrandt(KannalaBrandt),
    /// Unified omnidirectional camera with radtan.
    Mei(Mei),
    /// Double sphere.
    DoubleSphere(DoubleSphere),
    /// Enhanced unified camera model.
    Eucm(Eucm),
    /// WoodScape's polynomial of the angle, in pixels.
    RadialPolynomial(RadialPolynomial),
    /// Scaramuzza's polynomial of the radius, in pixels.
    Ocam(Ocam),
    /// NVIDIA's polynomial of the angle or of the radius, in pixels.
    FTheta(FTheta),
    /// Field of view, Devernay and Faugeras.
    Fov(Fov),
    /// Division, Fitzgibbon.
    Division(Division),
    /// Brown-Conrady from the image to the ray, RealSense.
    InverseBrownConrady(InverseBrownConrady),
    /// Fisheyes with tangential and thin prism terms, COLMAP and Project Aria.
    ThinPrismFisheye(ThinPrismFisheye),
    /// A panorama on a cylinder.
    Cylindrical(Cylindrical),
    /// A panorama on a sphere.
    Equirectangular(Equirectangular),
}

/// Calls `$body` with `$model` bound to what the lens is made of.
macro_rules! each_model {
    ($lens:expr, $model:ident => $body:expr) => {
        match $lens {
            Lens::BrownConrady($model) => $body,
            Lens::KannalaBrandt($model) => $body,
            Lens::Mei($model) => $body,
            Lens::DoubleSphere($model) => $body,
            Lens::Eucm($model) => $body,
            Lens::RadialPolynomial($model) => $body,
            Lens::Ocam($model) => $body,
            Lens::FTheta($model) => $body,
            Lens::Fov($model) => $body,
            Lens::Division($model) => $body,
            Lens::InverseBrownConrady($model) => $body,
            Lens::ThinPrismFisheye($model) => $body,
            Lens::Cylindrical($model) => $body,
            Lens::Equirectangular($model) => $body,
        }
    };
}

/// Calls `$body` with `$model` bound to a reference to what loops over many directions are made of, and `$Model` to its
/// type: the models that branch by their parameters are split into ones that do not.
macro_rules! each_distort {
    ($lens:expr, $model:ident: $Model:ident => $body:expr) => {{
        use $crate::camera::lens::{Lens, Prisms, Radii, Spheres, Terms, Way};
        macro_rules! with {
            ($made:expr, $type:ty) => {{
                type $Model = $type;
                let $model: &$Model = $made;
                $body
            }};
        }
        match $lens {
            Lens::BrownConrady(lens) => match lens.terms() {
                5 => with!(&Terms::<5>(*lens), Terms<5>),
                8 => with!(&Terms::<8>(*lens), Terms<8>),
                12 => with!(&Terms::<12>(*lens), Terms<12>),
                _ => with!(&Terms::<14>(*lens), Terms<14>),
            },
            Lens::KannalaBrandt(lens) => with!(lens, $crate::camera::KannalaBrandt),
            Lens::Mei(lens) => with!(lens, $crate::camera::Mei),
            Lens::DoubleSphere(lens) if lens.is_near() => with!(&Spheres::<true>(*lens), Spheres<true>),
            Lens::DoubleSphere(lens) => with!(&Spheres::<false>(*lens), Spheres<false>),
            Lens::Eucm(lens) => with!(lens, $crate::camera::Eucm),
            Lens::RadialPolynomial(lens) => with!(lens, $crate::camera::RadialPolynomial),
            Lens::Ocam(lens) if lens.polynomial().len() <= 5 => with!(&Radii::<5>(*lens), Radii<5>),
            Lens::Ocam(lens) => with!(&Radii::<12>(*lens), Radii<12>),
            Lens::FTheta(lens) if lens.form() == $crate::camera::FThetaForm::Backward => {
                with!(&Way::<true>(*lens), Way<true>)
            }
            Lens::FTheta(lens) => with!(&Way::<false>(*lens), Way<false>),
            Lens::Fov(lens) => with!(lens, $crate::camera::Fov),
            Lens::Division(lens) => with!(lens, $crate::camera::Division),
            Lens::InverseBrownConrady(lens) => with!(lens, $crate::camera::InverseBrownConrady),
            Lens::ThinPrismFisheye(lens) if lens.is_after() => with!(&Prisms::<true>(*lens), Prisms<true>),
            Lens::ThinPrismFisheye(lens) => with!(&Prisms::<false>(*lens), Prisms<false>),
            Lens::Cylindrical(lens) => with!(lens, $crate::camera::Cylindrical),
            Lens::Equirectangular(lens) => with!(lens, $crate::camera::Equirectangular),
        }
    }};
}
pub(crate) use each_distort;

impl Lens {
    /// Whether a direction whose largest component is of size `largest` may be taken as it is: fourth powers of what is
    /// larger or smaller would not be finite or not be numbers of full precision.
    #[inline(always)]
    pub(crate) fn takes(largest: f64) -> bool {
        (1e-70..1e70).contains(&largest)
    }

    /// The image of a direction of the camera frame (x right, y down, z forward), of any length: what K takes to pixels.
    /// `None` outside the domain.
    pub fn project(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        let largest = direction.amax();
        let ray = if Self::takes(largest) { *direction } else { direction / largest };
        let (mx, my) = each_model!(self, model => model.distort(ray.x, ray.y, ray.z));
        (mx.is_finite() && my.is_finite()).then_some([mx, my])
    }

    /// The unit direction whose image is `m`; `None` where `m` is the image of none.
    pub fn unproject(&self, m: [f64; 2]) -> Option<Vector3<f64>> {
        /// How far the image of the answer may be from what was asked: rounding. Far out it counts with the square,
        /// because there a small angle is a long way, and a direction is only known to 1e-16.
        const TOLERANCE: f64 = 1e-13;
        /// Beyond so many units the square would allow for any answer at all: a thousandth is the most.
        const FARTHEST: f64 = 1e10;
        if !(m[0].is_finite() && m[1].is_finite()) {
            return None;
        }
        let found = each_model!(self, model => model.undistort(m))?.normalize();
        let size = 1.0 + m[0].hypot(m[1]) / self.unit();
        let tolerance = TOLERANCE * size * size.min(FARTHEST) * self.unit() + self.rounding(&found);
        // at the edge of the domain, where the image stands still, rounding leaves it by 1e-8 and more
        [0.0, 1e-15, 1e-12, 1e-10, 1e-8].into_iter().find_map(|pull| {
            let ray = if pull == 0.0 { found } else { towards_axis(&found, self.max_angle(), pull) };
            let [mx, my] = self.project(&ray)?;
            let defined = self.is_defined_by_its_inverse();
            (defined || (mx - m[0]).abs() <= tolerance && (my - m[1]).abs() <= tolerance).then_some(ray)
        })
    }

    /// Whether the formula goes from the image to the direction; the other way, a search, is uncertain near the edge.
    fn is_defined_by_its_inverse(&self) -> bool {
        match self {
            Self::Ocam(_) | Self::InverseBrownConrady(_) | Self::Division(_) => true,
            Self::FTheta(lens) => lens.form() == FThetaForm::Backward,
            _ => false,
        }
    }

    /// How far rounding of a direction can move its image, for a lens whose image stretches without bound: before a
    /// pole of its quotient that is far more than its size says.
    fn rounding(&self, ray: &Vector3<f64>) -> f64 {
        match self {
            Self::BrownConrady(lens) => lens.rounding(ray.x / ray.z, ray.y / ray.z),
            _ => 0.0,
        }
    }

    /// What a radian on the axis is on the lens's plane: 1, or pixels.
    pub(super) fn unit(&self) -> f64 {
        match self {
            Self::RadialPolynomial(lens) => lens.coefficients()[0],
            Self::Ocam(lens) => lens.polynomial()[0].abs(),
            Self::FTheta(lens) => lens.unit(),
            _ => 1.0,
        }
    }

    /// The validity limit: the angle from the axis, radians, up to which directions have an image. It is where the image
    /// would fold back, or less where a smaller one was given.
    pub fn max_angle(&self) -> f64 {
        each_model!(self, model => model.max_angle())
    }

    /// The model's name, as its constructor is called.
    pub fn name(&self) -> &'static str {
        match self {
            Self::BrownConrady(_) => "BrownConrady",
            Self::KannalaBrandt(_) => "KannalaBrandt",
            Self::Mei(_) => "Mei",
            Self::DoubleSphere(_) => "DoubleSphere",
            Self::Eucm(_) => "Eucm",
            Self::RadialPolynomial(_) => "RadialPolynomial",
            Self::Ocam(_) => "Ocam",
            Self::FTheta(_) => "FTheta",
            Self::Fov(_) => "Fov",
            Self::Division(_) => "Division",
            Self::InverseBrownConrady(_) => "InverseBrownConrady",
            Self::ThinPrismFisheye(_) => "ThinPrismFisheye",
            Self::Cylindrical(_) => "Cylindrical",
            Self::Equirectangular(_) => "Equirectangular",
        }
    }
}

impl std::fmt::Display for Lens {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        each_model!(self, model => write!(f, "{model}"))
    }
}

macro_rules! lens_from {
    ($($model:ident),*) => {$(
        impl From<$model> for Lens {
            fn from(model: $model) -> Self {
                Self::$model(model)
            }
        }
    )*};
}
lens_from!(
    BrownConrady,
    KannalaBrandt,
    Mei,
    DoubleSphere,
    Eucm,
    RadialPolynomial,
    Ocam,
    FTheta,
    Fov,
    Division,
    InverseBrownConrady,
    ThinPrismFisheye,
    Cylindrical,
    Equirectangular
);

/// A unit direction, turned towards +z as far as `widest` if it is farther from it, and a small angle more.
fn towards_axis(ray: &Vector3<f64>, widest: f64, pull: f64) -> Vector3<f64> {
    let r = ray.x.hypot(ray.y);
    let (sin, cos) = (r.atan2(ray.z).min(widest) - pull).sin_cos();
    Vector3::new(ray.x / r * sin, ray.y / r * sin, cos)
}

/// 1 / (alpha d + (1 - alpha) z) where d^2 is t + z^2. Behind, where the sum would lose its digits, it is a quotient of sums.
#[inline(always)]
fn one_over_shifted(alpha: f64, d: f64, z: f64, t: f64) -> f64 {
    let (far, near) = (alpha * d, (1.0 - alpha) * z);
    let behind = z < 0.0;
    let numerator = if behind { far - near } else { 1.0 };
    let denominator = if behind { alpha * alpha * t + (2.0 * alpha - 1.0) * (z * z) } else { far + near };
    numerator / denominator
}

/// z of the ray through a point at squared radius `s` from the axis, (x, y, z), where `alpha sqrt(x^2 + y^2 + z^2) +
/// (1 - alpha) z = 1`; `None` beyond the last such point.
fn shifted_sphere_z(alpha: f64, s: f64) -> Option<f64> {
    let square = 1.0 - (2.0 * alpha - 1.0) * s;
    if square < -1e-9 {
        return None;
    }
    let root = alpha * square.max(0.0).sqrt();
    // two forms of one number: the first loses digits near alpha = 1, the second is 0 / 0 at alpha = 1 / 2
    Some(if alpha < 0.75 {
        (1.0 - alpha * alpha * s) / (root + (1.0 - alpha))
    } else {
        (root - (1.0 - alpha)) / (2.0 * alpha - 1.0)
    })
}

/// Coefficients of the counts that a model takes.
fn coefficients<const N: usize>(
    lens: &'static str,
    expected: &'static str,
    counts: &[usize],
    given: &[f64],
) -> Result<[f64; N]> {
    if !counts.contains(&given.len()) {
        return Err(Error::Lens(LensError::Coefficients { lens, expected, got: given.len() }));
    }
    let mut all = [0.0; N];
    for (own, &value) in all.iter_mut().zip(given) {
        *own = parameter(lens, "coefficients", "finite numbers", value, value.is_finite())?;
    }
    Ok(all)
}

/// A parameter, if it holds what its model needs.
fn parameter(lens: &'static str, name: &'static str, expected: &'static str, value: f64, holds: bool) -> Result<f64> {
    if holds { Ok(value) } else { Err(Error::Lens(LensError::Parameter { lens, name, expected, got: value })) }
}

/// Refuses a lens that ends at `angle` because its image folds back almost on the axis, and not at the caller's limit.
fn sees(lens: &'static str, expected: &'static str, angle: f64, limit: f64) -> Result<()> {
    /// Radians: the longest telephoto lens sees more, and wrong coefficients leave less.
    const NARROWEST: f64 = 1e-3;
    if angle >= NARROWEST.min(0.999 * limit) {
        Ok(())
    } else {
        Err(Error::Lens(LensError::Folds { lens, expected, angle }))
    }
}

/// A limit that the caller sets, or the whole sphere but its last point, where every azimuth meets.
fn limit(lens: &'static str, max_angle: Option<f64>) -> Result<f64> {
    /// The direction straight behind has no azimuth.
    const BEHIND: f64 = std::f64::consts::PI - 1e-9;
    let Some(angle) = max_angle else { return Ok(BEHIND) };
    let expected = "an angle from the axis in radians, above 0 and up to pi";
    let holds = angle > 0.0 && angle <= std::f64::consts::PI;
    parameter(lens, "max_angle", expected, angle, holds).map(|angle| angle.min(BEHIND))
}

/// Numbers as a Python list or tuple holds them.
fn listed(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", ")
}

/// `, max_angle=...` where the caller set one.
fn shown(max_angle: Option<f64>) -> String {
    max_angle.map_or_else(String::new, |angle| format!(", max_angle={angle:?}"))
}
