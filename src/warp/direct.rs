//! Warps without a table, for maps that are used once: each row is packed into a few kilobytes and warped at once.

use std::slice;

use nalgebra::Matrix3;

use super::{Bilinear, Interpolation, WarpOptions, warp_spans};
use crate::cpu::Isa;
use crate::error::{Error, LutError, Result, ViewError};
use crate::kernels::{ExactBlend, ExactKernels, Float, RowKernels, Source};
use crate::kernels::{Kinds, Row, Sampled, widen};
use crate::lut::{check_homography, homography_row};
use crate::parallel;
use crate::table::{RowSpans, SpanKind, Tap, check_cells};
use crate::view::{F16, ImageView, ImageViewMut, Sample, buffer, check_image_size};

/// What lies beyond the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BorderMode {
    /// The border value: `cv2.BORDER_CONSTANT`. The default.
    #[default]
    Constant,
    /// The nearest pixel of the edge, aaa|abcd|ddd: `cv2.BORDER_REPLICATE`.
    Replicate,
    /// The image mirrored about its outermost pixels, dcb|abcd|cba: `cv2.BORDER_REFLECT_101`.
    Reflect101,
}

impl BorderMode {
    /// Brings coordinates along an axis of `size` pixels into the image; NaN and infinity become NaN, which has no image
    /// in any mode.
    fn fold(self, coordinates: &mut [f64], size: usize) {
        if self == Self::Constant {
            return;
        }
        let last = size as f64 - 1.0;
        for coordinate in coordinates {
            if *coordinate >= 0.0 && *coordinate <= last {
                continue;
            }
            *coordinate = match self {
                _ if !coordinate.is_finite() => f64::NAN,
                Self::Constant | Self::Replicate => coordinate.clamp(0.0, last),
                Self::Reflect101 if last == 0.0 => 0.0,
                Self::Reflect101 => {
                    let within = coordinate.abs() % (2.0 * last);
                    within.min(2.0 * last - within)
                }
            };
        }
    }
}

/// Where each output cell samples the source.
#[derive(Debug, Clone, Copy)]
pub enum Mapping<'a> {
    /// Cell i samples at (`maps.0[i]`, `maps.1[i]`), row-major, as `cv2.remap`. NaN and infinity give the border value in
    /// every mode.
    MapsF32(&'a [f32], &'a [f32]),
    /// Maps as those of [`Mapping::MapsF32`], in float64.
    MapsF64(&'a [f64], &'a [f64]),
    /// From output pixel (column, row, 1) to source pixel, `cv2.WARP_INVERSE_MAP`'s direction; invert the matrix for the
    /// other. Both signs of the third component sample the image, because a homography's sign is arbitrary.
    Homography(Matrix3<f64>),
}

impl Mapping<'_> {
    /// Whether it has a place for each cell.
    fn check(&self, cells: usize) -> Result<()> {
        let lengths = match self {
            Self::MapsF32(x, y) => [x.len(), y.len()],
            Self::MapsF64(x, y) => [x.len(), y.len()],
            Self::Homography(m) => return check_homography(m),
        };
        match lengths.into_iter().find(|&length| length != cells) {
            Some(got) => Err(Error::Lut(LutError::MapLength { expected: cells, got })),
            None => Ok(()),
        }
    }

    /// The source coordinates of an output row.
    fn fill(&self, isa: Isa, row: usize, columns: &[f64], us: &mut [f64], vs: &mut [f64]) {
        let cells = row * us.len()..(row + 1) * us.len();
        match self {
            Self::MapsF32(x, y) => {
                widen(isa, &x[cells.clone()], us);
                widen(isa, &y[cells], vs);
            }
            Self::MapsF64(x, y) => {
                us.copy_from_slice(&x[cells.clone()]);
                vs.copy_from_slice(&y[cells]);
            }
            Self::Homography(m) => homography_row(m, row).fill(isa, columns, us, vs),
        }
    }
}

