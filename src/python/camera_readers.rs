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
    ($($(#[$doc:meta])* $name:ident $signature:literal => $module:literal $function:literal;)*) => {
        #[pymethods]
        impl PyCamera {
            $(
                $(#[$doc])*
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
    /// The camera as JSON text, each float to the last bit.
    fn to_json<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("to_json", (slf,))
    }

    /// Writes the camera as a JSON file.
    fn save(slf: &Bound<'_, Self>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        slf.py().import("ipm_rs.calibration.json")?.call_method1("save", (slf, path)).map(drop)
    }
}

// A test holds the signatures against those of the functions.
readers! {
    /// A camera from a calibration file whose format is recognised.
    load "(path, image_size=None, camera=None, *, lens=None)" => "" "load";
    /// A camera from a Cityscapes camera file or dict.
    from_cityscapes "(source, *, image_size=(2048, 1024))" => ".cityscapes" "read";
    /// A camera from a KITTI calibration file: object, tracking, odometry, road.
    from_kitti "(source, *, camera=2, image_size=None, frame='velodyne')" => ".kitti" "read";
    /// A camera from a KITTI raw calibration, of the rectified or of the raw images.
    from_kitti_raw "(source, *, camera=2, rectified=True, frame='velodyne')" => ".kitti_raw" "read";
    /// A camera from a KITTI-360 calibration, perspective or fisheye.
    from_kitti_360 "(source, *, camera=None, frame='velodyne')" => ".kitti_360" "read";
    /// A camera from a nuScenes, Lyft or nuImages calibrated_sensor.json, or one record of it.
    from_nuscenes "(source, *, camera=None, image_size=None, sensors=None)" => ".nuscenes" "read";
    /// A camera from an Argoverse 2 log's calibration; its road is at ground=-0.33.
    from_argoverse2 "(source, *, camera='ring_front_center')" => ".argoverse2" "read";
    /// A camera from the fields of a Waymo CameraCalibration.
    from_waymo "(source, *, camera=None)" => ".waymo" "read";
    /// A camera from a CARLA sensor's size, field of view and transform.
    from_carla "(source=None, *, camera=None, image_size=None, fov=None, transform=None, handedness='left')" => ".carla" "read";
    /// A camera that `save` or `to_json` wrote.
    from_json "(source)" => ".json" "read";
    /// A camera from a COLMAP text model.
    from_colmap "(source, *, camera=None, images=None, image=None, image_size=None, vehicle_from_world=None, metres_per_unit=1.0)" => ".colmap" "read";
    /// A camera from a Kalibr camera chain.
    from_kalibr "(source, *, camera=None, image_size=None, vehicle_from_cam0=None, vehicle_from_imu=None)" => ".kalibr" "read";
    /// A camera from the numbers of a MATLAB monoCamera.
    from_matlab "(source, *, image_size=None)" => ".matlab" "read";
    /// A camera from an OpenCV FileStorage file.
    from_opencv "(source, *, camera=None, image_size=None, lens=None, extrinsics=None, rectified=False, camera_from_vehicle=None, vehicle_from_camera=None, vehicle_from_world=None, metres_per_unit=1.0)" => ".opencv" "read";
    /// A camera from a ROS CameraInfo file or message.
    from_ros "(source, *, image='raw', camera=None, image_size=None, camera_from_vehicle=None, vehicle_from_camera=None, ros_binning=False)" => ".ros" "read";
    /// A camera from a WoodScape calibration.
    from_woodscape "(source, *, image_size=None)" => ".woodscape" "read";
}
