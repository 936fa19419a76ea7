//! What a Python caller can do about an error of the core: the end of its message, in Python's words.

use crate::Error;

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
        Error::NoData { got, .. } if got.abs() > 1e5 => {
            "replace it by NaN, np.where(abs(heights) <= 1e5, heights, np.nan)".to_owned()
        }
        Error::NoData { got, .. } => format!("replace it by NaN, np.where(heights == {got:?}, np.nan, heights)"),
        Error::SizeMismatch { expected, got } => format!("{}, and build it again", size("image", got, expected)),
        Error::DepthSize { expected, got } => size("depth", got, expected),
        Error::MaskSize { expected, got } => {
            let (width, height) = expected;
            let transposed = if is_swapped(got, expected) { "it seems transposed: " } else { "" };
            format!("{transposed}give it one entry for each pixel of depth, shape ({height}, {width})")
        }
        Error::AreaSize { .. } => "use interpolation=\"bilinear\", or crop".to_owned(),
        Error::TooManyIds { .. } => "use interpolation=\"nearest\"".to_owned(),
        Error::Horizon { .. } => "use horizon()".to_owned(),
        _ => return None,
    })
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