/// Warps an image without a table, bilinear or nearest. Of floats, bilinear takes coordinates as they are, not in the
/// steps of a table.
///
/// # Errors
/// [`WarpError::NeedsTable`](crate::error::WarpError::NeedsTable) for what needs a table, [`LutError::MapLength`] where
/// a map has not one entry for each cell of `out`, [`LutError::Homography`], [`ViewError::ImageSize`],
/// [`ViewError::OutputShape`] where the channels differ, [`ViewError::BorderChannels`],
/// [`ThreadsError::Zero`](crate::error::ThreadsError::Zero) and [`IsaError`](crate::error::IsaError), all before
/// anything is written.
pub fn warp_direct_into<T: Bilinear>(
    image: &ImageView<'_, T>,
    mapping: &Mapping<'_>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    options.interpolation.without_table()?;
    let warp = Direct { image, mapping, border_mode, options };
    match options.interpolation {
        Interpolation::Nearest => by_taps(&warp, out, &options.kernels(slice::from_ref(image))?),
        _ => T::warp_direct(&warp, out),
    }
}

/// [`warp_direct_into`] with nearest, for samples of any kind; `options.interpolation` is not looked at.
///
/// # Errors
/// Those of [`warp_direct_into`].
pub fn warp_direct_nearest_into<T: Sample>(
    image: &ImageView<'_, T>,
    mapping: &Mapping<'_>,
    out: &mut ImageViewMut<'_, T>,
    border_mode: BorderMode,
    options: &WarpOptions<T>,
) -> Result<()> {
    let warp = Direct { image, mapping, border_mode, options };
    by_taps(&warp, out, &options.nearest_kernels(slice::from_ref(image))?)
}

/// A warp without a table, but for its output.
pub(crate) struct Direct<'a, T> {
    image: &'a ImageView<'a, T>,
    mapping: &'a Mapping<'a>,
    border_mode: BorderMode,
    options: &'a WarpOptions<T>,
}

/// A sample that is blended without a table: with fractions as a table has them, but for floats, which take them exactly.
pub trait WarpDirect: Sized {
    /// Bilinear.
    ///
    /// # Errors
    /// Those of [`warp_direct_into`].
    #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
    fn warp_direct(warp: &Direct<'_, Self>, out: &mut ImageViewMut<'_, Self>) -> Result<()>;
}

macro_rules! warp_direct {
    ($warp:expr => $($type:ty),*) => {$(
        impl WarpDirect for $type {
            #[expect(private_interfaces, reason = "sealed: nobody outside can call it")]
            fn warp_direct(warp: &Direct<'_, Self>, out: &mut ImageViewMut<'_, Self>) -> Result<()> {
                $warp(warp, out)
            }
        }
    )*};
}
warp_direct!(quantised => u8, u16, i8, i16);
warp_direct!(exact::<_, f32> => f32, F16);
warp_direct!(exact::<_, f64> => f64);

/// Bilinear with fractions as a table has them.
fn quantised<T: Bilinear>(warp: &Direct<'_, T>, out: &mut ImageViewMut<'_, T>) -> Result<()> {
    by_taps(warp, out, &warp.options.kernels(slice::from_ref(warp.image))?)
}

/// Bilinear of floats, with fractions as exact as `F` holds them.
fn exact<T: ExactBlend<F>, F: Float>(warp: &Direct<'_, T>, out: &mut ImageViewMut<'_, T>) -> Result<()> {
    let (isa, image) = (warp.options.isa()?, warp.image);
    let kernels = ExactKernels::<T, F>::new(isa, image.channels(), image.is_contiguous());
    run(
        warp,
        out,
        |_| Ok(Kinds::default()),
        |kinds, row, source, cells| {
            let channels = source.channels();
            for (kind, own) in kinds.sort(isa, row)? {
                let cells = &mut cells[own.start * channels..own.end * channels];
                let coordinates = [&row.us[own.clone()], &row.vs[own]];
                match kind {
                    SpanKind::Outside => source.fill_border(cells),
                    SpanKind::Inside => kernels.inside(source, coordinates, cells),
                    SpanKind::Rim | SpanKind::Halo => kernels.edge(source, coordinates, cells),
                }
            }
            Ok(())
        },
    )
}

/// What packing and warping a row takes, used for all rows of a thread.
struct Packed {
    taps: Vec<Tap>,
    spans: RowSpans,
    kinds: Kinds,
}

