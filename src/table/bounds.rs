//! Where the taps of a table may sample, proved of every tap that comes from a file.

use std::mem::MaybeUninit;

use super::{Edges, SpanKind, Tap, unframed};
use crate::isa::{self, Body, Isa};

/// Where the taps of each kind of span may be.
pub(super) struct Bounds {
    width: u32,
    wraps: bool,
    last_x: i64,
    last_y: i64,
    isa: Isa,
}

impl Bounds {
    pub(super) fn new((width, height): (u32, u32), edges: Edges, isa: Isa) -> Self {
        Self { width, wraps: edges.wraps, last_x: i64::from(width) - 1, last_y: i64::from(height) - 1, isa }
    }

    /// Writes the taps of a span, and says whether all are where its kind may sample.
    pub(super) fn allow(&self, kind: SpanKind, taps: &mut [MaybeUninit<Tap>], bytes: &[u8]) -> bool {
        let words = bytes.as_chunks::<8>().0;
        match kind {
            SpanKind::Outside => taps.is_empty(),
            SpanKind::Inside => {
                isa::run(self.isa, Inside { taps, words, width: self.width, last_y: self.last_y as u32 })
            }
            SpanKind::Rim | SpanKind::Halo => {
                let read = taps.iter_mut().zip(words).map(|(slot, bytes)| *slot.write(Tap::from_le_bytes(*bytes)));
                read.fold(true, |all, tap| all & self.allow_at_edge(kind, tap))
            }
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

/// Writes taps, and says whether all are left of the last column and above the last row.
struct Inside<'a> {
    taps: &'a mut [MaybeUninit<Tap>],
    words: &'a [[u8; 8]],
    width: u32,
    last_y: u32,
}

impl Body for Inside<'_> {
    type Output = bool;

    /// Without a division or a branch: a row is estimated by a product of 32 bits and is right or one too small, so that
    /// what is left is the column or a width more.
    #[inline(always)]
    fn run(self) -> bool {
        let width = u64::from(self.width);
        // of one column no tap is inside, and 2^32 / 1 does not fit
        let per_offset = u64::from(((1 << 32) / width.max(2)) as u32);
        let last = (u64::from(self.last_y) * width).wrapping_sub(1);
        let (mut behind, mut at_edge) = (0, 0);
        for (slot, word) in self.taps.iter_mut().zip(self.words) {
            let tap = slot.write(Tap::from_le_bytes(*word));
            let offset = u64::from(tap.offset);
            let row = (offset * per_offset) >> 32;
            let next_column = offset.wrapping_sub(row * width) + 1;
            at_edge |= u64::from(next_column == width) | u64::from(next_column == 2 * width);
            behind |= last.wrapping_sub(offset); // its sign
        }
        (at_edge == 0 && behind >> 63 == 0 && width > 1) || self.words.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Offsets that lie anywhere, of each source: Miri, which has one instruction set, is not to take minutes.
    const ANYWHERE: u32 = if cfg!(miri) { 10 } else { 500 };

    #[test]
    fn taps_inside_are_those_that_have_all_four_pixels() {
        let offsets = |width: u32, height: u32| {
            let many = (0..ANYWHERE).map(|i: u32| i.wrapping_mul(2_654_435_761));
            let corners = [0, 1, 2, height / 2, height - 1, height].map(|row| row.wrapping_mul(width));
            let near = corners.into_iter().flat_map(|at| (0..5).map(move |i: u32| at.wrapping_add(i).wrapping_sub(3)));
            many.chain(near).chain([u32::MAX])
        };
        let sizes = [(1, 1), (1, 9), (2, 1), (2, 2), (3, 2), (7, 5), (640, 480), (2048, 1024), (65_535, 65_535)];
        for (width, height) in sizes.into_iter().chain([(65_537, 60_000), (1 << 30, 1), (1_431_655_763, 1)]) {
            for &isa in Isa::available() {
                let bounds = Bounds::new((width, height), Edges::default(), isa);
                for offset in offsets(width, height) {
                    let inside = offset % width + 1 < width && offset / width + 1 < height;
                    // alone, and among others
                    for count in [1, 2, 9] {
                        let mut bytes = vec![0; 8 * count];
                        bytes[8 * (count / 2)..][..4].copy_from_slice(&offset.to_le_bytes());
                        bytes[8 * (count / 2) + 4..][..4].fill(255);
                        let mut taps = vec![MaybeUninit::uninit(); count];
                        let got = bounds.allow(SpanKind::Inside, &mut taps, &bytes);
                        let others = count == 1 || (width > 1 && height > 1);
                        assert_eq!(got, inside && others, "{offset} of {width} x {height}, {count}, {isa:?}");
                    }
                }
            }
        }
    }
}
