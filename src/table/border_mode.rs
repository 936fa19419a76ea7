//! What lies beyond the image.

use super::SpanKind;
use super::error::TableError;

/// What lies beyond the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BorderMode {
    /// The border value: `cv2.BORDER_CONSTANT`. The default.
    #[default]
    Constant,
    /// The nearest pixel of the edge, aaa|abcd|ddd: `cv2.BORDER_REPLICATE`.
    Replicate,
    /// The image mirrored about its edges, cba|abcd|dcb: `cv2.BORDER_REFLECT`.
    Reflect,
    /// The image mirrored about its outermost pixels, dcb|abcd|cba: `cv2.BORDER_REFLECT_101`.
    Reflect101,
    /// The image again, bcd|abcd|abc: `cv2.BORDER_WRAP`.
    Wrap,
    /// Nothing: cells that are not valid keep what the output held.
    Transparent,
}

impl BorderMode {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Constant, Self::Replicate, Self::Reflect, Self::Reflect101, Self::Wrap, Self::Transparent];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Replicate => "replicate",
            Self::Reflect => "reflect",
            Self::Reflect101 => "reflect_101",
            Self::Wrap => "wrap",
            Self::Transparent => "transparent",
        }
    }

    /// Whether there are pixels beyond the image.
    pub(crate) fn repeats(self) -> bool {
        !matches!(self, Self::Constant | Self::Transparent)
    }

    /// Brings coordinates along an axis of `size` pixels to where the image has the same, at most `reach` pixels outside
    /// it; NaN and infinity become NaN, which has no image in any mode.
    ///
    /// A mirrored or repeated image is the same under any interpolation whose weights are even. Of replicated pixels that is
    /// so only as far out as no sample reaches the image, which `reach` must be: 0 for bilinear, whose samples then all are
    /// the edge's.
    pub(crate) fn fold(self, coordinates: &mut [f64], size: usize, reach: f64) {
        if !self.repeats() {
            return;
        }
        let (count, last) = (size as f64, size as f64 - 1.0);
        for coordinate in coordinates {
            if *coordinate >= 0.0 && *coordinate <= last {
                continue;
            }
            *coordinate = match self {
                _ if !coordinate.is_finite() => f64::NAN,
                Self::Constant | Self::Transparent => *coordinate,
                Self::Replicate => coordinate.clamp(-reach, last + reach),
                Self::Reflect => {
                    let within = (*coordinate + 0.5).rem_euclid(2.0 * count);
                    within.min(2.0 * count - within) - 0.5
                }
                Self::Reflect101 if last == 0.0 => 0.0,
                Self::Reflect101 => {
                    let within = coordinate.abs() % (2.0 * last);
                    within.min(2.0 * last - within)
                }
                Self::Wrap => wrapped(*coordinate, count),
            };
        }
    }

    /// The pixel at a place along an axis of `size` pixels; none where the mode has the border value.
    #[inline]
    pub(crate) fn pixel(self, at: i64, size: usize) -> Option<usize> {
        if let Some(inside) = usize::try_from(at).ok().filter(|&at| at < size) {
            return Some(inside);
        }
        let count = size as i64;
        let folded = match self {
            Self::Constant => return None,
            Self::Replicate => at.clamp(0, count - 1),
            Self::Reflect => {
                let within = at.rem_euclid(2 * count);
                within.min(2 * count - 1 - within)
            }
            // what a valid cell's samples reach beyond the image, which is nobody's to say, as OpenCV takes it
            Self::Reflect101 | Self::Transparent if size == 1 => 0,
            Self::Reflect101 | Self::Transparent => {
                let within = at.rem_euclid(2 * (count - 1));
                within.min(2 * (count - 1) - within)
            }
            Self::Wrap => at.rem_euclid(count),
        };
        Some(folded as usize)
    }
}

/// A coordinate on an axis of `count` pixels that begins again where it ends: at least 0 and below `count`.
fn wrapped(coordinate: f64, count: f64) -> f64 {
    let within = coordinate.rem_euclid(count);
    if within < count { within } else { 0.0 } // that of -1e-20 is rounded to all of the axis
}

