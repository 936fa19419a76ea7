//! What a table says of one cell.

/// Fractions are Q15: 1/32768 of a pixel, 2^-16 (and 2^-21, lost in rounding) at most from the true coordinate. That is 0.008 of 255 grey levels
/// over both axes, and leaves the top bit of a `u16` for [`STEP`].
pub(crate) const ONE: u32 = 1 << 15;

/// Set in a fraction where the nearest pixel is the next one. It is decided in float64, ties to even, because the
/// rounded fraction cannot tell 11.4999999 from 11.5.
const STEP: u16 = 1 << 15;

/// What the cells of a span have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum SpanKind {
    /// No image: the border value.
    Outside = 0,
    /// Valid, and all four pixels around the coordinate exist: [`Tap::offset`] is `y * width + x` of the top-left one.
    Inside = 1,
    /// Valid, on the last column or row, so that not all four exist, or between the last column and the first of a source
    /// that begins again. The offset is that of [`framed`].
    Rim = 2,
    /// Not valid, but less than one pixel outside the rectangle of pixel centres; where the image goes on beyond its edges
    /// ([`BorderMode`](super::BorderMode)) all that is not valid, sampling where the image has the same. The offset is that of
    /// [`framed`].
    Halo = 3,
}

impl SpanKind {
    /// Whether such cells are in the mask.
    #[inline]
    pub(crate) fn is_valid(self) -> bool {
        matches!(self, Self::Inside | Self::Rim)
    }

    /// Undoes `kind as u8`.
    pub(crate) fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Outside,
            1 => Self::Inside,
            2 => Self::Rim,
            _ => Self::Halo,
        }
    }
}

/// Where one cell samples: the top-left of the four pixels around its coordinate, and how far beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(8))] // one number to the kernels
pub(crate) struct Tap {
    /// Where the top-left pixel is; whether it is counted with a frame around the source, the span's kind says.
    pub(crate) offset: u32,
    /// Q15 fraction along x, and [`STEP`].
    pub(crate) x: u16,
    /// Q15 fraction along y, and [`STEP`].
    pub(crate) y: u16,
}

impl Tap {
    /// A tap from its bytes in a file: offset, x and y, each the lowest byte first.
    #[inline(always)]
    pub(crate) fn from_le_bytes(bytes: [u8; 8]) -> Self {
        if cfg!(target_endian = "little") {
            return bytemuck::must_cast(u64::from_le_bytes(bytes)); // the bytes as they are
        }
        let word = u64::from_le_bytes(bytes);
        Self { offset: word as u32, x: (word >> 32) as u16, y: (word >> 48) as u16 }
    }

    /// Q15 fraction along x, below [`ONE`].
    #[inline]
    pub(crate) fn fx(self) -> u32 {
        u32::from(self.x & !STEP)
    }

    /// Q15 fraction along y, below [`ONE`].
    #[inline]
    pub(crate) fn fy(self) -> u32 {
        u32::from(self.y & !STEP)
    }

    /// A packed fraction, with the nearest pixel the next one or not.
    pub(crate) fn with_step(fraction: u16, step: bool) -> u16 {
        if step { fraction | STEP } else { fraction & !STEP }
    }

    /// Columns from the top-left pixel to the nearest: 0 or 1.
    #[inline]
    pub(crate) fn step_x(self) -> u32 {
        u32::from(self.x >> 15)
    }

    /// Rows from the top-left pixel to the nearest: 0 or 1.
    #[inline]
    pub(crate) fn step_y(self) -> u32 {
        u32::from(self.y >> 15)
    }
}

/// Offset of pixel (x, y) in the source with a frame of one pixel around it: x from -1 to width, y likewise.
pub(crate) fn framed(x: i64, y: i64, width: u32) -> u32 {
    ((y + 1) * (i64::from(width) + 2) + x + 1) as u32
}

/// (x, y) of an offset made by [`framed`].
#[inline]
pub(crate) fn unframed(offset: u32, width: u32) -> (i64, i64) {
    // in 32 bits, which take half the time of a division in 64: the framed source has no more pixels than that
    let stride = width + 2;
    (i64::from(offset % stride) - 1, i64::from(offset / stride) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framed_offsets_undo() {
        for y in -1..=4 {
            for x in -1..=5 {
                assert_eq!(unframed(framed(x, y, 5), 5), (x, y));
            }
        }
    }
}
