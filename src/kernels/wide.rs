//! Interpolations that look at more than the four pixels around a coordinate: bicubic convolution and Lanczos, as OpenCV
//! defines them.
//!
//! One body of plain Rust, compiled for each instruction set (decision 0005), all with the same result to the last bit:
//! the sums down the columns of a cell's pixels in their order, then along their row by halves ([`fold`]), in float32 (float64
//! of float64), nothing fused. Neighbouring samples of a row of pixels are one vector, whatever their channel.
//!
//! Weights are negative beside the middle, so results overshoot: integers are rounded to the nearest, halves up, and then
//! brought into their range.

use std::sync::OnceLock;

use super::{RowKernel, Source};
use crate::isa::{self, Body, Isa, by_isa};
use crate::table::{ONE, Tap, unframed};
use crate::view::{F16, Sample};

/// Pixels along each side of what a cell looks at: those of [`Interpolation::Cubic`](crate::Interpolation) and of
/// [`Interpolation::Lanczos4`](crate::Interpolation).
pub(crate) const CUBIC: usize = 4;
pub(crate) const LANCZOS4: usize = 8;

/// The numbers that a weighted sum is worked out in.
pub trait Real: Copy + Default + PartialEq + std::ops::Add<Output = Self> + std::ops::Mul<Output = Self> {
    /// The weights of `N` pixels, of which number `N / 2 - 1` is the last before the coordinate, so far beyond it, from 0 to
    /// 1. They sum to 1, but for rounding. `table` is [`lanczos4_table`] for [`LANCZOS4`].
    fn weights<const N: usize>(fraction: f64, table: &[[f32; LANCZOS4]]) -> [Self; N];
}

/// Keys' kernel with a = -0.75, as `cv2.INTER_CUBIC`: four polynomials, whose coefficients are exact.
macro_rules! cubic {
    ($type:ty, $x:expr) => {{
        const A: $type = -0.75;
        const CUBE: [$type; CUBIC] = [A, A + 2.0, -A - 2.0, -A];
        const SQUARE: [$type; CUBIC] = [-2.0 * A, -A - 3.0, 2.0 * A + 3.0, A];
        const FIRST: [$type; CUBIC] = [A, 0.0, -A, 0.0];
        const CONSTANT: [$type; CUBIC] = [0.0, 1.0, 0.0, 0.0];
        let (x, mut weights) = ($x, [0.0; CUBIC]);
        for k in 0..CUBIC {
            weights[k] = ((CUBE[k] * x + SQUARE[k]) * x + FIRST[k]) * x + CONSTANT[k];
        }
        weights
    }};
}

impl Real for f32 {
    #[inline(always)]
    fn weights<const N: usize>(fraction: f64, table: &[[f32; LANCZOS4]]) -> [f32; N] {
        let (x, mut weights) = (fraction as f32, [0.0; N]);
        if N == CUBIC {
            weights.copy_from_slice(&cubic!(f32, x));
            return weights;
        }
        let steps = x * STEPS as f32;
        let step = steps as usize;
        let (before, after, beyond) = (&table[step], &table[step + 1], steps - step as f32);
        for k in 0..N {
            weights[k] = before[k] + (after[k] - before[k]) * beyond;
        }
        weights
    }
}

impl Real for f64 {
    #[inline(always)]
    fn weights<const N: usize>(fraction: f64, _: &[[f32; LANCZOS4]]) -> [f64; N] {
        let mut weights = [0.0; N];
        if N == CUBIC {
            weights.copy_from_slice(&cubic!(f64, fraction));
        } else {
            weights.copy_from_slice(&lanczos4(fraction));
        }
        weights
    }
}

/// Steps of a pixel in the table of weights. Between them weights are taken as straight, which is at most 5e-7 off; worked
/// out for each cell they took longer than the sums.
const STEPS: usize = 1024;

/// The weights of Lanczos at each step of a pixel, and after the last one again, so that there is always a next one.
fn lanczos4_table() -> &'static [[f32; LANCZOS4]] {
    static TABLE: OnceLock<Vec<[f32; LANCZOS4]>> = OnceLock::new();
    if let Some(table) = TABLE.get() {
        return table;
    }
    // not `get_or_init`, which would make a child wait for ever that is forked while another thread builds
    let at = |step: usize| lanczos4(step.min(STEPS) as f64 / STEPS as f64).map(|weight| weight as f32);
    let table = (0..=STEPS + 1).map(at).collect();
    TABLE.get_or_init(|| table)
}

