//! Lens models.

use std::hash::{Hash, Hasher};

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::convert::{Floats, Reduced, float, floats, rebuilt_by_new, tuple_text, type_name, word};
use super::error::classes::{ArgumentError, ArgumentTypeError};
use crate::view::buffer;
use crate::{
    BrownConrady, Cylindrical, Division, DoubleSphere, Equirectangular, Eucm, FTheta, FThetaForm, Fov,
    InverseBrownConrady, KannalaBrandt, Lens, Mei, Ocam, RadialPolynomial, ThinPrismFisheye,
};

/// A list of numbers, of any length.
fn numbers(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let floats = Floats::new(name, "a list", object)?;
    match floats.shape() {
        // OpenCV writes its coefficients as a row or a column
        [_] | [1, _] | [_, 1] => Ok(buffer::copied("coefficients", floats.values())?),
        shape => {
            let got = tuple_text(shape);
            Err(ArgumentError::new_err(format!("{name}: expected a list of numbers, got an array of shape {got}")))
        }
    }
}

fn limit(object: Option<&Bound<'_, PyAny>>) -> PyResult<Option<f64>> {
    object.map(|object| float("max_angle", object)).transpose()
}

/// The Python class of one model: what all have in common.
macro_rules! lens_class {
    ($class:ident, $model:ident, $name:literal, $self:ident => ($($argument:expr),*), { $($methods:tt)* }) => {
        #[doc = help!($name)]
        #[pyclass(frozen, eq, hash, module = "ipm_rs", name = $name)]
        #[derive(Clone, PartialEq)]
        pub(super) struct $class {
            lens: $model,
        }

        impl Hash for $class {
            fn hash<H: Hasher>(&self, state: &mut H) {
                hash_lens(&self.lens.into(), state);
            }
        }

        #[pymethods]
        impl $class {
            $($methods)*

            #[doc = help!($name, ".max_angle")]
            #[getter]
            fn max_angle(&self) -> f64 {
                self.lens.max_angle()
            }

            fn __reduce__<'py>(&$self, py: Python<'py>) -> PyResult<Reduced<'py>> {
                let keywords = PyDict::new(py);
                if let Some(angle) = $self.lens.limit() {
                    keywords.set_item("max_angle", angle)?;
                }
                let arguments: Vec<Bound<'py, PyAny>> = vec![$($argument.into_pyobject(py)?.into_any()),*];
                rebuilt_by_new(py.get_type::<Self>(), PyTuple::new(py, arguments)?, keywords)
            }

            fn __repr__(&self) -> String {
                self.lens.to_string()
            }
        }
    };
}

/// The class of a model that has a list of coefficients alone.
macro_rules! coefficients_class {
    ($class:ident, $model:ident, $name:literal) => {
        lens_class!($class, $model, $name, self => (self.lens.coefficients().to_vec()), {
            #[new]
            #[pyo3(signature = (coefficients, *, max_angle = None))]
            fn new(coefficients: &Bound<'_, PyAny>, max_angle: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
                Ok(Self { lens: $model::new(&numbers("coefficients", coefficients)?, limit(max_angle)?)? })
            }

            #[doc = help!($name, ".coefficients")]
            #[getter]
            fn coefficients(&self) -> Vec<f64> {
                self.lens.coefficients().to_vec()
            }
        });
    };
}

coefficients_class!(PyBrownConrady, BrownConrady, "BrownConrady");
coefficients_class!(PyKannalaBrandt, KannalaBrandt, "KannalaBrandt");
coefficients_class!(PyRadialPolynomial, RadialPolynomial, "RadialPolynomial");
coefficients_class!(PyInverseBrownConrady, InverseBrownConrady, "InverseBrownConrady");
coefficients_class!(PyThinPrismFisheye, ThinPrismFisheye, "ThinPrismFisheye");

lens_class!(PyMei, Mei, "Mei",
    self => (self.lens.xi(), self.lens.coefficients().to_vec()), {
    #[new]
    #[pyo3(signature = (xi, coefficients, *, max_angle = None))]
    fn new(
        xi: &Bound<'_, PyAny>,
        coefficients: &Bound<'_, PyAny>,
        max_angle: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Ok(Self { lens: Mei::new(float("xi", xi)?, &numbers("coefficients", coefficients)?, limit(max_angle)?)? })
    }

    #[doc = help!("Mei.xi")]
    #[getter]
    fn xi(&self) -> f64 {
        self.lens.xi()
    }

    #[doc = help!("Mei.coefficients")]
    #[getter]
    fn coefficients(&self) -> Vec<f64> {
        self.lens.coefficients().to_vec()
    }
});

