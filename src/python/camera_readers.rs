//! `Camera.from_<format>`, `Camera.load`: readers know files, this class knows cameras. The one upward call.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use super::camera::PyCamera;

/// Calls a function of `ipm_rs.calibration`, which is imported at the first call.
fn read<'py>(
    class: &Bound<'py, PyType>,
    module: &str,
    function: &str,
    arguments: &Bound<'py, PyTuple>,
    keywords: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    class.py().import(format!("ipm_rs.calibration{module}"))?.call_method(function, arguments, keywords)
}

/// A class method for each line: its name, its signature as Python shows it (that of the function), and the function.
macro_rules! readers {
    ($($name:ident $signature:literal => $module:literal $function:literal;)*) => {
        #[pymethods]
        impl PyCamera {
            $(
                #[doc = help!("Camera.", stringify!($name))]
                #[classmethod]
                #[pyo3(signature = (*arguments, **keywords), text_signature = $signature)]
                fn $name<'py>(
                    class: &Bound<'py, PyType>,
                    arguments: &Bound<'py, PyTuple>,
                    keywords: Option<&Bound<'py, PyDict>>,
                ) -> PyResult<Bound<'py, PyAny>> {
                    read(class, $module, $function, arguments, keywords)
                }
            )*
        }
    };
}

#[pymethods]
impl PyCamera {
    #[doc = help!("Camera.to_json")]
    fn to_json<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("to_json", (slf,))
    }

    #[doc = help!("Camera.save")]
    fn save(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("save", (slf, path)).map(drop)
    }
}

// A test holds the signatures against those of the functions.
readers! {
    load "(path, image_size=None, camera=None, *, lens=None, frame=None, metres_per_unit=None, nearest_rotation=False)" => "" "load";
    from_cityscapes "(source, *, image_size=(2048, 1024), nearest_rotation=False)" => ".cityscapes" "read";
    from_kitti "(source, *, camera=2, image_size=None, frame='velodyne', nearest_rotation=False)" => ".kitti" "read";
    from_kitti_raw "(source, *, camera=2, rectified=True, frame='velodyne', nearest_rotation=False)" => ".kitti_raw" "read";
    from_kitti_360 "(source, *, camera=None, frame='velodyne', nearest_rotation=False)" => ".kitti_360" "read";
    from_nuscenes "(source, *, camera=None, image_size=None, sensors=None, nearest_rotation=False)" => ".nuscenes" "read";
    from_argoverse2 "(source, *, camera='ring_front_center', nearest_rotation=False)" => ".argoverse2" "read";
    from_waymo "(source, *, camera=None, nearest_rotation=False)" => ".waymo" "read";
    from_carla "(source=None, *, camera=None, image_size=None, fov=None, transform=None, handedness='left', nearest_rotation=False)" => ".carla" "read";
    from_json "(source)" => ".json" "read";
    from_colmap "(source, *, camera=None, images=None, image=None, image_size=None, vehicle_from_world=None, metres_per_unit=1.0, nearest_rotation=False)" => ".colmap" "read";
    from_kalibr "(source, *, camera=None, image_size=None, vehicle_from_cam0=None, vehicle_from_imu=None, nearest_rotation=False)" => ".kalibr" "read";
    from_matlab "(source, *, image_size=None)" => ".matlab" "read";
    from_opencv "(source, *, camera=None, image_size=None, lens=None, extrinsics=None, rectified=False, camera_from_vehicle=None, vehicle_from_camera=None, vehicle_from_world=None, metres_per_unit=None, nearest_rotation=False)" => ".opencv" "read";
    from_ros "(source, *, image='raw', camera=None, image_size=None, camera_from_vehicle=None, vehicle_from_camera=None, ros_binning=False, metres_per_unit=None, nearest_rotation=False)" => ".ros" "read";
    from_woodscape "(source, *, image_size=None, nearest_rotation=False)" => ".woodscape" "read";
}
