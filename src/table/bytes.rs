//! A table as bytes and back, for pickles and files. Little-endian:
//! magic (8), XXH3-64 of what follows (8), rows, columns, width, height, spans, taps (`u32` each), then how many spans each
//! row has (`u32`), all spans (`u16`), zeros up to a multiple of eight, and the taps of all cells but those outside
//! (offset `u32`, x `u16`, y `u16`). Where the image does not end at its edges, another magic, and a word more behind the
//! six numbers: the border mode's place in [`BorderMode::ALL`], 1 if the first column follows the last, and zeros.
//!
//! A table is read front to back, a span's taps at a time, so that of a file no more than a piece is ever in memory: the
//! pages of a buffer for 4.7 MB (860 x 800 cells) and its trips to memory cost as much as the proof.

use std::io::BufRead;
use std::mem::MaybeUninit;

use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use super::bounds::Bounds;
use super::{BorderMode, Edges, PackedSpan, RowEnd, RowSpans, SpanKind, Table, Tap, band_rows};
use crate::error::{Error, Result, TableError};
use crate::isa::Isa;
use crate::parallel::check_interrupt;
use crate::view::{are_too_many, buffer, check_image_size};

const MAGIC: &[u8; 8] = b"ipm_rs\x00\x03";

/// What tables begin with that say what their source has beyond its pixels.
const MAGIC_WITH_EDGES: &[u8; 8] = b"ipm_rs\x00\x04";

/// Bytes before the spans of rows: magic, checksum and six numbers; a multiple of eight, as is the word of edges.
const HEADER: usize = 40;

impl Table {
    /// The table as bytes, the same on every machine.
    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>> {
        let Self { columns, source, bands, edges, .. } = self;
        let seeing = || (0..self.rows()).flat_map(|row| self.row(row)).filter(|s| s.kind != SpanKind::Outside);
        let spans: usize = bands.iter().map(|band| band.spans.len()).sum();
        let taps: usize = seeing().map(|span| span.taps.len()).sum();
        let mut bytes = buffer::reserved("Lut", self.nbytes() + 64)?;
        let plain = *edges == Edges::default();
        bytes.extend_from_slice(if plain { MAGIC } else { MAGIC_WITH_EDGES });
        bytes.extend_from_slice(&[0; 8]);
        for number in [self.rows() as u32, *columns as u32, source.0, source.1, spans as u32, taps as u32] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        if !plain {
            let mode = BorderMode::ALL.iter().position(|mode| *mode == edges.mode).unwrap_or_default();
            bytes.extend_from_slice(&[mode as u8, edges.wraps.into(), 0, 0, 0, 0, 0, 0]);
        }
        for band in bands {
            let begins = std::iter::once(0).chain(band.ends.iter().map(|end| end.span));
            for (begin, end) in begins.zip(&band.ends) {
                bytes.extend_from_slice(&(end.span - begin).to_le_bytes());
            }
        }
        for span in bands.iter().flat_map(|band| &band.spans) {
            bytes.extend_from_slice(&span.0.to_le_bytes());
        }
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        for row in 0..self.rows() {
            check_interrupt()?;
            let seeing = self.row(row).filter(|span| span.kind != SpanKind::Outside);
            for tap in seeing.flat_map(|span| span.taps) {
                bytes.extend_from_slice(&tap.offset.to_le_bytes());
                bytes.extend_from_slice(&tap.x.to_le_bytes());
                bytes.extend_from_slice(&tap.y.to_le_bytes());
            }
        }
        let sum = checksum(&bytes[16..]);
        bytes[8..16].copy_from_slice(&sum.to_le_bytes());
        Ok(bytes)
    }