lens_class!(PyDoubleSphere, DoubleSphere, "DoubleSphere",
    self => (self.lens.xi(), self.lens.alpha()), {
    #[new]
    #[pyo3(signature = (xi, alpha, *, max_angle = None))]
    fn new(xi: &Bound<'_, PyAny>, alpha: &Bound<'_, PyAny>, max_angle: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self { lens: DoubleSphere::new(float("xi", xi)?, float("alpha", alpha)?, limit(max_angle)?)? })
    }

    #[doc = help!("DoubleSphere.xi")]
    #[getter]
    fn xi(&self) -> f64 {
        self.lens.xi()
    }

    #[doc = help!("DoubleSphere.alpha")]
    #[getter]
    fn alpha(&self) -> f64 {
        self.lens.alpha()
    }
});

lens_class!(PyEucm, Eucm, "Eucm",
    self => (self.lens.alpha(), self.lens.beta()), {
    #[new]
    #[pyo3(signature = (alpha, beta, *, max_angle = None))]
    fn new(alpha: &Bound<'_, PyAny>, beta: &Bound<'_, PyAny>, max_angle: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self { lens: Eucm::new(float("alpha", alpha)?, float("beta", beta)?, limit(max_angle)?)? })
    }

    #[doc = help!("Eucm.alpha")]
    #[getter]
    fn alpha(&self) -> f64 {
        self.lens.alpha()
    }

    #[doc = help!("Eucm.beta")]
    #[getter]
    fn beta(&self) -> f64 {
        self.lens.beta()
    }
});

lens_class!(PyOcam, Ocam, "Ocam",
    self => (self.lens.polynomial().to_vec(), self.lens.affine().to_vec()), {
    #[new]
    #[pyo3(
        signature = (polynomial, affine = None, *, max_angle = None),
        text_signature = "(polynomial, affine=(1.0, 0.0, 0.0), *, max_angle=None)"
    )]
    fn new(
        polynomial: &Bound<'_, PyAny>,
        affine: Option<&Bound<'_, PyAny>>,
        max_angle: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let affine = affine.map_or(Ok([1.0, 0.0, 0.0]), |object| floats("affine", "(c, d, e)", object))?;
        Ok(Self { lens: Ocam::new(&numbers("polynomial", polynomial)?, affine, limit(max_angle)?)? })
    }

    #[doc = help!("Ocam.polynomial")]
    #[getter]
    fn polynomial(&self) -> Vec<f64> {
        self.lens.polynomial().to_vec()
    }

    #[doc = help!("Ocam.affine")]
    #[getter]
    fn affine(&self) -> (f64, f64, f64) {
        self.lens.affine().into()
    }
});

lens_class!(PyFTheta, FTheta, "FTheta",
    self => (self.lens.polynomial().to_vec(), self.lens.form().to_string(), self.lens.linear().to_vec()), {
    #[new]
    #[pyo3(
        signature = (polynomial, form, linear = None, *, max_angle = None),
        text_signature = "(polynomial, form, linear=(1.0, 0.0, 0.0), *, max_angle=None)"
    )]
    fn new(
        polynomial: &Bound<'_, PyAny>,
        form: &Bound<'_, PyAny>,
        linear: Option<&Bound<'_, PyAny>>,
        max_angle: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let expected = "form: expected \"forward\", from the angle to pixels, or \"backward\", from pixels to the angle";
        let form = match word(expected, form)?.as_ref() {
            "forward" => FThetaForm::Forward,
            "backward" => FThetaForm::Backward,
            other => return Err(ArgumentError::new_err(format!("{expected}, got {other:?}"))),
        };
        let linear = linear.map_or(Ok([1.0, 0.0, 0.0]), |object| floats("linear", "(c, d, e)", object))?;
        Ok(Self { lens: FTheta::new(&numbers("polynomial", polynomial)?, form, linear, limit(max_angle)?)? })
    }

    #[doc = help!("FTheta.polynomial")]
    #[getter]
    fn polynomial(&self) -> Vec<f64> {
        self.lens.polynomial().to_vec()
    }

    #[doc = help!("FTheta.form")]
    #[getter]
    fn form(&self) -> String {
        self.lens.form().to_string()
    }

    #[doc = help!("FTheta.linear")]
    #[getter]
    fn linear(&self) -> (f64, f64, f64) {
        self.lens.linear().into()
    }
});

/// The class of a model that has one number.
macro_rules! number_class {
    ($class:ident, $model:ident, $name:literal, $number:ident) => {
        lens_class!($class, $model, $name, self => (self.lens.$number()), {
            #[new]
            #[pyo3(signature = ($number, *, max_angle = None))]
            fn new($number: &Bound<'_, PyAny>, max_angle: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
                Ok(Self { lens: $model::new(float(stringify!($number), $number)?, limit(max_angle)?)? })
            }

            #[doc = help!($name, ".", stringify!($number))]
            #[getter]
            fn $number(&self) -> f64 {
                self.lens.$number()
            }
        });
    };
}

