//! The transpose of one picture of several cameras: from its cells back to the pixels of each.

use super::pieces::ONE;
use super::{RigLut, WHAT};
use crate::error::{Result, ViewError, WarpError};
use crate::parallel::check_interrupt;
use crate::view::{ImageView, ImageViewMut, PointSample, buffer};
use crate::warp::{Interpolation, WarpOptions};

/// So many images are weighted at once: the planes that [`Lut::warp_many_adjoint_into`](crate::Lut::warp_many_adjoint_into)
/// takes together.
const AT_ONCE: usize = 16;

impl RigLut {
    /// The transpose of [`RigLut::warp_into`] without gains as far as one camera goes, by its place in the rig: the i-th
    /// grad, a value for each cell, into the i-th output, one for each of the camera's pixels. What cells give is weighted as
    /// they are mixed; of nearest, a cell gives all to the camera that it takes. The number of threads changes nothing.
    ///
    /// # Errors
    /// Those of [`Lut::warp_many_adjoint_into`](crate::Lut::warp_many_adjoint_into).
    ///
    /// # Panics
    /// Where the rig has no such camera.
    pub fn warp_many_adjoint_into<T: PointSample>(
        &self,
        camera: usize,
        grads: &[ImageView<'_, T>],
        outs: &mut [ImageViewMut<'_, T>],
        options: &WarpOptions<T>,
    ) -> Result<()> {
        if grads.len() != outs.len() || grads.is_empty() {
            return Err(WarpError::ImageCount { images: grads.len(), outs: outs.len() }.into());
        }
        let (expected, channels) = ((self.columns(), self.rows()), grads[0].channels());
        for grad in grads {
            let got = (grad.width(), grad.height());
            if got != expected {
                return Err(ViewError::SizeMismatch { expected, got }.into());
            }
            if grad.channels() != channels {
                return Err(WarpError::MixedChannels { expected: channels, got: grad.channels() }.into());
            }
        }
        let table = self.table_of(camera);
        let (width, height) = self.source_size(camera);
        let expected_out = (height as usize, width as usize, channels);
        // all of them, before the first sixteen are written
        if let Some(out) = outs.iter().find(|out| out.shape() != expected_out) {
            return Err(ViewError::OutputShape { expected: expected_out, got: out.shape() }.into());
        }
        let shares = self.shares(table, options.interpolation)?;
        let samples = self.rows() * self.columns() * channels;
        let mut weighted = buffer::filled(WHAT, samples * grads.len().min(AT_ONCE), T::default())?;
        for (grads, outs) in grads.chunks(AT_ONCE).zip(outs.chunks_mut(AT_ONCE)) {
            let mut views = buffer::reserved(WHAT, grads.len())?;
            for (grad, weighted) in grads.iter().zip(weighted.chunks_mut(samples)) {
                check_interrupt()?;
                for (index, (to, &share)) in weighted.chunks_mut(channels).zip(&shares).enumerate() {
                    let from = grad.pixel(index % self.columns(), index / self.columns());
                    for (to, from) in to.iter_mut().zip(from) {
                        // a cell that another camera shows may hold NaN
                        *to = if share == 0.0 { T::default() } else { T::from_f64(from.to_f64() * share) };
                    }
                }
                views.push(ImageView::new(weighted, expected, channels)?);
            }
            self.shown()?[table].warp_many_adjoint_into(&views, outs, options)?;
        }
        Ok(())
    }

    /// What part of each cell is a table's.
    fn shares(&self, table: usize, interpolation: Interpolation) -> Result<Vec<f64>> {
        let mut shares = buffer::zeroed(WHAT, self.rows() * self.columns())?;
        for (row, cells) in shares.chunks_mut(self.columns()).enumerate() {
            for piece in self.pieces.row(row) {
                let Some(place) = piece.tables.iter().position(|&shown| usize::from(shown) == table) else { continue };
                let cells = &mut cells[piece.first..piece.first + piece.cells];
                match (interpolation, piece.weights_of(place)) {
                    (Interpolation::Nearest, _) => cells.fill(f64::from(u8::from(place == 0))),
                    (_, None) => cells.fill(1.0),
                    (_, Some(weights)) => {
                        let share = |&weight: &u16| f64::from(weight) / f64::from(ONE);
                        cells.iter_mut().zip(weights.iter().map(share)).for_each(|(cell, share)| *cell = share);
                    }
                }
            }
        }
        Ok(shares)
    }
}