/// Each row is packed as those of a table are, and warped at once.
fn by_taps<T: Sample>(warp: &Direct<'_, T>, out: &mut ImageViewMut<'_, T>, kernels: &RowKernels<T>) -> Result<()> {
    let isa = warp.options.isa()?;
    let packed = |columns| {
        let taps = buffer::filled("out", columns, Tap::default())?;
        Ok(Packed { taps, spans: RowSpans::default(), kinds: Kinds::default() })
    };
    run(warp, out, packed, |Packed { taps, spans, kinds }, row, source, cells| {
        spans.repack(isa, row, taps, kinds)?;
        let sources = slice::from_ref(source);
        warp_spans(spans.spans(0, taps), sources, [cells], kernels, false, |span, [cells]| {
            (kernels.inside)(source, span.taps, cells);
        });
        Ok(())
    })
}

/// The inverse of a homography.
///
/// # Errors
/// [`LutError::Homography`] where it has none.
pub fn inverse_homography(m: &Matrix3<f64>) -> Result<Matrix3<f64>> {
    check_homography(m)?;
    let inverse = m.try_inverse().unwrap_or_else(Matrix3::zeros);
    check_homography(&inverse)?; // one that overflows is no inverse
    Ok(inverse)
}

/// Checks everything, then fills each row with `fill`, which gets a thread's `scratch` for so many columns, where the cells
/// sample, the source, and the cells.
fn run<T: Sample, S>(
    warp: &Direct<'_, T>,
    out: &mut ImageViewMut<'_, T>,
    scratch: impl Fn(usize) -> Result<S> + Sync,
    fill: impl Fn(&mut S, Sampled<'_>, &Source<'_, T>, &mut [T]) -> Result<()> + Sync,
) -> Result<()> {
    let Direct { image, mapping, border_mode, options } = warp;
    let (rows, columns, channels) = out.shape();
    let source_size = check_image_size("image", image.width() as u64, image.height() as u64)?;
    check_cells(rows, columns)?;
    mapping.check(rows * columns)?;
    if channels != image.channels() {
        return Err(Error::View(ViewError::OutputShape {
            expected: (rows, columns, image.channels()),
            got: out.shape(),
        }));
    }
    let border = options.border(image.channels(), 1)?;
    let (threads, isa) = (options.threads_for(rows * columns, channels)?, options.isa()?);
    let source = Source::new(image, &border);
    let whole = Row::collected((0..columns).map(|column| column as f64))?;
    let bands = out.bands(parallel::rows_per_band(rows, columns, threads));
    parallel::for_each(threads, bands, |(first, band)| {
        let (mut us, mut vs) = (Row::filled(columns, 0.0)?, Row::filled(columns, 0.0)?);
        let mut scratch = scratch(columns)?;
        for (row, cells) in (first..).zip(band) {
            mapping.fill(isa, row, &whole, &mut us, &mut vs);
            border_mode.fold(&mut us, image.width());
            border_mode.fold(&mut vs, image.height());
            fill(&mut scratch, Sampled { us: &us, vs: &vs, source: source_size }, &source, cells)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folded(mode: BorderMode, coordinate: f64, size: usize) -> f64 {
        let mut one = [coordinate];
        mode.fold(&mut one, size);
        one[0]
    }

    #[test]
    fn borders_fold_as_opencv_names_them() {
        for (coordinate, replicate, reflect) in
            [(-0.25, 0.0, 0.25), (-3.5, 0.0, 3.5), (4.5, 4.0, 3.5), (8.0, 4.0, 0.0), (11.0, 4.0, 3.0), (2.5, 2.5, 2.5)]
        {
            assert_eq!(folded(BorderMode::Replicate, coordinate, 5), replicate, "{coordinate}");
            assert_eq!(folded(BorderMode::Reflect101, coordinate, 5), reflect, "{coordinate}");
            assert_eq!(folded(BorderMode::Constant, coordinate, 5), coordinate);
        }
        assert_eq!(folded(BorderMode::Reflect101, 3.7, 1), 0.0);
        for mode in [BorderMode::Replicate, BorderMode::Reflect101] {
            for none in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(folded(mode, none, 5).is_nan());
            }
        }
    }
}