number_class!(PyFov, Fov, "Fov", omega);
number_class!(PyDivision, Division, "Division", k);

/// The class of a model that has no numbers.
macro_rules! panorama_class {
    ($class:ident, $model:ident, $name:literal) => {
        lens_class!($class, $model, $name, self => (), {
            #[new]
            #[pyo3(signature = (*, max_angle = None))]
            fn new(max_angle: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
                Ok(Self { lens: $model::new(limit(max_angle)?)? })
            }
        });
    };
}

panorama_class!(PyCylindrical, Cylindrical, "Cylindrical");
panorama_class!(PyEquirectangular, Equirectangular, "Equirectangular");

/// The lens of a `lens=` argument.
pub(super) fn lens(object: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Lens>> {
    let Some(object) = object else { return Ok(None) };
    macro_rules! try_each {
        ($($class:ident),*) => {
            $(if let Ok(own) = object.cast::<$class>() {
                return Ok(Some(own.get().lens.into()));
            })*
        };
    }
    try_each!(
        PyBrownConrady,
        PyKannalaBrandt,
        PyMei,
        PyDoubleSphere,
        PyEucm,
        PyRadialPolynomial,
        PyOcam,
        PyFTheta,
        PyFov
    );
    try_each!(PyDivision, PyInverseBrownConrady, PyThinPrismFisheye, PyCylindrical, PyEquirectangular);
    Err(ArgumentTypeError::new_err(format!(
        "lens: expected None, a pinhole, or a lens model such as ipm_rs.BrownConrady([k1, k2, p1, p2]), got {}",
        type_name(object)
    )))
}

/// A lens as an object of its Python class.
pub(super) fn lens_to_python<'py>(py: Python<'py>, lens: &Lens) -> PyResult<Bound<'py, PyAny>> {
    Ok(match *lens {
        Lens::BrownConrady(lens) => Bound::new(py, PyBrownConrady { lens })?.into_any(),
        Lens::KannalaBrandt(lens) => Bound::new(py, PyKannalaBrandt { lens })?.into_any(),
        Lens::Mei(lens) => Bound::new(py, PyMei { lens })?.into_any(),
        Lens::DoubleSphere(lens) => Bound::new(py, PyDoubleSphere { lens })?.into_any(),
        Lens::Eucm(lens) => Bound::new(py, PyEucm { lens })?.into_any(),
        Lens::RadialPolynomial(lens) => Bound::new(py, PyRadialPolynomial { lens })?.into_any(),
        Lens::Ocam(lens) => Bound::new(py, PyOcam { lens })?.into_any(),
        Lens::FTheta(lens) => Bound::new(py, PyFTheta { lens })?.into_any(),
        Lens::Fov(lens) => Bound::new(py, PyFov { lens })?.into_any(),
        Lens::Division(lens) => Bound::new(py, PyDivision { lens })?.into_any(),
        Lens::InverseBrownConrady(lens) => Bound::new(py, PyInverseBrownConrady { lens })?.into_any(),
        Lens::ThinPrismFisheye(lens) => Bound::new(py, PyThinPrismFisheye { lens })?.into_any(),
        Lens::Cylindrical(lens) => Bound::new(py, PyCylindrical { lens })?.into_any(),
        Lens::Equirectangular(lens) => Bound::new(py, PyEquirectangular { lens })?.into_any(),
    })
}

/// Feeds what equal lenses have equal.
pub(super) fn hash_lens<H: Hasher>(lens: &Lens, state: &mut H) {
    lens.name().hash(state);
    let mut feed = |values: &[f64]| values.iter().for_each(|value| (value + 0.0).to_bits().hash(state)); // 0.0 == -0.0
    match lens {
        Lens::BrownConrady(lens) => feed(lens.all_coefficients()),
        Lens::KannalaBrandt(lens) => feed(lens.coefficients()),
        Lens::Mei(lens) => (feed(&[lens.xi()]), feed(lens.coefficients())).1,
        Lens::DoubleSphere(lens) => feed(&[lens.xi(), lens.alpha()]),
        Lens::Eucm(lens) => feed(&[lens.alpha(), lens.beta()]),
        Lens::RadialPolynomial(lens) => feed(lens.coefficients()),
        Lens::Ocam(lens) => (feed(lens.forward()), feed(&lens.affine())).1,
        Lens::FTheta(lens) => (feed(lens.all_coefficients()), feed(&lens.linear())).1,
        Lens::Fov(lens) => feed(&[lens.omega()]),
        Lens::Division(lens) => feed(&[lens.k()]),
        Lens::InverseBrownConrady(lens) => feed(lens.all_coefficients()),
        Lens::ThinPrismFisheye(lens) => feed(lens.coefficients()),
        Lens::Cylindrical(_) | Lens::Equirectangular(_) => {}
    }
    feed(&[lens.max_angle()]);
}
