//! Area of samples that another dtype stands in for: the image is converted as a whole, averaged, and the result
//! converted back. So halves are averaged in float32 and rounded once, and signed integers are averaged as the unsigned
//! ones that are larger by half the range.

use super::warp;
use crate::error::Result;
use crate::isa::{self, Body, Isa};
use crate::kernels::Average;
use crate::lut::Lut;
use crate::parallel::{self, check_interrupt};
use crate::table::BorderMode;
use crate::view::F16;
use crate::view::buffer;
use crate::view::{ImageView, ImageViewMut, Sample};
use crate::warp::Bilinear;
use crate::warp::WarpOptions;
use crate::warp::options::border_of;

/// A sample and the one that stands in for it.
pub(super) trait StandIn: Sample {
    type As: Bilinear + Average;

    fn into_stand_in(self) -> Self::As;

    /// Rounds as a blend of this dtype does.
    fn from_stand_in(value: Self::As) -> Self;
}

impl StandIn for F16 {
    type As = f32;

    #[inline(always)]
    fn into_stand_in(self) -> f32 {
        self.to_f32()
    }

    #[inline(always)]
    fn from_stand_in(value: f32) -> Self {
        Self::from_f32(value)
    }
}

macro_rules! signed {
    ($signed:ty, $unsigned:ty) => {
        impl StandIn for $signed {
            type As = $unsigned;

            #[inline(always)]
            fn into_stand_in(self) -> $unsigned {
                (self ^ <$signed>::MIN) as $unsigned
            }

            #[inline(always)]
            fn from_stand_in(value: $unsigned) -> $signed {
                value as $signed ^ <$signed>::MIN
            }
        }
    };
}
signed!(i8, u8);
signed!(i16, u16);

/// As [`warp`]; one image after the other, so that no more than one is held twice.
pub(super) fn warp_by_stand_in<T: StandIn>(
    lut: &Lut,
    images: &[ImageView<'_, T>],
    outs: &mut [ImageViewMut<'_, T>],
    border: &[T],
    options: &WarpOptions<T>,
) -> Result<()> {
    let (size, channels) = ((images[0].width(), images[0].height()), images[0].channels());
    let row = size.0 * channels;
    let (isa, threads) = (options.isa()?, options.threads_for(size.0 * size.1, channels)?);
    let mut pixels = buffer::filled("area", row * size.1, T::As::default())?;
    let mut averages = buffer::filled("area", lut.rows() * lut.columns() * channels, T::As::default())?;
    let out_size = (lut.columns(), lut.rows());
    let band_rows = parallel::rows_per_band(size.1, size.0, threads);
    for (index, (image, out)) in images.iter().zip(outs).enumerate() {
        let bands = pixels.chunks_mut(band_rows * row).enumerate();
        parallel::for_each(threads, bands, |(band, pixels)| {
            for (y, to) in (band * band_rows..).zip(pixels.chunks_mut(row)) {
                let start = image.row_start(y);
                convert(isa, &image.data()[start..start + row], to, T::into_stand_in);
            }
            Ok(())
        })?;
        let border = border_of(border, channels, index).iter().map(|value| value.into_stand_in());
        let border = buffer::collected("border_value", border)?;
        let options = WarpOptions {
            interpolation: options.interpolation,
            border_value: buffer::copied("border_value", &border)?,
            border_mode: options.border_mode,
            isa: options.isa,
            threads: options.threads,
        };
        let image = ImageView::new(&pixels, size, channels)?;
        if options.border_mode == Some(BorderMode::Transparent) {
            // cells that keep what they hold hold it in the stand-in too
            for (to, from) in averages.chunks_mut(out_size.0 * channels).zip(out.rows()) {
                convert(isa, from, to, T::into_stand_in);
            }
        }
        let mut average = ImageViewMut::new(&mut averages, out_size, channels)?;
        warp(lut, &[image], std::slice::from_mut(&mut average), &border, &options)?;
        for (from, to) in averages.chunks(out_size.0 * channels).zip(out.rows()) {
            check_interrupt()?;
            convert(isa, from, to, T::from_stand_in);
        }
    }
    Ok(())
}

fn convert<T: Copy, U>(isa: Isa, from: &[T], to: &mut [U], each: impl Fn(T) -> U) {
    isa::run(isa, Convert { from, to, each });
}

struct Convert<'a, T, U, F> {
    from: &'a [T],
    to: &'a mut [U],
    each: F,
}

impl<T: Copy, U, F: Fn(T) -> U> Body for Convert<'_, T, U, F> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (to, &from) in self.to.iter_mut().zip(self.from) {
            *to = (self.each)(from);
        }
    }
}
