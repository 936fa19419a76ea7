//! Where the taps of a table may sample, proved of every tap that comes from a file.

use std::mem::MaybeUninit;

use super::{Edges, SpanKind, Tap, unframed};

/// Where the taps of each kind of span may be.
pub(super) struct Bounds {
    width: u32,
    wraps: bool,
    last_x: i64,
    last_y: i64,
    /// `2^64 / width` rounded up: with it, `offset % width` is two multiplications (Lemire, Kaser, Kurz: Faster remainder
    /// by direct computation, 2019; exact for 32-bit numbers).
    reciprocal: u64,
}

impl Bounds {
    pub(super) fn new((width, height): (u32, u32), edges: Edges) -> Self {
        let reciprocal = (u64::MAX / u64::from(width)).wrapping_add(1);
        Self { width, wraps: edges.wraps, last_x: i64::from(width) - 1, last_y: i64::from(height) - 1, reciprocal }
    }

    fn column(&self, offset: u32) -> u32 {
        let fraction = self.reciprocal.wrapping_mul(u64::from(offset));
        ((u128::from(fraction) * u128::from(self.width)) >> 64) as u32
    }

    /// Writes the taps of a span, and says whether all are where its kind may sample.
    pub(super) fn allow(&self, kind: SpanKind, taps: &mut [MaybeUninit<Tap>], bytes: &[u8]) -> bool {
        let read = taps.iter_mut().zip(bytes.as_chunks::<8>().0).map(|(slot, bytes)| {
            let word = u64::from_le_bytes(*bytes);
            *slot.write(Tap { offset: word as u32, x: (word >> 32) as u16, y: (word >> 48) as u16 })
        });
        match kind {
            SpanKind::Outside => read.count() == 0,
            SpanKind::Inside => {
                let end = self.last_y as u64 * u64::from(self.width);
                let inside =
                    |tap: Tap| (u64::from(tap.offset) < end) & (i64::from(self.column(tap.offset)) < self.last_x);
                read.fold(true, |all, tap| all & inside(tap))
            }
            SpanKind::Rim | SpanKind::Halo => read.fold(true, |all, tap| all & self.allow_at_edge(kind, tap)),
        }
    }

    fn allow_at_edge(&self, kind: SpanKind, tap: Tap) -> bool {
        let (x, y) = unframed(tap.offset, self.width);
        let on_rim = |at: i64, last: i64, fraction: u32| at >= 0 && (at < last || (at == last && fraction == 0));
        // the last column again, to which a place just before it is rounded, and nothing behind it
        let between_columns = self.wraps && on_rim(x, self.last_x + 1, tap.fx());
        let rim = (on_rim(x, self.last_x, tap.fx()) || between_columns) && on_rim(y, self.last_y, tap.fy());
        y <= self.last_y + 1 && (kind == SpanKind::Halo || rim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_remainders() {
        for width in [1, 2, 3, 7, 640, 2048, 4095, 65_535, 65_537, u32::MAX] {
            let bounds = Bounds::new((width, 2), Edges::default());
            let offsets = (0..2000).map(|i: u32| i.wrapping_mul(2_654_435_761));
            for offset in offsets.chain([0, width - 1, width, width.wrapping_add(1), u32::MAX - 1, u32::MAX]) {
                assert_eq!(bounds.column(offset), offset % width, "{offset} % {width}");
            }
        }
    }
}