    /// A table from [`Table::to_bytes`], of the next `length` bytes of `input`. Every bound that the kernels rely on is
    /// proved again, so that no bytes, however damaged or forged, make a warp read outside an image.
    pub(crate) fn read(input: impl BufRead, length: u64) -> Result<Self> {
        let mut bytes = Bytes::new(input);
        let plain = match bytes.take(8)? {
            magic if magic == MAGIC => true,
            magic if magic == MAGIC_WITH_EDGES => false,
            _ => return Err(damaged("no table of this version begins so")),
        };
        let sum = u64::from_le_bytes(bytes.array()?);
        bytes.begin_sum();
        let numbers: [u8; 24] = bytes.array()?;
        let number = |index: usize| le_u32(&numbers[4 * index..]);
        let edges = if plain { Edges::default() } else { read_edges(bytes.array()?)? };
        let (rows, columns) = (number(0) as usize, number(1) as usize);
        let source = check_image_size("source_size", number(2).into(), number(3).into())
            .map_err(|_| damaged("its source size is impossible"))?;
        let (spans, taps) = (u64::from(number(4)), u64::from(number(5)));
        if rows == 0 || columns == 0 || are_too_many(rows as f64, columns as f64) {
            return Err(damaged("its shape is impossible"));
        }
        // u64: none of these can overflow, and nothing is allocated before the length is known to be right
        let before_padding = HEADER as u64 + if plain { 0 } else { 8 } + 4 * rows as u64 + 2 * spans;
        let padding = before_padding.next_multiple_of(8) - before_padding;
        if length != before_padding + padding + 8 * taps {
            return Err(damaged("its length does not fit its header"));
        }
        let counts = buffer::copied("Lut", bytes.take(4 * rows)?)?;
        let all_spans = buffer::copied("Lut", bytes.take((2 * spans) as usize)?)?;
        if bytes.take(padding as usize)?.iter().any(|byte| *byte != 0) {
            return Err(damaged("there is something between its spans and its taps"));
        }
        let mut table = Table::empty((rows, columns), source, edges)?;
        let mut reader = Reader {
            spans: &all_spans,
            taps_left: taps,
            taps: bytes,
            bounds: Bounds::new(source, edges, Isa::active()?),
        };
        for ((band, taps), counts) in table.bands_mut().zip(counts.chunks(4 * band_rows(columns))) {
            let mut next = 0;
            for spans in counts.chunks_exact(4).map(le_u32) {
                check_interrupt()?;
                next += reader.read_row(spans as usize, columns, &mut taps[next..], band)?;
                let end = RowEnd { span: band.spans.len() as u32, tap: next as u32 };
                buffer::push("Lut", &mut band.ends, end)?;
            }
        }
        if !reader.spans.is_empty() || reader.taps_left > 0 {
            return Err(damaged("its rows do not fit its header"));
        }
        if reader.taps.sum()? != sum {
            return Err(damaged("its checksum does not fit"));
        }
        Ok(table)
    }
}

/// What the source has beyond its pixels.
fn read_edges(word: [u8; 8]) -> Result<Edges> {
    let wrong = damaged("what lies beyond its image is unknown");
    let [mode, wraps @ (0 | 1), 0, 0, 0, 0, 0, 0] = word else { return Err(wrong) };
    match BorderMode::ALL.get(usize::from(mode)) {
        Some(&mode) if mode != BorderMode::Transparent => Ok(Edges { mode, wraps: wraps == 1 }),
        _ => Err(wrong),
    }
}

fn damaged(problem: &'static str) -> Error {
    Error::Table(TableError::Damaged { problem })
}

/// Bytes front to back, and the checksum of those from a place on.
struct Bytes<R> {
    input: R,
    /// Bytes of the input's buffer that were handed out, and are done with when more are asked for than it has.
    used: usize,
    /// Where in the input's buffer those begin that are not summed yet: sums of a row's few thousand bytes at a time cost
    /// half as much again.
    summed: usize,
    /// What the input's buffer did not have in one piece.
    joined: Vec<u8>,
    sum: Option<Box<Xxh3>>,
}

impl<R: BufRead> Bytes<R> {
    fn new(input: R) -> Self {
        Self { input, used: 0, summed: 0, joined: Vec::new(), sum: None }
    }

    /// Sums what is taken from here on.
    fn begin_sum(&mut self) {
        self.summed = self.used;
        self.sum = Some(Box::default());
    }

    /// The sum of what was taken.
    fn sum(&mut self) -> Result<u64> {
        self.consume()?;
        Ok(self.sum.as_ref().map_or(0, |sum| sum.digest()))
    }

    /// Sums what was handed out of the input's buffer, and lets go of it.
    fn consume(&mut self) -> Result<()> {
        if self.used > 0 {
            let buffer = filled(&mut self.input)?;
            if let Some(sum) = &mut self.sum {
                sum.update(&buffer[self.summed..self.used]);
            }
            self.input.consume(self.used);
            (self.used, self.summed) = (0, 0);
        }
        Ok(())
    }

    /// The next bytes. Memory is asked for as they come, not for what is promised.
    fn take(&mut self, count: usize) -> Result<&[u8]> {
        if filled(&mut self.input)?.len() - self.used >= count {
            let begin = self.used;
            self.used += count;
            return Ok(&filled(&mut self.input)?[begin..self.used]);
        }
        self.joined.clear();
        while self.joined.len() < count {
            let there = &filled(&mut self.input)?[self.used..];
            let part = &there[..there.len().min(count - self.joined.len())];
            buffer::room_for("Lut", &mut self.joined, part.len())?;
            self.joined.extend_from_slice(part);
            self.used += part.len();
            let at_end = part.is_empty() && self.used == 0;
            if at_end {
                return Err(damaged("it is cut short"));
            }
            if self.joined.len() < count {
                self.consume()?;
            }
        }
        Ok(&self.joined)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        self.take(N).map(|bytes| std::array::from_fn(|index| bytes[index]))
    }
}

/// What the input has ready, nothing at its end.
fn filled(input: &mut impl BufRead) -> Result<&[u8]> {
    input.fill_buf().map_err(|error| Error::Table(TableError::Unreadable { problem: error.to_string() }))
}

