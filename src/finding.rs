//! What is odd about a camera or a table, though not impossible: data, and one text for every caller.

use std::fmt;

use crate::digits::readable;

/// Something that hardly any camera is, and that is usually a mistake. Its text says what is odd, what usually causes it
/// and how to mend it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// A focal length that is a small part of the image's width.
    ShortFocalLength {
        /// Pixels that a radian takes on the axis.
        focal_length: f64,
        /// Columns of the image.
        width: u32,
    },
    /// Focal lengths that differ more than pixels are out of square.
    FocalLengthsDiffer {
        /// Pixels along the rows.
        fx: f64,
        /// Pixels along the columns.
        fy: f64,
    },
    /// A principal point that is written as a fraction of the image or as an offset.
    PrincipalPointAsFraction {
        /// (cx, cy).
        principal_point: [f64; 2],
        /// (width, height).
        image_size: (u32, u32),
    },
    /// A principal point far from the middle.
    PrincipalPointOffCentre {
        /// (cx, cy).
        principal_point: [f64; 2],
        /// (width, height).
        image_size: (u32, u32),
    },
    /// A camera that stands in its road and sees it edge-on: no cell is valid.
    EdgeOn {
        /// z of the camera, metres.
        camera: f64,
        /// z of the road below or beside it, metres.
        road: f64,
    },
    /// A camera below its road.
    UnderRoad {
        /// z of the camera, metres.
        camera: f64,
        /// z of the road above or beside it, metres.
        road: f64,
    },
    /// A table none of whose cells samples the image.
    NoCell {
        /// What most of the cells have against them.
        because: Unseen,
        /// Where the camera is, in the vehicle frame, metres.
        position: [f64; 3],
        /// What the camera looks along, in the vehicle frame.
        optical_axis: [f64; 3],
        /// (x, y) of the road that the middle of the image's bottom row sees, if it sees the road.
        sees: Option<[f64; 2]>,
    },
}

/// Why a cell does not sample the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unseen {
    /// It lies behind the camera.
    Behind,
    /// It lies beyond the largest angle that the lens sees.
    BeyondLens,
    /// It falls off an edge of the image: "left", "right", "top" or "bottom".
    OffImage(&'static str),
    /// A crest of the road hides it.
    Hidden,
    /// The height map does not know the road there.
    Unknown,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ShortFocalLength { focal_length, width } => write!(
                f,
                "K: the focal length of {} pixels is {:.2} % of the image's width of {width}, and hardly any camera's is below 5 %; it is usually in millimetres, or of a smaller picture; give it in pixels, which are millimetres * width / sensor width in millimetres",
                readable(*focal_length),
                percent(*focal_length, *width),
            ),
            Self::FocalLengthsDiffer { fx, fy } => write!(
                f,
                "K: fx is {:.2} times fy (fx {}, fy {}), and hardly any camera's focal lengths differ so much, 0.6 to 1.7 times; an entry of K is usually in the place of another (cx or cy for fx), or the picture was stretched after its calibration; correct K, or give the size that it was calibrated with and use camera.resized()",
                fx / fy,
                readable(*fx),
                readable(*fy),
            ),
            Self::PrincipalPointAsFraction { principal_point: [cx, cy], image_size: (width, height) } => write!(
                f,
                "K: the principal point ({}, {}) lies on the first pixels of the {width} x {height} image; it is usually a fraction of the image (0..1), or an offset from its middle; give pixels, which are fraction * size - 0.5, or (size - 1) / 2 + offset",
                readable(*cx),
                readable(*cy),
            ),
            Self::PrincipalPointOffCentre { principal_point: [cx, cy], image_size: (width, height) } => write!(
                f,
                "K: the principal point ({}, {}) lies at {:.0} % of the width and {:.0} % of the height of the {width} x {height} image, and almost every camera's lies between 20 % and 80 %; K is usually of another resolution or of the picture before a crop, or image_size is (height, width); give image_size=(width, height) of the pictures that K was calibrated with, then camera.resized() or camera.cropped()",
                readable(*cx),
                readable(*cy),
                percent(cx + 0.5, *width),
                percent(cy + 0.5, *height),
            ),
            Self::EdgeOn { camera, road } => write!(
                f,
                "the camera, {} m high, is not above the road at {} m, but sees it edge-on, so that no cell is valid; a camera without a pose stands at the vehicle's origin; give its height (position=, or the translation of its pose), or ground= the road's height",
                metres(*camera),
                metres(*road),
            ),
            Self::UnderRoad { camera, road } => write!(
                f,
                "the camera, {} m high, is not above the road at {} m, but {} m under it, so that it sees the road from below and mirrored, as a ceiling; z points up: a height has usually the wrong sign, camera_from_vehicle is given for vehicle_from_camera, or the pose is that of a calibration board (cv2.solvePnP), whose z points into the road; correct the height or ground=, or turn the board's axes (documentation: datasets, OpenCV)",
                metres(*camera),
                metres(*road),
                metres(road - camera),
            ),
            Self::NoCell { because, position: [x, y, z], optical_axis, sees } => {
                let [forward, left, up] = optical_axis;
                let (heading, climb) = (left.atan2(*forward).to_degrees(), up.atan2(forward.hypot(*left)).to_degrees());
                write!(
                    f,
                    "no cell of the grid is seen by the camera: camera at ({x:.2}, {y:.2}, {z:.2}) m, looks {:.1} degrees to the {} of +x and {:.1} degrees {}; ",
                    heading.abs(),
                    if heading >= 0.0 { "left" } else { "right" },
                    climb.abs(),
                    if climb > 0.0 { "up" } else { "down" },
                )?;
                match because {
                    Unseen::Behind => f.write_str("the whole grid is behind it: its yaw or pitch is usually off by half a turn, or the pose is given for its inverse")?,
                    Unseen::BeyondLens => f.write_str("the grid is beyond the angles that its lens sees")?,
                    Unseen::OffImage(edge) => write!(f, "the grid is outside its image, beyond the {edge} edge")?,
                    Unseen::Hidden => f.write_str("the road itself hides the grid, behind a crest")?,
                    Unseen::Unknown => f.write_str("the height map does not know the road there: its origin or its spacing is usually in another frame")?,
                }
                match sees {
                    Some([x, y]) => write!(f, "; the middle of its image's bottom row sees the road at ({x:.1}, {y:.1}) m")?,
                    None => f.write_str("; the middle of its image's bottom row sees no road, but what is above the horizon or beyond the lens")?,
                }
                f.write_str("; check the grid's x and y, ground= and the calibration")
            }
        }
    }
}

fn percent(part: f64, whole: u32) -> f64 {
    100.0 * part / f64::from(whole)
}

/// To the micrometre, and never -0.
fn metres(value: f64) -> f64 {
    (value * 1e6).round() / 1e6 + 0.0
}