/// What a table's source has beyond its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Edges {
    /// What cells take that are not valid: never [`BorderMode::Transparent`].
    pub(crate) mode: BorderMode,
    /// Whether the first column follows the last one, as in a panorama of 360 degrees: what lies between the two is
    /// inside the image.
    pub(crate) wraps: bool,
}

impl Edges {
    /// # Errors
    /// [`TableError::Transparent`]: what a cell keeps is known to a warp alone.
    pub(crate) fn new(mode: BorderMode, wraps: bool) -> Result<Self, TableError> {
        if mode == BorderMode::Transparent { Err(TableError::Transparent) } else { Ok(Self { mode, wraps }) }
    }

    /// Whether all coordinates matter, also those outside the image.
    pub(crate) fn see_all(self) -> bool {
        self.mode.repeats() || self.wraps
    }

    /// Brings columns of a source that begins again to where it is.
    pub(crate) fn wrap(self, us: &mut [f64], width: u32) {
        let width = f64::from(width);
        if self.wraps {
            for u in us.iter_mut().filter(|u| u.is_finite() && !(0.0..width).contains(*u)) {
                *u = wrapped(*u, width);
            }
        }
    }

    /// Whether cells of this kind sample where the map of the grid has them, and not elsewhere, where the image has the same.
    pub(crate) fn is_in_place(self, kind: SpanKind) -> bool {
        match kind {
            SpanKind::Inside => true,
            SpanKind::Rim => !self.wraps,
            SpanKind::Halo => !self.mode.repeats(),
            SpanKind::Outside => false,
        }
    }

    /// Whether cells of this kind are valid and cover a part of the image that their neighbours tell.
    pub(crate) fn has_footprint(self, kind: SpanKind) -> bool {
        kind.is_valid() && self.is_in_place(kind)
    }

    /// The mode of each axis.
    pub(crate) fn axes(self) -> [BorderMode; 2] {
        [if self.wraps { BorderMode::Wrap } else { self.mode }, self.mode]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folded(mode: BorderMode, coordinate: f64, size: usize) -> f64 {
        let mut one = [coordinate];
        mode.fold(&mut one, size, 0.0);
        one[0]
    }

    #[test]
    fn borders_fold_as_opencv_names_them() {
        for (coordinate, replicate, reflect, reflect_101, wrap) in [
            (-0.25, 0.0, -0.25, 0.25, 4.75),
            (-3.5, 0.0, 2.5, 3.5, 1.5),
            (4.5, 4.0, 4.5, 3.5, 4.5),
            (8.0, 4.0, 1.0, 0.0, 3.0),
            (11.0, 4.0, 1.0, 3.0, 1.0),
            (2.5, 2.5, 2.5, 2.5, 2.5),
            (-1e-20, 0.0, 0.0, 1e-20, 0.0),
        ] {
            assert_eq!(folded(BorderMode::Replicate, coordinate, 5), replicate, "{coordinate}");
            assert_eq!(folded(BorderMode::Reflect, coordinate, 5), reflect, "{coordinate}");
            assert_eq!(folded(BorderMode::Reflect101, coordinate, 5), reflect_101, "{coordinate}");
            assert_eq!(folded(BorderMode::Wrap, coordinate, 5), wrap, "{coordinate}");
            assert_eq!(folded(BorderMode::Constant, coordinate, 5), coordinate);
            assert_eq!(folded(BorderMode::Transparent, coordinate, 5), coordinate);
        }
        assert_eq!(folded(BorderMode::Reflect101, 3.7, 1), 0.0);
        for mode in BorderMode::ALL.into_iter().filter(|mode| mode.repeats()) {
            for none in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(folded(mode, none, 5).is_nan());
            }
        }
    }

    #[test]
    fn pixels_fold_as_whole_coordinates_do() {
        for mode in BorderMode::ALL {
            for size in [1, 2, 5] {
                for at in -23..30 {
                    let inside = (0..size as i64).contains(&at).then_some(at as usize);
                    let expected = match mode {
                        BorderMode::Constant => inside,
                        BorderMode::Transparent => Some(folded(BorderMode::Reflect101, at as f64, size) as usize),
                        _ => Some(folded(mode, at as f64, size) as usize),
                    };
                    assert_eq!(mode.pixel(at, size), expected, "{mode:?} {at} of {size}");
                }
            }
        }
    }
}