/// sinc(d) sinc(d / 4) of the distance d of eight pixels from a coordinate that is so far beyond the fourth, brought to a sum
/// of 1, as `cv2.INTER_LANCZOS4`.
fn lanczos4(x: f64) -> [f64; LANCZOS4] {
    const R: f64 = std::f64::consts::FRAC_1_SQRT_2;
    /// Cosine and sine of a quarter of pi times 3, 2 .. -4, every other one negative: the signs of sin(pi d).
    const COS: [f64; LANCZOS4] = [R, 0.0, -R, 1.0, -R, 0.0, R, -1.0];
    const SIN: [f64; LANCZOS4] = [-R, 1.0, -R, 0.0, R, -1.0, R, 0.0];
    let mut weights = [0.0; LANCZOS4];
    // the weights of all other pixels are below the rounding
    if !(f64::EPSILON..=1.0 - f64::EPSILON).contains(&x) {
        weights[LANCZOS4 / 2 - usize::from(x < 0.5)] = 1.0;
        return weights;
    }
    let (sin, cos) = sin_cos_quarter(x);
    let mut sum = 0.0;
    for k in 0..LANCZOS4 {
        let distance = x + (3 - k as i32) as f64;
        weights[k] = (COS[k] * sin + SIN[k] * cos) / (distance * distance);
        sum += weights[k];
    }
    for weight in &mut weights {
        *weight /= sum;
    }
    weights
}

/// Sine and cosine of `x` quarters of pi, from 0 to 1, to the rounding of the arithmetic. Those of the C library are not the
/// same everywhere.
fn sin_cos_quarter(x: f64) -> (f64, f64) {
    /// Terms of the two series: the first one that is left out is below 1e-18.
    const TERMS: u32 = 9;
    let angle = x * std::f64::consts::FRAC_PI_4;
    let square = angle * angle;
    let (mut sin, mut cos) = (1.0, 1.0);
    for term in (1..=TERMS).rev() {
        let n = f64::from(2 * term);
        sin = 1.0 - sin * square / (n * (n + 1.0));
        cos = 1.0 - cos * square / (n * (n - 1.0));
    }
    (angle * sin, cos)
}

/// A sample that is summed with weights of either sign.
pub trait Wide: Sample {
    /// What sums are worked out in.
    type Real: Real;

    /// The sample as a number.
    fn real(self) -> Self::Real;

    /// The sample nearest to a number.
    fn nearest(value: Self::Real) -> Self;
}

macro_rules! wide_integers {
    ($($type:ty),*) => {$(
        impl Wide for $type {
            type Real = f32;

            #[inline(always)]
            fn real(self) -> f32 {
                f32::from(self)
            }

            #[inline(always)]
            fn nearest(value: f32) -> Self {
                const LOWEST: f32 = <$type>::MIN as f32;
                const HIGHEST: f32 = <$type>::MAX as f32 - LOWEST;
                // above the lowest before it is truncated, so that truncating is rounding down
                let above = if value > LOWEST { value - LOWEST } else { 0.0 };
                let above = if above < HIGHEST { above } else { HIGHEST };
                // SAFETY: from 0.5 to 65535.5. The checks of `as` cost as much as a sum.
                (unsafe { (above + 0.5).to_int_unchecked::<i32>() } + <$type>::MIN as i32) as Self
            }
        }
    )*};
}
wide_integers!(u8, i8, u16, i16);

impl Wide for f32 {
    type Real = f32;

    #[inline(always)]
    fn real(self) -> f32 {
        self
    }

    #[inline(always)]
    fn nearest(value: f32) -> f32 {
        value
    }
}

impl Wide for F16 {
    type Real = f32;

    #[inline(always)]
    fn real(self) -> f32 {
        self.to_f32()
    }

    #[inline(always)]
    fn nearest(value: f32) -> F16 {
        F16::from_f32(value)
    }
}

impl Wide for f64 {
    type Real = f64;

    #[inline(always)]
    fn real(self) -> f64 {
        self
    }

    #[inline(always)]
    fn nearest(value: f64) -> f64 {
        value
    }
}

/// The most channels whose pixels are summed as one vector.
const TOGETHER: usize = 4;

/// Channels at a time where there are more: a vector of float32.
const LANES: usize = 8;

/// The kernel of an instruction set for images of so many channels; 0 is any number.
macro_rules! kernel {
    ($isa:ident, $channels:literal) => {
        |source, [us, vs], cells, keeps| {
            isa::run(Isa::$isa, Row::<_, N, $channels> { source, us, vs, cells, keeps });
        }
    };
}

/// The kernels of an instruction set.
macro_rules! kernels {
    ($isa:ident, $channels:expr) => {
        match $channels {
            1 => kernel!($isa, 1),
            3 => kernel!($isa, 3),
            4 => kernel!($isa, 4),
            _ => kernel!($isa, 0),
        }
    };
}

/// The sum of products of `N` neighbouring pixels with one or more samples each, into those of the first: the halves of
/// them are added until one is left, which vectors do for all samples at once.
#[inline(always)]
fn fold<R: Real, const N: usize>(products: &mut [R], samples: usize) {
    let mut half = N / 2 * samples;
    while half >= samples {
        for i in 0..half {
            products[i] = products[i] + products[i + half];
        }
        half /= 2;
    }
}

