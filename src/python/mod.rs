//! The Python face: converts arguments, releases the GIL, delegates, maps errors. Nothing is computed here.
//!
//! | Python | Rust |
//! |---|---|
//! | image `(H, W)` or `(H, W, C)`, any row stride | [`ImageView`](crate::ImageView) of the array's own memory |
//! | `(C, H, W)`, `(N, H, W, C)`, `(N, C, H, W)` | an `ImageView` for each plane or each image |
//! | `out` | [`ImageViewMut`](crate::ImageViewMut), likewise |
//! | tensors and buffers of other libraries | an array over their memory, see [`shared`] |
//! | points `(N, k)`, matrices, anything array-like of real numbers | float64, converted by NumPy |
//! | `(width, height)` | `(u32, u32)` |
//! | [`Error`](crate::Error) | a class of `ipm_rs.errors`, see [`error`] |
//!
//! Arguments arrive as `PyAny` and are checked by hand: a `PyReadonlyArray` in a signature panics where one array is
//! passed twice, and its messages name no dtype. Every call that loops over points or cells releases the GIL; NumPy
//! arrays stay borrowed meanwhile, which other users of rust-numpy see, while Python code that writes to an input from
//! another thread does so at its own risk, as with NumPy itself.

/// The docstring of a public name, from the type stub `_core.pyi`: the one place where it is written. `build.rs` puts
/// each into a file; the build fails where the stub has none.
macro_rules! help {
    ($($name:expr),+) => {
        include_str!(concat!(env!("OUT_DIR"), "/help/", $($name,)+ ".txt"))
    };
}

mod adjoint;
mod arrays;
mod camera;
mod cloud;
mod convert;
mod detached;
mod direct;
mod dtype;
mod each;
mod error;
mod geometry;
mod grid;
mod ground;
mod ground_points;
mod image;
mod layout;
mod lens;
mod lut;
mod lut_file;
mod maps;
mod mask;
mod mend;
mod mosaic;
mod options;
mod outputs;
mod points;
mod raster;
mod refine;
mod rig;
mod shapes;
mod shared;
mod texts;
mod warnings;

use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[pymodule]
#[pyo3(name = "_core")]
mod core_module {
    #[pymodule_export]
    use super::camera::PyCamera;
    #[pymodule_export]
    use super::cloud::{
        PyPixelRays, decode_carla_depth, depth_to_lidar, depth_to_local_point_cloud, encode_carla_depth,
        points_from_depth, render_points,
    };
    #[pymodule_export]
    use super::direct::{remap, warp_perspective};
    #[pymodule_export]
    use super::geometry::{
        flip_handedness, flip_handedness_euler, flip_handedness_pose, flip_handedness_rotation, rotation_from_euler,
    };
    #[pymodule_export]
    use super::grid::PyBevGrid;
    #[pymodule_export]
    use super::ground::{PyHeightMap, PyPlane};
    #[pymodule_export]
    use super::ground_points::{homography_from_points, vanishing_point};
    #[pymodule_export]
    use super::lens::{
        PyBrownConrady, PyCylindrical, PyDivision, PyDoubleSphere, PyEquirectangular, PyEucm, PyFTheta, PyFov,
        PyInverseBrownConrady, PyKannalaBrandt, PyMei, PyOcam, PyRadialPolynomial, PyThinPrismFisheye,
    };
    #[pymodule_export]
    use super::lut::PyLut;
    #[pymodule_export]
    use super::lut_file::checksum;
    #[pymodule_export]
    use super::mosaic::{mosaic_add, mosaic_merge, mosaic_shown, mosaic_shows, mosaic_windows};
    #[pymodule_export]
    use super::raster::rasterize;
    #[pymodule_export]
    use super::refine::{refine_differences, refine_normal, refine_shown};
    #[pymodule_export]
    use super::rig::PyRigTable;
    #[pymodule_export]
    use super::shapes::{rasterize_boxes, rasterize_polygons};
    #[pymodule_export]
    use super::{cpu_info, get_num_threads, set_num_threads};

    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        match crate::ignored_variable() {
            Some(message) => super::warn(module.py(), &message),
            None => Ok(()),
        }
    }

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python's name for a version")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}

/// Warns whoever imports the package.
fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let category = py.get_type::<PyRuntimeWarning>();
    py.import("warnings")?.call_method1("warn", (message, category))?;
    Ok(())
}

#[doc = help!("get_num_threads")]
#[pyfunction]
fn get_num_threads() -> usize {
    crate::num_threads()
}

#[doc = help!("set_num_threads")]
#[pyfunction]
fn set_num_threads(n: &Bound<'_, PyAny>) -> PyResult<()> {
    let threads = options::thread_count("n", n)?;
    Ok(n.py().detach(|| crate::set_num_threads(threads))?)
}

#[doc = help!("cpu_info")]
#[pyfunction]
fn cpu_info(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let info = PyDict::new(py);
    info.set_item("version", env!("CARGO_PKG_VERSION"))?;
    info.set_item("isa", crate::Isa::active()?.name())?;
    info.set_item("available_isas", crate::Isa::available().iter().map(|isa| isa.name()).collect::<Vec<_>>())?;
    info.set_item("cpu_features", crate::cpu_features())?;
    info.set_item("threads", crate::num_threads())?;
    info.set_item("platform", format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS))?;
    info.set_item("build", if cfg!(debug_assertions) { "debug" } else { "release" })?;
    Ok(info)
}
