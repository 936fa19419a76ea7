//! What is wrong with images and other arrays.

/// An image, an output or a table of numbers that is none, or that does not fit its partner.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// An image size with no pixels, or too large to be addressed.
    #[error(
        "{what}: expected (width, height) of at least 1 x 1 and fewer than 2^32 pixels with a frame of one pixel, got {width} x {height}"
    )]
    ImageSize {
        /// The parameter's name.
        what: &'static str,
        /// Pixels per row.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// An image without pixels.
    #[error("{what}: expected at least one pixel and one channel, got {width} x {height} with {channels} channels")]
    EmptyImage {
        /// The parameter's name.
        what: &'static str,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Samples per pixel.
        channels: usize,
    },
    /// A buffer that does not hold the rows it claims.
    #[error(
        "{what}: {width} x {height} pixels of {channels} channels with row stride {row_stride} do not fit a buffer of {length} samples"
    )]
    ImageBuffer {
        /// The parameter's name.
        what: &'static str,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Samples per pixel.
        channels: usize,
        /// Samples from one row to the next.
        row_stride: isize,
        /// Samples in the buffer.
        length: usize,
    },
    /// An image of another size than the table was built for.
    #[error(
        "image is {}x{} but this Lut was built for {}x{}", got.0, got.1, expected.0, expected.1
    )]
    SizeMismatch {
        /// (width, height) of the table's source.
        expected: (usize, usize),
        /// (width, height) of the image.
        got: (usize, usize),
    },
    /// A mask of another number of pixels than its images.
    #[error("mask: expected a pixel for each of the {} x {} of its images, got {got}", expected.0, expected.1)]
    MaskSize {
        /// (width, height) of the images.
        expected: (usize, usize),
        /// Pixels that came.
        got: usize,
    },
    /// An output of the wrong shape.
    #[error("out: expected (rows, columns, channels) = {expected:?}, got {got:?}")]
    OutputShape {
        /// Rows, columns, channels of the result.
        expected: (usize, usize, usize),
        /// Those of the array that came.
        got: (usize, usize, usize),
    },
    /// A border value with neither one entry nor one per channel.
    #[error("border_value: expected one value or one for each of the {expected} channels, got {got} values")]
    BorderChannels {
        /// Channels of the image.
        expected: usize,
        /// Values that came.
        got: usize,
    },
    /// A table of points or values that does not fit its buffer.
    #[error("points: a table of {rows} x {columns} numbers does not fit a buffer of {length}")]
    PointTable {
        /// Rows.
        rows: usize,
        /// Numbers in a row.
        columns: usize,
        /// Numbers in the buffer.
        length: usize,
    },
}