/// One cell: the weighted sum of the `N x N` pixels around a place, of which (x, y) is the last before it.
#[expect(clippy::needless_range_loop, reason = "iterators of zips were left as calls in the vectors' functions")]
#[inline(always)]
fn cell<T: Wide, const N: usize, const CHANNELS: usize>(
    source: &Source<'_, T>,
    (x, y): (i64, i64),
    (fx, fy): (f64, f64),
    table: &[[f32; LANCZOS4]],
    values: &mut [T],
) {
    let (across, down) = (T::Real::weights::<N>(fx, table), T::Real::weights::<N>(fy, table));
    let image = source.image;
    let before = N as i64 / 2 - 1;
    let (left, top) = (x - before, y - before);
    let fits = |start: i64, size: usize| start >= 0 && start + N as i64 <= size as i64;
    if !fits(left, image.width()) || !fits(top, image.height()) {
        return edge_cell::<T, N>(source, (x, y), (&across, &down), values);
    }
    let channels = if CHANNELS == 0 { image.channels() } else { CHANNELS };
    let (left, top) = (left as usize * channels, top as usize);
    let width = N * channels;
    let row = |j: usize| {
        let start = image.row_start(top + j) + left;
        &image.data()[start..start + width]
    };
    if CHANNELS != 0 {
        // all samples of a column of the cell's pixels at once
        let mut columns = [T::Real::default(); LANCZOS4 * TOGETHER];
        let mut sums = [T::Real::default(); LANCZOS4 * TOGETHER];
        for j in 0..N {
            let (row, weight) = (row(j), down[j]);
            for i in 0..width {
                columns[i] = columns[i] + weight * row[i].real();
            }
        }
        for i in 0..N {
            for channel in 0..CHANNELS {
                sums[i * CHANNELS + channel] = columns[i * CHANNELS + channel] * across[i];
            }
        }
        fold::<_, N>(&mut sums, CHANNELS);
        for channel in 0..CHANNELS {
            values[channel] = T::nearest(sums[channel]);
        }
        return;
    }
    let mut rows = [&[] as &[T]; LANCZOS4];
    for (j, samples) in rows[..N].iter_mut().enumerate() {
        *samples = row(j);
    }
    let (blocks, rest) = values.as_chunks_mut::<LANES>();
    let vectors = blocks.len() * LANES;
    for (block, values) in blocks.iter_mut().enumerate() {
        let mut columns = [T::Real::default(); LANCZOS4 * LANES];
        for (i, &weight) in across.iter().enumerate() {
            let column = &mut columns[i * LANES..][..LANES];
            for (row, &weight) in rows.iter().zip(&down) {
                let samples = &row[i * channels + block * LANES..][..LANES];
                for k in 0..LANES {
                    column[k] = column[k] + weight * samples[k].real();
                }
            }
            for sum in column {
                *sum = *sum * weight;
            }
        }
        fold::<_, N>(&mut columns, LANES);
        for (value, &sum) in values.iter_mut().zip(&columns) {
            *value = T::nearest(sum);
        }
    }
    for (channel, value) in rest.iter_mut().enumerate() {
        *value = summed(&across, &down, |i, j| rows[j][i * channels + vectors + channel]);
    }
}

/// The sum for one channel, of which `sample` gives column i and row j.
#[inline(always)]
fn summed<T: Wide, const N: usize>(
    across: &[T::Real; N],
    down: &[T::Real; N],
    sample: impl Fn(usize, usize) -> T,
) -> T {
    let mut columns = [T::Real::default(); N];
    for (i, column) in columns.iter_mut().enumerate() {
        for (j, &weight) in down.iter().enumerate() {
            *column = *column + weight * sample(i, j).real();
        }
        *column = *column * across[i];
    }
    fold::<_, N>(&mut columns, 1);
    T::nearest(columns[0])
}

/// [`cell`] where not all pixels exist. One without weight is not looked at, so that a NaN border does not reach cells on
/// the last column.
#[inline(never)]
fn edge_cell<T: Wide, const N: usize>(
    source: &Source<'_, T>,
    (x, y): (i64, i64),
    (across, down): (&[T::Real; N], &[T::Real; N]),
    values: &mut [T],
) {
    let before = N as i64 / 2 - 1;
    let place = |middle: i64, at: usize, weight: T::Real| {
        if weight == T::Real::default() { middle } else { middle + at as i64 - before }
    };
    for (channel, value) in values.iter_mut().enumerate() {
        *value =
            summed(across, down, |i, j| source.pixel_or_border(place(x, i, across[i]), place(y, j, down[j]))[channel]);
    }
}