/// What is left of a table's spans and taps.
struct Reader<'a, R> {
    spans: &'a [u8],
    taps_left: u64,
    taps: Bytes<R>,
    bounds: Bounds,
}

impl<R: BufRead> Reader<'_, R> {
    /// Takes the next row of so many spans, proves what [`Table`] promises of it, and returns how many taps it has; they go
    /// to the start of `taps`, which has room for one for each cell.
    fn read_row(
        &mut self,
        spans: usize,
        columns: usize,
        taps: &mut [MaybeUninit<Tap>],
        band: &mut RowSpans,
    ) -> Result<usize> {
        let short = || damaged("its rows do not fit its header");
        let (mut cells, mut kept) = (0, 0);
        for span in take(&mut self.spans, spans.saturating_mul(2)).ok_or_else(short)?.chunks_exact(2) {
            let span = PackedSpan(u16::from_le_bytes([span[0], span[1]]));
            cells += span.cells();
            if cells > columns {
                break;
            }
            // what lies behind the table is not its own
            self.taps_left = self.taps_left.checked_sub(span.taps() as u64).ok_or_else(short)?;
            let bytes = self.taps.take(8 * span.taps())?;
            if !self.bounds.allow(span.kind(), &mut taps[kept..][..span.taps()], bytes) {
                return Err(damaged("a cell samples where its kind cannot"));
            }
            kept += span.taps();
            buffer::push("Lut", &mut band.spans, span)?;
        }
        if cells == columns { Ok(kept) } else { Err(damaged("a row's spans do not cover it")) }
    }
}

/// Takes the first bytes off a slice.
fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (first, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(first)
}

/// XXH3-64, which pickles and files of tables are checked with: against damage. Against forgery, every tap is proved.
pub fn checksum(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

fn le_u32(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lut;

    /// Of bits and lengths: all, or as many as Miri gets through in minutes.
    const STEP: usize = if cfg!(miri) { 251 } else { 1 };

    fn lut() -> Lut {
        let x: Vec<f32> = (0..60).map(|i| i as f32 * 0.21 - 2.0).collect();
        let y: Vec<f32> = (0..60).map(|i| (i / 10) as f32 * 1.1 - 1.2).collect();
        Lut::from_maps(&x, &y, 10, (7, 4)).unwrap()
    }

    /// The same, of a source that begins again and is mirrored above and below.
    fn without_edges() -> Lut {
        let x: Vec<f32> = (0..60).map(|i| i as f32 * 0.21 - 2.0).collect();
        let y: Vec<f32> = (0..60).map(|i| (i / 10) as f32 * 1.1 - 1.2).collect();
        Lut::from_maps_with(&x, &y, 10, (7, 4), BorderMode::Reflect, true).unwrap()
    }

    #[test]
    fn there_and_back() {
        for lut in [lut(), without_edges()] {
            assert_eq!(Lut::from_bytes(&lut.to_bytes().unwrap()).unwrap(), lut);
        }
        assert_ne!(without_edges(), lut());
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_refused() {
        for bytes in [lut(), without_edges()].map(|lut| lut.to_bytes().unwrap()) {
            for bit in (0..bytes.len() * 8).step_by(STEP) {
                let mut damaged = bytes.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                let got = Lut::from_bytes(&damaged);
                assert!(matches!(got, Err(Error::Table(TableError::Damaged { .. }))), "bit {bit}");
            }
            for length in (0..bytes.len()).step_by(STEP) {
                assert!(Lut::from_bytes(&bytes[..length]).is_err());
            }
        }
    }

    #[test]
    fn forged_bytes_with_a_right_checksum_are_refused_or_harmless() {
        forge(&lut());
        forge(&without_edges());
    }

    fn forge(lut: &Lut) {
        let bytes = lut.to_bytes().unwrap();
        let image = vec![7u8; 7 * 4];
        let view = crate::ImageView::new(&image, (7, 4), 1).unwrap();
        let (mut refused, mut harmless) = (0, 0);
        for bit in (16 * 8..bytes.len() * 8).step_by(STEP) {
            let mut forged = bytes.clone();
            forged[bit / 8] ^= 1 << (bit % 8);
            let sum = checksum(&forged[16..]);
            forged[8..16].copy_from_slice(&sum.to_le_bytes());
            match Lut::from_bytes(&forged) {
                Ok(other) => {
                    // another table, but one that keeps its promises
                    let size_as_built = other.source_size() == (7, 4);
                    let bev = other.warp(&view, &crate::WarpOptions::default());
                    assert_eq!(bev.is_ok(), size_as_built);
                    harmless += 1;
                }
                Err(error) => {
                    assert!(matches!(error, Error::Table(TableError::Damaged { .. })), "{error}");
                    refused += 1;
                }
            }
        }
        assert!(refused > 500 / STEP && harmless > 100 / STEP, "{refused} {harmless}");
    }
}
