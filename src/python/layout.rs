//! Which axis of an array is what.

/// The order of an image's axes: N images of a batch, C channels, H rows, W columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// Also (H, W), without a channel axis.
    Hwc,
    Chw,
    Nhwc,
    Nchw,
}

/// The positions of the axes.
pub(super) struct Axes {
    pub(super) batch: Option<usize>,
    /// Channels as planes of their own.
    pub(super) planes: Option<usize>,
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Channels side by side in a pixel.
    pub(super) samples: Option<usize>,
}

impl Layout {
    pub(super) const ALL: [Self; 4] = [Self::Hwc, Self::Chw, Self::Nhwc, Self::Nchw];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Hwc => "HWC",
            Self::Chw => "CHW",
            Self::Nhwc => "NHWC",
            Self::Nchw => "NCHW",
        }
    }

    /// The shapes that it reads, for messages.
    pub(super) fn shape_text(self) -> &'static str {
        match self {
            Self::Hwc => "(H, W) or (H, W, C)",
            Self::Chw => "(C, H, W)",
            Self::Nhwc => "(N, H, W, C)",
            Self::Nchw => "(N, C, H, W)",
        }
    }

    /// Where the axes of an array with so many of them are; `None` where it has too many or too few.
    pub(super) fn axes(self, dims: usize) -> Option<Axes> {
        let axes = |batch, planes, rows, samples| Axes { batch, planes, rows, columns: rows + 1, samples };
        match (self, dims) {
            (Self::Hwc, 2) => Some(axes(None, None, 0, None)),
            (Self::Hwc, 3) => Some(axes(None, None, 0, Some(2))),
            (Self::Chw, 3) => Some(axes(None, Some(0), 1, None)),
            (Self::Nhwc, 4) => Some(axes(Some(0), None, 1, Some(3))),
            (Self::Nchw, 4) => Some(axes(Some(0), Some(1), 2, None)),
            _ => None,
        }
    }

    /// How to read an array with so many axes that this layout does not, for messages.
    pub(super) fn hint(self, dims: usize) -> &'static str {
        match (self, dims) {
            (Self::Hwc | Self::Chw, 4) => "; a batch is layout=\"NHWC\" or \"NCHW\"",
            (Self::Chw, 2) | (Self::Nhwc | Self::Nchw, 3) => "; an axis of length 1 is added by image[numpy.newaxis]",
            (Self::Nhwc | Self::Nchw, 2) => "; a single image is layout=\"HWC\"",
            _ => "",
        }
    }

    /// Where samples that are not adjacent may be, for messages.
    pub(super) fn elsewhere(self) -> &'static str {
        match self {
            Self::Hwc | Self::Nhwc => "; channels in planes are layout=\"CHW\" or \"NCHW\"",
            Self::Chw | Self::Nchw => "",
        }
    }
}