/// Neighbouring cells at these coordinates.
struct Row<'a, T, const N: usize, const CHANNELS: usize> {
    source: &'a Source<'a, T>,
    us: &'a [f64],
    vs: &'a [f64],
    cells: &'a mut [T],
    /// Whether cells that are not inside the rectangle of pixel centres keep what they hold.
    keeps: bool,
}

impl<T: Wide, const N: usize, const CHANNELS: usize> Body for Row<'_, T, N, CHANNELS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { source, us, vs, cells, keeps } = self;
        let table = if N == LANCZOS4 { lanczos4_table() } else { &[] };
        let channels = if CHANNELS == 0 { source.channels() } else { CHANNELS };
        let (last_u, last_v) = (source.image.width() as f64 - 1.0, source.image.height() as f64 - 1.0);
        // the pixels of a cell are N / 2 - 1 before and N / 2 behind the one at or before its coordinate
        let reach = (N / 2) as f64;
        for ((&u, &v), values) in us.iter().zip(vs).zip(cells.chunks_exact_mut(channels)) {
            if keeps && !(u >= 0.0 && v >= 0.0 && u <= last_u && v <= last_v) {
                continue;
            }
            if !(u >= -reach && v >= -reach && u <= last_u + reach && v <= last_v + reach) {
                source.fill_border(values);
                continue;
            }
            let (x, y) = (u.floor(), v.floor());
            cell::<T, N, CHANNELS>(source, (x as i64, y as i64), (u - x, v - y), table, values);
        }
    }
}

/// Fills neighbouring cells from exact coordinates, along x and along y. The last says whether those outside the rectangle of
/// pixel centres keep what they hold.
pub(crate) type PlacesKernel<T> = fn(&Source<'_, T>, [&[f64]; 2], &mut [T], bool);

/// The kernel of `N x N` pixels for images of so many channels, compiled for an instruction set.
///
/// Each takes the compiler long and the library some kilobytes: plain Rust has one for all channels, and AVX-512 has AVX2's,
/// whose vectors are as long as a row of pixels.
pub(crate) fn places<T: Wide, const N: usize>(isa: Isa, channels: usize) -> PlacesKernel<T> {
    by_isa!(
        isa,
        Scalar => kernel!(Scalar, 0),
        Avx2 => kernels!(Avx2, channels),
        Avx512 => kernels!(Avx2, channels),
        Neon => kernels!(Neon, channels),
    )
}

/// Cells of a table at a time: their coordinates are 4 KB.
const BLOCK: usize = 256;

/// Fills neighbouring cells from their taps, of which `at` says the last pixel before the coordinate.
fn by_taps<T: Wide>(
    kernel: PlacesKernel<T>,
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
    at: impl Fn(u32, u32) -> (i64, i64),
) {
    let width = source.image.width() as u32;
    let (mut us, mut vs) = ([0.0; BLOCK], [0.0; BLOCK]);
    for (taps, cells) in taps.chunks(BLOCK).zip(cells.chunks_mut(BLOCK * source.channels())) {
        for ((tap, u), v) in taps.iter().zip(&mut us).zip(&mut vs) {
            const STEP: f64 = 1.0 / ONE as f64;
            let (x, y) = at(tap.offset, width);
            (*u, *v) = (x as f64 + f64::from(tap.fx()) * STEP, y as f64 + f64::from(tap.fy()) * STEP);
        }
        kernel(source, [&us[..taps.len()], &vs[..taps.len()]], cells, false);
    }
}

/// [`places`] for taps of cells whose four pixels exist; of the others around them, some may not.
pub(super) fn inside<T: Wide, const N: usize>(isa: Isa, channels: usize) -> RowKernel<T> {
    macro_rules! by_channels {
        ($isa:ident: $($channels:literal)*) => {
            match channels {
                $($channels => |source, taps, cells| {
                    by_taps(places::<T, N>(Isa::$isa, $channels), source, taps, cells, within);
                },)*
                _ => |source, taps, cells| by_taps(places::<T, N>(Isa::$isa, 0), source, taps, cells, within),
            }
        };
    }
    by_isa!(
        isa,
        Scalar => by_channels!(Scalar:),
        Avx2 => by_channels!(Avx2: 1 3 4),
        Avx512 => by_channels!(Avx512: 1 3 4),
        Neon => by_channels!(Neon: 1 3 4),
    )
}

/// The pixel of a tap that is counted without a frame.
fn within(offset: u32, width: u32) -> (i64, i64) {
    (i64::from(offset % width), i64::from(offset / width))
}

/// [`places`] for taps of cells on the rim and in the halo.
pub(super) fn edge<T: Wide, const N: usize>(source: &Source<'_, T>, taps: &[Tap], cells: &mut [T]) {
    by_taps(places::<T, N>(Isa::Scalar, 0), source, taps, cells, unframed);
}
