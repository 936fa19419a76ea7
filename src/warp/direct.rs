//! Warps without a table, for maps that are used once: each row is packed into a few kilobytes and warped at once.

use std::slice;

use nalgebra::Matrix3;

use super::{Bilinear, Interpolation, WarpOptions, warp_spans};
use crate::error::{Error, LutError, Result, ViewError};
use crate::isa::Isa;
use crate::kernels::wide::{CUBIC, LANCZOS4, places};
use crate::kernels::{ExactBlend, ExactKernels, Float, RowKernels, Source};
use crate::kernels::{Kinds, Row, Sampled, widen};
use crate::lut::{check_homography, homography_row};
use crate::parallel;
use crate::table::{BorderMode, RowSpans, SpanKind, Tap, check_cells};
use crate::view::{F16, ImageView, ImageViewMut, Sample, buffer, check_image_size};

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

/// Warps an image without a table, by any interpolation but area and mode. Of floats, bilinear takes coordinates as they are, not in the
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
    options: &WarpOptions<T>,
) -> Result<()> {
    options.interpolation.without_table()?;
    let nearest = options.interpolation == Interpolation::Nearest;
    let warp = Direct { image, mapping, options, nearest, reach: 0.0 };
    match options.interpolation {
        Interpolation::Nearest => by_taps(&warp, out, &options.kernels(slice::from_ref(image))?),
        Interpolation::Cubic => wide::<T, CUBIC>(&warp, out),
        Interpolation::Lanczos4 => wide::<T, LANCZOS4>(&warp, out),
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
    options: &WarpOptions<T>,
) -> Result<()> {
    let warp = Direct { image, mapping, options, nearest: true, reach: 0.0 };
    by_taps(&warp, out, &options.nearest_kernels(slice::from_ref(image))?)
}

/// A warp without a table, but for its output.
pub(crate) struct Direct<'a, T> {
    image: &'a ImageView<'a, T>,
    mapping: &'a Mapping<'a>,
    options: &'a WarpOptions<T>,
    nearest: bool,
    /// How far beyond the image replicated pixels still differ.
    reach: f64,
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
                    SpanKind::Halo if source.keeps() => {}
                    SpanKind::Rim | SpanKind::Halo => kernels.edge(source, coordinates, cells),
                }
            }
            Ok(())
        },
    )
}

/// Sums of `N x N` pixels, with weights of the coordinates as they are.
fn wide<T: Bilinear, const N: usize>(warp: &Direct<'_, T>, out: &mut ImageViewMut<'_, T>) -> Result<()> {
    let kernel = places::<T, N>(warp.options.isa()?, warp.image.channels());
    let warp = Direct { reach: (N / 2) as f64, ..*warp };
    run(
        &warp,
        out,
        |_| Ok(()),
        |(), row, source, cells| {
            kernel(source, [row.us, row.vs], cells, source.keeps());
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
    let Direct { image, mapping, options, nearest, reach } = *warp;
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
    let mode = options.border_mode.unwrap_or_default();
    let source = Source::new(image, &border).with_edges([mode; 2]);
    let source = if mode == BorderMode::Transparent { source.transparent() } else { source };
    let whole = Row::collected((0..columns).map(|column| column as f64))?;
    let bands = out.bands(parallel::rows_per_band(rows, columns, threads));
    parallel::for_each(threads, bands, |(first, band)| {
        let (mut us, mut vs) = (Row::filled(columns, 0.0)?, Row::filled(columns, 0.0)?);
        let mut scratch = scratch(columns)?;
        for (row, cells) in (first..).zip(band) {
            mapping.fill(isa, row, &whole, &mut us, &mut vs);
            if nearest && mode.repeats() {
                // before a mirror turns a half's even neighbour into its odd one
                us.iter_mut().chain(&mut *vs).for_each(|at| *at = at.round_ties_even());
            }
            mode.fold(&mut us, image.width(), reach);
            mode.fold(&mut vs, image.height(), reach);
            fill(&mut scratch, Sampled { us: &us, vs: &vs, source: source_size }, &source, cells)?;
        }
        Ok(())
    })
}
