//! What a Python caller can do about an error of the core: the end of its message, in Python's words.

use crate::Error;
use crate::digits::readable;
use crate::error::{CameraError, CloudError, GroundError, LensError, LutError, PoseError, RasterError};
use crate::error::{ViewError, WarpError};

/// The error's message, and how to mend it where that is said here.
pub(super) fn message(error: &Error) -> String {
    match mend(error) {
        Some(mend) => format!("{error}; {mend}"),
        None => error.to_string(),
    }
}

fn mend(error: &Error) -> Option<String> {
    Some(match *error {
        Error::Angle { got, .. } => format!("if it is in degrees, give np.radians({got})"),
        Error::Lens(LensError::Parameter { name: "max_angle", got, .. }) => {
            format!("if it is in degrees, give np.radians({got})")
        }
        Error::Pose(ref error) => pose(error)?,
        Error::Camera(CameraError::Horizon { .. }) => "use horizon()".to_owned(),
        Error::Ground(GroundError::NoData { got, .. }) if got.abs() > 1e5 => {
            "replace it by NaN, np.where(abs(heights) <= 1e5, heights, np.nan)".to_owned()
        }
        Error::Ground(GroundError::NoData { got, .. }) => {
            format!("replace it by NaN, np.where(heights == {got:?}, np.nan, heights)")
        }
        Error::View(ViewError::SizeMismatch { expected, got }) => {
            format!("{}, and build it again", size("image", got, expected))
        }
        Error::Lut(LutError::AreaSize { .. }) => "use interpolation=\"bilinear\", or crop".to_owned(),
        Error::Warp(WarpError::NeedsTable { .. }) => {
            "for \"area\" and \"mode\" make a Lut (from_maps, from_homography) and use its warp".to_owned()
        }
        Error::Warp(WarpError::BorderMode { got, .. }) => format!(
            "a Lut holds where its cells sample: build it with border_mode={got:?} (Lut, Lut.from_maps, Lut.from_homography, \
             Lut.between), or use remap"
        ),
        Error::Warp(WarpError::TooManyIds { .. }) => "use interpolation=\"nearest\"".to_owned(),
        Error::Cloud(CloudError::DepthSize { expected, got }) => size("depth", got, expected),
        Error::Cloud(CloudError::MaskSize { expected, got }) => {
            let (width, height) = expected;
            let transposed = if is_swapped(got, expected) { "it seems transposed: " } else { "" };
            format!("{transposed}give it one entry for each pixel of depth, shape ({height}, {width})")
        }
        Error::Cloud(CloudError::TooManyPoints { what, .. }) => match what {
            "camera" => "use camera.resized()".to_owned(),
            "depth" => "use stride or camera.cropped()".to_owned(),
            _ => "draw them in parts".to_owned(),
        },
        Error::Raster(RasterError::PointColumns { .. }) => {
            "without z only values=, count and density can be had".to_owned()
        }
        Error::Raster(RasterError::TooManyPoints { .. }) => "pass them in parts".to_owned(),
        _ => return None,
    })
}

/// What usually makes a transform one that is not rigid.
fn pose(error: &PoseError) -> Option<String> {
    let (scale, is_mirrored, is_coarse) = match *error {
        PoseError::LastRow { is_transposed: true, .. } => {
            return Some("it is transposed (row vectors): give its transpose, .T".to_owned());
        }
        PoseError::LastRow { .. } => {
            return Some("give the pose alone, [R t] above [0, 0, 0, 1], without K or a scale".to_owned());
        }
        PoseError::NotRigid { scale, is_mirrored, is_coarse, .. } => (scale, is_mirrored, is_coarse),
        PoseError::NotFinite { .. } | PoseError::TooFar { .. } => return None,
    };
    let mut mends = Vec::new();
    if is_mirrored {
        mends.push(
            "one of its two frames is left-handed: mirror that one, T @ diag(1, -1, 1, 1) for the source frame or \
             diag(1, -1, 1, 1) @ T for the destination"
                .to_owned(),
        );
    }
    if let Some(scale) = scale {
        mends.push(format!("a scale is mixed in: divide R by {} and look at the units of t", readable(scale)));
    }
    if is_coarse && !is_mirrored {
        mends.push(
            "if it was written with few digits, pass nearest_rotation=True where a camera takes its pose, or give U V^T \
             of its singular value decomposition"
                .to_owned(),
        );
    }
    if mends.is_empty() {
        mends.push("check the order of its entries (row by row), and that it is R and not K R".to_owned());
    }
    Some(mends.join("; "))
}

/// How to make a camera fit pictures of another size than its own: mostly it was told the wrong one.
fn size(what: &str, got: (usize, usize), expected: (usize, usize)) -> String {
    let (width, height) = got;
    if is_swapped(got, expected) {
        return format!(
            "width and height are swapped: image_size is (width, height), while {what}.shape is (height, width); make the \
             camera with image_size=({width}, {height})"
        );
    }
    format!(
        "make the camera with image_size=({width}, {height}) if its calibration is of pictures of this size (a table \
         without a camera: source_size=), or use camera.resized() or camera.cropped() if the pictures were resized or \
         cropped after it"
    )
}

/// Whether one size is the other with width and height in each other's place.
fn is_swapped(got: (usize, usize), expected: (usize, usize)) -> bool {
    got == (expected.1, expected.0)
}
