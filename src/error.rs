//! One error type: a variant per user mistake, whose message says what was expected, what came and how to mend it.

/// Everything that a caller can get wrong.
///
/// The Python layer maps each variant to one exception class; see `python/error.rs`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number that must be finite is NaN or infinite.
    #[error("{what}: expected finite numbers, got {got}")]
    NotFinite {
        /// The parameter's name.
        what: &'static str,
        /// The offending number.
        got: f64,
    },
    /// An angle of more than a turn.
    #[error("{what}: expected radians, at most a turn (2 pi, 6.28) either way, got {got}")]
    Angle {
        /// The parameter's name.
        what: &'static str,
        /// The angle that came.
        got: f64,
    },
    /// A road height that is NaN, infinite, or farther away than any road.
    #[error("ground: expected a finite height in metres, at most 100 000 above or below the vehicle, got {got}")]
    Ground {
        /// The height that came.
        got: f64,
    },
    /// A plane that is upright, and so has no height.
    #[error("Plane: expected {expected} got {got:?}; a road has one height at each (x, y)")]
    Plane {
        /// Which condition fails.
        expected: &'static str,
        /// The normal, or (slope, bank, height).
        got: [f64; 3],
    },
    /// Heights that make no map.
    #[error("HeightMap: expected {expected}, got {got}")]
    HeightMap {
        /// Which condition fails.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// Heights that stand for "no data" in elevation files.
    #[error(
        "heights: expected finite metres, and NaN where the road is not known, got {got:?} at [{row}, {column}] ({count} in all), which stands for \"no data\" or is no height"
    )]
    NoData {
        /// The first such number.
        got: f64,
        /// Where it is.
        row: usize,
        /// Where it is.
        column: usize,
        /// How many there are.
        count: usize,
    },
    /// Points or lines that do not determine what was asked for.
    #[error("{what}: expected {expected}, got {got}")]
    Points {
        /// The parameter's name.
        what: &'static str,
        /// Which condition fails.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// An intrinsic matrix that is no pinhole matrix.
    #[error(
        "K: expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with finite entries and fx, fy > 0, got {got:?} ({problem})"
    )]
    Intrinsics {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
        /// Which of the conditions fails.
        problem: &'static str,
    },
    /// Focal lengths of a placeholder matrix, or of one that is not in pixels.
    #[error(
        "K: expected focal lengths in pixels, got fx {}, fy {} for an image of {width} x {height}; a matrix like the identity is a placeholder of a camera that is not calibrated; one in units of the image's size wants its first row times the width and its second times the height", readable(*fx), readable(*fy)
    )]
    FocalLength {
        /// Pixels that a radian takes on the axis, along the rows.
        fx: f64,
        /// The same along the columns.
        fy: f64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// A lens with another number of coefficients than its model has.
    #[error("{lens}: expected {expected} coefficients, got {got}")]
    LensCoefficients {
        /// The model.
        lens: &'static str,
        /// Their number, and what they are.
        expected: &'static str,
        /// How many came.
        got: usize,
    },
    /// A lens parameter that its model cannot have.
    #[error("{lens}: {name}: expected {expected}, got {got}")]
    LensParameter {
        /// The model.
        lens: &'static str,
        /// The parameter's name.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
        /// The number that came.
        got: f64,
    },
    /// A lens that sees nothing beside its axis.
    #[error(
        "{lens}: expected {expected} coefficients of a lens that sees more than its axis, got ones whose image folds back {angle:.2e} rad from it; check their order, their signs and their units"
    )]
    LensFolds {
        /// The model.
        lens: &'static str,
        /// Its coefficients, in order.
        expected: &'static str,
        /// Radians from the axis.
        angle: f64,
    },
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
    /// A crop that reaches outside its image.
    #[error(
        "cropped: expected a rectangle of at least 1 x 1 inside the {width} x {height} image, got x {x}, y {y}, {crop_width} x {crop_height}"
    )]
    Crop {
        /// Left column of the crop.
        x: u64,
        /// Top row of the crop.
        y: u64,
        /// Columns of the crop.
        crop_width: u64,
        /// Rows of the crop.
        crop_height: u64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// Blocks of pixels that an image has none of.
    #[error("binned: expected blocks of at least 1 x 1 pixel that fit the {width} x {height} image, got {x} x {y}")]
    Binning {
        /// Columns of a block.
        x: u64,
        /// Rows of a block.
        y: u64,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// A margin or a tolerance that no curve can be drawn with.
    #[error(
        "margin, tolerance: expected a margin of at least 0 and a tolerance of at least 0.001 pixel, both up to 1e9, got {margin:?} and {tolerance:?}"
    )]
    Tracing {
        /// Pixels around the image.
        margin: f64,
        /// Pixels from the curve.
        tolerance: f64,
    },
    /// A curve whose image winds without end.
    #[error(
        "polyline: expected a curve whose image is points follow to {tolerance} pixels, got one that winds on and on; check the lens and the heights of the road, or give a larger tolerance"
    )]
    Winding {
        /// Pixels from the curve.
        tolerance: f64,
    },
    /// A line that a lens bends.
    #[error("horizon_line: expected a pinhole camera, got one behind {lens}, which bends the horizon")]
    Horizon {
        /// The lens model's name.
        lens: &'static str,
    },
    /// A rotation that is not one.
    #[error(
        "{what}: expected a rotation (|R^T R - I| <= 1e-4 and det R > 0), got |R^T R - I| = {deviation:.1e} and det R = {det:.4}; {mend}"
    )]
    NotRigid {
        /// The parameter's name.
        what: &'static str,
        /// Largest entry of |R^T R - I|.
        deviation: f64,
        /// Determinant of R.
        det: f64,
        /// What the caller can do.
        mend: String,
    },
    /// A 4x4 matrix whose last row is not (0, 0, 0, 1).
    #[error("{what}: expected a rigid 4x4 transform with last row [0, 0, 0, 1], got last row {got:?}; {mend}")]
    LastRow {
        /// The parameter's name.
        what: &'static str,
        /// The last row that came.
        got: [f64; 4],
        /// What the caller can do.
        mend: &'static str,
    },
    /// A grid range that is reversed, empty or not finite.
    #[error("{axis}: expected a finite range (min, max) in metres with min < max, got ({min}, {max})")]
    GridRange {
        /// "x" or "y".
        axis: &'static str,
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
    },
    /// A cell size that is zero, negative or not finite.
    #[error("resolution: expected a positive cell size in metres along {axis}, got {got}")]
    CellSize {
        /// "x" or "y".
        axis: &'static str,
        /// The size that came.
        got: f64,
    },
    /// A range that is not a whole number of cells.
    #[error(
        "{axis}: ({min}, {max}) is {cells} cells of {cell} m, expected a whole number (to 1e-6); the nearest is ({min}, {}), {nearest} cells", readable(*nearest_max)
    )]
    PartialCell {
        /// "x" or "y".
        axis: &'static str,
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
        /// Cell size, metres.
        cell: f64,
        /// Cells in the range, not whole.
        cells: f64,
        /// Nearest whole number of cells, at least one.
        nearest: f64,
        /// Upper end of the range of that many cells.
        nearest_max: f64,
    },
    /// More cells than a table may hold.
    #[error(
        "{what}: {} x {} cells are more than the {limit} that one table may hold; use a coarser resolution or a smaller output", count(*rows), count(*columns)
    )]
    TooManyCells {
        /// What asked for them.
        what: &'static str,
        /// Rows, as a float because it may not fit an integer.
        rows: f64,
        /// Columns, likewise.
        columns: f64,
        /// The limit.
        limit: usize,
    },
    /// Two maps, or a map and its shape, that do not fit.
    #[error("maps: expected {expected} entries in each, got {got}")]
    MapLength {
        /// Entries expected.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// A homography that maps everything to a line or to nothing.
    #[error("M: expected a finite, invertible 3x3 matrix from output pixel to source pixel, got {got:?} ({problem})")]
    Homography {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
        /// Which condition fails.
        problem: &'static str,
    },
    /// Bytes that are not a table this version wrote.
    #[error("Lut: expected the bytes of a table, got damaged or foreign data ({problem}); build it again")]
    DamagedTable {
        /// What was found first.
        problem: &'static str,
    },
    /// Not enough memory.
    #[error("{what}: {bytes} bytes could not be allocated; use a coarser resolution or a smaller output")]
    OutOfMemory {
        /// What they were for.
        what: &'static str,
        /// How many.
        bytes: usize,
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
    /// No images, or another number of outputs.
    #[error("expected at least one image and an output for each, got {images} images and {outs} outputs")]
    ImageCount {
        /// Images that came.
        images: usize,
        /// Outputs that came.
        outs: usize,
    },
    /// Images of one call that differ in their number of channels.
    #[error("images: expected all with {expected} channels, as the first, got one with {got}")]
    MixedChannels {
        /// Channels of the first.
        expected: usize,
        /// Channels of the one that differs.
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
    /// A source that area interpolation cannot address.
    #[error("area: expected a source of at most {limit} pixels a side, got {width} x {height}")]
    AreaSize {
        /// Columns of the source.
        width: u32,
        /// Rows of the source.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// A way to interpolate that only a table offers, without one; or one that the samples do not have.
    #[error("interpolation: expected {expected}, got {got:?}; {mend}")]
    Interpolation {
        /// What is offered.
        expected: &'static str,
        /// The one that came.
        got: &'static str,
        /// What the caller can do.
        mend: &'static str,
    },
    /// A label image of too many different ids.
    #[error("mode: expected an image of at most {limit} different ids, got more")]
    TooManyIds {
        /// The limit.
        limit: usize,
    },
    /// A border value with neither one entry nor one per channel.
    #[error("border_value: expected one value or one for each of the {expected} channels, got {got} values")]
    BorderChannels {
        /// Channels of the image.
        expected: usize,
        /// Values that came.
        got: usize,
    },
    /// Cameras, masks, images or gains that make no rig.
    #[error("rig: expected {expected}, got {got}")]
    Rig {
        /// What a rig needs.
        expected: &'static str,
        /// What came.
        got: String,
    },
    /// An image with another number of channels than its coding of depth has.
    #[error("image: expected {expected} channels for this coding of depth, got {got}")]
    DepthChannels {
        /// Channels expected.
        expected: usize,
        /// Channels that came.
        got: usize,
    },
    /// Depth that no code can say.
    #[error("depth: expected numbers from 0, got {got} at row {row}, column {column}; replace what has no depth first")]
    NegativeDepth {
        /// The number that came.
        got: f64,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
    },
    /// A limit or a scale of depth that means nothing.
    #[error("{what}: expected {expected}, got {got}")]
    DepthLimit {
        /// The parameter's name.
        what: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What came.
        got: f64,
    },
    /// A depth image of another size than the camera's.
    #[error("depth is {}x{} but the camera's image is {}x{}", got.0, got.1, expected.0, expected.1)]
    DepthSize {
        /// (width, height) of the camera's image.
        expected: (usize, usize),
        /// (width, height) that came.
        got: (usize, usize),
    },
    /// A mask of another size than its depth image.
    #[error(
        "mask is {}x{} but depth is {}x{}", got.0, got.1, expected.0, expected.1
    )]
    MaskSize {
        /// (width, height) of the depth image.
        expected: (usize, usize),
        /// (width, height) that came.
        got: (usize, usize),
    },
    /// An output for another number of points.
    #[error("{what}: expected {expected} entries, got {got}")]
    PointsLength {
        /// The output's name.
        what: &'static str,
        /// Entries expected.
        expected: usize,
        /// Entries that came.
        got: usize,
    },
    /// More points, or more pixels of an image of them, than one call may make.
    #[error("{what}: expected at most {limit} points, got {got}; {mend}")]
    TooManyPoints {
        /// What asked for them.
        what: &'static str,
        /// How many.
        got: usize,
        /// The limit.
        limit: usize,
        /// What the caller can do.
        mend: &'static str,
    },
    /// A matrix that projects onto a line or a point.
    #[error("K: expected an invertible 3x3 matrix of finite numbers, got {got:?}")]
    Singular {
        /// The matrix, row by row.
        got: [[f64; 3]; 3],
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
    /// Points without the coordinates that are needed.
    #[error("points: expected at least {expected} columns (x, y, z), got {got}{mend}")]
    PointColumns {
        /// Columns that are needed.
        expected: usize,
        /// Columns that came.
        got: usize,
        /// What else can be done, for the end of the message.
        mend: &'static str,
    },
    /// Values of another number than the points.
    #[error("values: expected a row of at least one value for each of the {expected} points, got {} rows of {}", got.0, got.1)]
    PointValues {
        /// Points.
        expected: usize,
        /// (rows, columns) of the values.
        got: (usize, usize),
    },
    /// A box or a polygon that is none.
    #[error(
        "{what}: expected finite metres (boxes: x, y, length, width, yaw; polygons: at least 3 corners x, y), got {problem} at index {index}"
    )]
    Shape {
        /// The parameter's name.
        what: &'static str,
        /// Which of them.
        index: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Height slices that are not ascending.
    #[error("slices: expected at least two finite heights in ascending order, the edges of the slices, got {got:?}")]
    Slices {
        /// The edges that came.
        got: Vec<f64>,
    },
    /// A density scale that ends before it begins.
    #[error("density_full: expected a finite number above 1, the count plus one at which the density is 1, got {got}")]
    DensityFull {
        /// The number that came.
        got: f64,
    },
    /// A thread count below one.
    #[error("threads: expected at least 1, got {got}")]
    Threads {
        /// The count that came.
        got: usize,
    },
    /// More threads than can be of use.
    #[error("threads: expected at most {limit}, got {got}; as many as there are CPUs are enough")]
    TooManyThreads {
        /// The count that came.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// The caller was told to stop: see [`interruptible`](crate::interruptible).
    #[error("interrupted; what was being written is written in part")]
    Interrupted,
    /// An instruction set that is unknown or that this CPU or build lacks.
    #[error("instruction set: expected one of {available}, got {got:?}; unset IPM_RS_ISA to use the best")]
    Isa {
        /// What this CPU and build offer.
        available: String,
        /// The value that came.
        got: String,
    },
}

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A number of cells, in powers of ten where it has too many digits to be read.
fn count(cells: f64) -> String {
    if cells < 1e15 { format!("{cells}") } else { format!("{cells:.1e}") }
}

/// A number without the noise of its last bits: 0.9, not 0.8999999999999999.
pub(crate) fn readable(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// `angle` if it can be one in radians: a finite number of at most a turn.
pub(crate) fn radians(what: &'static str, angle: f64) -> Result<f64> {
    let turn = std::f64::consts::TAU * (1.0 + 1e-9); // 6.283185307 of a file is a turn
    if finite(what, angle)?.abs() <= turn { Ok(angle) } else { Err(Error::Angle { what, got: angle }) }
}

/// `value` if it is finite.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<f64> {
    if value.is_finite() { Ok(value) } else { Err(Error::NotFinite { what, got: value }) }
}
