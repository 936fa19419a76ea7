//! Levels of area: averages over boxes of pixels of 8 bits.
//!
//! A row of boxes is made tile by tile, in the first cache. `vpavgb` averages every pixel with the one a quarter, then half
//! a box further: plain loads at two places, no shuffles. Only the last step picks, by `pshufb`, the boxes that overlap by
//! half. Shuffling pairs apart at every step, from memory to memory, took twice as many instructions (20 cm cells).

use std::arch::x86_64::*;

/// Bytes of a tile.
const TILE: usize = 3072;

/// So many bytes more are read behind a tile, and do not count: the furthest neighbour is 32 away, and 32 are loaded.
const BEHIND: usize = 64;

/// Aligned to the lines of the cache, so that no vector that is stored lies on two of them.
#[repr(align(64))]
struct Tile([u8; TILE + BEHIND]);

/// Writes a row of boxes of `2^kx` pixels of 1 to 4 bytes that overlap by half, from 1, 2 or 4 `rows` of the source that hold
/// their pixels and no more, or from one in which its rows are averaged already; they are `2^ky` rows of the source. False,
/// and nothing written, for other widths than 2, 4, 8 and 16 pixels.
///
/// # Safety
/// The CPU has AVX2.
#[target_feature(enable = "avx2")]
pub(in crate::kernels) fn boxes_u8<const CHANNELS: usize>([kx, ky]: [u32; 2], rows: &[&[u8]], out: &mut [u8]) -> bool {
    match kx {
        1 => boxes_of_width::<CHANNELS, 1>(ky, rows, out),
        2 => boxes_of_width::<CHANNELS, 2>(ky, rows, out),
        3 => boxes_of_width::<CHANNELS, 3>(ky, rows, out),
        4 => boxes_of_width::<CHANNELS, 4>(ky, rows, out),
        _ => false,
    }
}

#[target_feature(enable = "avx2")]
fn boxes_of_width<const CHANNELS: usize, const KX: usize>(ky: u32, rows: &[&[u8]], out: &mut [u8]) -> bool {
    match *rows {
        [row] if ky.is_multiple_of(2) => boxes::<CHANNELS, KX, 1, false>([row], out),
        [row] => boxes::<CHANNELS, KX, 1, true>([row], out),
        [a, b] => boxes::<CHANNELS, KX, 2, true>([a, b], out),
        [a, b, c, d] => boxes::<CHANNELS, KX, 4, false>([a, b, c, d], out),
        _ => return false,
    }
    true
}

/// `ODD` is whether rows are averaged an odd number of times, here or before: steps round up and down in turns.
#[target_feature(enable = "avx2")]
fn boxes<const CHANNELS: usize, const KX: usize, const ROWS: usize, const ODD: bool>(
    rows: [&[u8]; ROWS],
    out: &mut [u8],
) {
    let step = const { CHANNELS << (KX - 1) };
    let count = out.len() / CHANNELS;
    assert!(rows.iter().all(|row| row.len() >= (count + 1) * step));
    // of boxes of two pixels the first step is the last
    if KX == 1 {
        return average_neighbours::<CHANNELS, ROWS, ODD>(rows, out);
    }
    let mut tile = Tile([0; TILE + BEHIND]);
    // a box reaches over two steps
    let most = TILE / step - 1;
    for (index, out) in out.chunks_mut(most * CHANNELS).enumerate() {
        let (first, bytes) = (index * most * step, (out.len() / CHANNELS + 1) * step);
        let rows = rows.map(|row| &row[first..first + bytes]);
        let done = if ROWS == 1 && KX > 2 {
            average_fours::<CHANNELS, ODD>(rows[0], &mut tile.0[..bytes - 3 * CHANNELS]);
            2
        } else {
            average_neighbours::<CHANNELS, ROWS, ODD>(rows, &mut tile.0[..bytes - CHANNELS]);
            1
        };
        for k in done..KX - 1 {
            average_in_place(k.is_multiple_of(2) != ODD, CHANNELS << k, bytes, &mut tile);
        }
        average_at_steps::<CHANNELS, KX>((KX - 1).is_multiple_of(2) != ODD, &tile.0, out);
    }
}

/// Averages that are rounded up or down; halfway down is halfway up of what is left to 255.
#[inline]
#[target_feature(enable = "avx2")]
fn halfway(up: bool, a: __m256i, b: __m256i) -> __m256i {
    if up {
        return _mm256_avg_epu8(a, b);
    }
    let flip = |bytes| _mm256_xor_si256(bytes, _mm256_set1_epi8(-1));
    flip(_mm256_avg_epu8(flip(a), flip(b)))
}

fn halfway_of_two(up: bool, a: u8, b: u8) -> u8 {
    ((u16::from(a) + u16::from(b) + u16::from(up)) / 2) as u8
}

/// Writes 32 bytes at every multiple of 32; the last ones reach back to be whole. False, and nothing written, for fewer.
#[inline]
#[target_feature(enable = "avx2")]
fn fill(out: &mut [u8], bytes_at: impl Fn(usize) -> __m256i) -> bool {
    let Some(last) = out.len().checked_sub(32) else { return false };
    let to = out.as_mut_ptr();
    // SAFETY: `at` is at most `last`, so 32 bytes of `out` are left.
    let store = |at: usize| unsafe { _mm256_storeu_si256(to.add(at).cast(), bytes_at(at)) };
    let mut at = 0;
    while at + 32 <= last {
        store(at);
        store(at + 32);
        at += 64;
    }
    if at < last {
        store(at);
    }
    store(last);
    true
}

/// Every byte's average over the rows, averaged with that of the next pixel; rows are a pixel longer than `out`.
#[inline]
#[target_feature(enable = "avx2")]
fn average_neighbours<const CHANNELS: usize, const ROWS: usize, const ODD: bool>(rows: [&[u8]; ROWS], out: &mut [u8]) {
    let count = out.len();
    let rows = rows.map(|row| &row[..count + CHANNELS]);
    let vectors = |at: usize| {
        let column = |at: usize| {
            // SAFETY: `at + 32` is at most `count + CHANNELS`, the length of a row.
            let row = |row: usize| unsafe { _mm256_loadu_si256(rows[row].as_ptr().add(at).cast()) };
            match ROWS {
                1 => row(0),
                2 => halfway(true, row(0), row(1)),
                _ => halfway(false, halfway(true, row(0), row(1)), halfway(true, row(2), row(3))),
            }
        };
        halfway(!ODD, column(at), column(at + CHANNELS))
    };
    if fill(out, vectors) {
        return;
    }
    let column = |at: usize| match ROWS {
        1 => rows[0][at],
        2 => halfway_of_two(true, rows[0][at], rows[1][at]),
        _ => {
            let [upper, lower] = [0, 2].map(|row| halfway_of_two(true, rows[row][at], rows[row + 1][at]));
            halfway_of_two(false, upper, lower)
        }
    };
    for (at, byte) in out.iter_mut().enumerate() {
        *byte = halfway_of_two(!ODD, column(at), column(at + CHANNELS));
    }
}

/// The first two steps of one row at once: every byte's average over four pixels; the row is three pixels longer than `out`.
#[inline]
#[target_feature(enable = "avx2")]
fn average_fours<const CHANNELS: usize, const ODD: bool>(row: &[u8], out: &mut [u8]) {
    let row = &row[..out.len() + 3 * CHANNELS];
    let vectors = |at: usize| {
        // SAFETY: `at + 32` is at most the length of `row`: `fill` keeps to `out`, and three pixels are behind it.
        let pixels = |at: usize| unsafe { _mm256_loadu_si256(row.as_ptr().add(at).cast()) };
        let two = |at: usize| halfway(!ODD, pixels(at), pixels(at + CHANNELS));
        halfway(ODD, two(at), two(at + 2 * CHANNELS))
    };
    if fill(out, vectors) {
        return;
    }
    let two = |at: usize| halfway_of_two(!ODD, row[at], row[at + CHANNELS]);
    for (at, byte) in out.iter_mut().enumerate() {
        *byte = halfway_of_two(ODD, two(at), two(at + 2 * CHANNELS));
    }
}

/// Every byte's average with the one so far behind it. What lies behind the first `bytes` are numbers that nobody reads.
#[inline]
#[target_feature(enable = "avx2")]
fn average_in_place(up: bool, distance: usize, bytes: usize, tile: &mut Tile) {
    assert!(bytes <= TILE && distance <= BEHIND - 32);
    for at in (0..bytes).step_by(32) {
        // SAFETY: 32 bytes from `at + distance`, less than `TILE + BEHIND - 32`, are inside the tile; what is written is
        // read only by the steps before.
        unsafe {
            let to = tile.0.as_mut_ptr().add(at);
            let (own, other) = (_mm256_loadu_si256(to.cast()), _mm256_loadu_si256(to.add(distance).cast()));
            _mm256_storeu_si256(to.cast(), halfway(up, own, other));
        }
    }
}

/// Averages of pixels that lie half a box apart, from one half box to the next.
#[inline]
#[target_feature(enable = "avx2")]
fn average_at_steps<const CHANNELS: usize, const KX: usize>(up: bool, pixels: &[u8], out: &mut [u8]) {
    let step = const { CHANNELS << (KX - 1) };
    // boxes of which 16 bytes hold the first pixels
    let together = const { (16 - CHANNELS) / (CHANNELS << (KX - 1)) + 1 };
    let order = const { order::<CHANNELS>(CHANNELS << (KX - 1)) };
    // SAFETY: the array is 16 bytes.
    let order = _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(order.as_ptr().cast()) });
    let (from_step, to_step) = (together * step, together * CHANNELS);
    let (mut from, mut to) = (0, 0);
    // two windows at a time; bytes that are too many are written over by those that come next
    while to + to_step + 16 <= out.len() && from + from_step + step + 16 <= pixels.len() {
        let load = |at: usize| {
            // SAFETY: `at` is at most `from + step`, and `from + step + from_step + 16` bytes exist.
            unsafe { super::load_halves(pixels.as_ptr().add(at).cast(), pixels.as_ptr().add(at + from_step).cast()) }
        };
        let pixels = _mm256_shuffle_epi8(halfway(up, load(from), load(from + step)), order);
        // SAFETY: `to + to_step + 16` bytes exist.
        unsafe {
            _mm_storeu_si128(out.as_mut_ptr().add(to).cast(), _mm256_castsi256_si128(pixels));
            _mm_storeu_si128(out.as_mut_ptr().add(to + to_step).cast(), _mm256_extracti128_si256::<1>(pixels));
        }
        (from, to) = (from + 2 * from_step, to + 2 * to_step);
    }
    for (index, pixel) in out[to..].chunks_exact_mut(CHANNELS).enumerate() {
        for (channel, byte) in pixel.iter_mut().enumerate() {
            let at = from + index * step + channel;
            *byte = halfway_of_two(up, pixels[at], pixels[at + step]);
        }
    }
}

/// Where pixels that are so many bytes apart are among 16 bytes, as far as these hold them.
const fn order<const CHANNELS: usize>(step: usize) -> [u8; 16] {
    let mut order = [0x80; 16];
    let mut byte = 0;
    while byte < ((16 - CHANNELS) / step + 1) * CHANNELS {
        order[byte] = (byte / CHANNELS * step + byte % CHANNELS) as u8;
        byte += 1;
    }
    order
}
