//! Levels of area: averages over boxes of pixels of 8 bits, in one go from the source's rows and in registers.

use std::arch::x86_64::*;

/// Writes a row of boxes of `2^kx` pixels of 1 to 4 bytes that overlap by half, from 1, 2 or 4 `rows` of the source that hold
/// their pixels and no more, or from one in which its rows are averaged already; they are `2^ky` rows of the source. False,
/// and nothing written, for other widths than 4, 8 and 16 pixels and for fewer boxes than a vector has.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn boxes_u8<const CHANNELS: usize>([kx, ky]: [u32; 2], rows: &[&[u8]], out: &mut [u8]) -> bool {
    // pairs of columns are halved until two of them make a box; the last step overlaps
    match kx {
        2 => boxes_of_width::<CHANNELS, 1>(ky, rows, out),
        3 => boxes_of_width::<CHANNELS, 2>(ky, rows, out),
        4 => boxes_of_width::<CHANNELS, 3>(ky, rows, out),
        _ => false,
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn boxes_of_width<const CHANNELS: usize, const HALVINGS: usize>(ky: u32, rows: &[&[u8]], out: &mut [u8]) -> bool {
    match *rows {
        [row] if ky.is_multiple_of(2) => boxes::<CHANNELS, HALVINGS, 1, false>([row], out),
        [row] => boxes::<CHANNELS, HALVINGS, 1, true>([row], out),
        [a, b] => boxes::<CHANNELS, HALVINGS, 2, true>([a, b], out),
        [a, b, c, d] => boxes::<CHANNELS, HALVINGS, 4, false>([a, b, c, d], out),
        _ => false,
    }
}

/// Boxes of `2 << HALVINGS` pixels from 1, 2 or 4 rows; `ODD` is whether columns were averaged an odd number of times,
/// here or before.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn boxes<const CHANNELS: usize, const HALVINGS: usize, const ROWS: usize, const ODD: bool>(
    rows: [&[u8]; ROWS],
    out: &mut [u8],
) -> bool {
    /// Vectors of pixels for one of boxes, at most.
    const MOST: usize = 8;
    // the last pixel of a vector is the neighbour of the last box
    let pixels = 64 / CHANNELS;
    let boxes = pixels - 1;
    let count = out.len() / CHANNELS;
    if count < boxes {
        return false;
    }
    let (vectors, bytes) = (1 << HALVINGS, pixels * CHANNELS);
    assert!(vectors <= MOST && rows.iter().all(|row| row.len() >= (count + 1) * CHANNELS * vectors));
    let [left, right] = const { [pair_order::<CHANNELS>(0), pair_order::<CHANNELS>(1)] };
    let next = const { pair_order_next::<CHANNELS>() };
    // SAFETY: the arrays are 64 bytes.
    let [left, right, next] = [left, right, next].map(|order| unsafe { _mm512_loadu_si512(order.as_ptr().cast()) });
    let whole = u64::MAX >> (64 - bytes);
    let mut first = 0;
    while first < count {
        // the last ones reach back to be a whole vector
        first = first.min(count - boxes);
        let mut tiles = [_mm512_setzero_si512(); MOST];
        for (index, tile) in tiles.iter_mut().enumerate().take(vectors) {
            let at = first * CHANNELS * vectors + index * bytes;
            // SAFETY: `first + pixels <= count + 1`, so that `bytes` bytes exist from here on in each row, as
            // asserted; no more are loaded.
            let row = |row: usize| unsafe { _mm512_maskz_loadu_epi8(whole, rows[row].as_ptr().add(at).cast()) };
            *tile = match ROWS {
                1 => row(0),
                2 => halfway(true, row(0), row(1)),
                _ => halfway(false, halfway(true, row(0), row(1)), halfway(true, row(2), row(3))),
            };
        }
        for k in 0..HALVINGS {
            for index in 0..vectors >> (k + 1) {
                let (low, high) = (tiles[2 * index], tiles[2 * index + 1]);
                let [a, b] = [left, right].map(|order| _mm512_permutex2var_epi8(low, order, high));
                tiles[index] = halfway((k % 2 == 1) == ODD, a, b);
            }
        }
        let neighbours = _mm512_permutexvar_epi8(next, tiles[0]);
        let averages = halfway((HALVINGS % 2 == 1) == ODD, tiles[0], neighbours);
        let to = &mut out[first * CHANNELS..];
        match to.first_chunk_mut::<64>() {
            // the bytes that are too many are written over by those that come next, which there are
            // SAFETY: the array is 64 bytes.
            Some(to) => unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), averages) },
            None => {
                let mask = u64::MAX >> (64 - boxes * CHANNELS);
                assert!(to.len() >= boxes * CHANNELS);
                // SAFETY: nothing is stored without its bit, and so many bytes exist.
                unsafe { _mm512_mask_storeu_epi8(to.as_mut_ptr().cast(), mask, averages) }
            }
        }
        first += boxes;
    }
    true
}

/// Averages that are rounded up or down; halfway down is halfway up of what is left to 255.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn halfway(up: bool, a: __m512i, b: __m512i) -> __m512i {
    if up {
        return _mm512_avg_epu8(a, b);
    }
    let flip = |bytes| _mm512_xor_si512(bytes, _mm512_set1_epi8(-1));
    flip(_mm512_avg_epu8(flip(a), flip(b)))
}

/// Where the left (0) or right (1) pixel of each pair is among those of two vectors of as many whole pixels as they
/// hold.
const fn pair_order<const CHANNELS: usize>(side: usize) -> [u8; 64] {
    let pixels = 64 / CHANNELS;
    let mut order = [0; 64];
    let mut byte = 0;
    while byte < pixels * CHANNELS {
        let pixel = 2 * (byte / CHANNELS) + side;
        order[byte] = (64 * (pixel / pixels) + pixel % pixels * CHANNELS + byte % CHANNELS) as u8;
        byte += 1;
    }
    order
}

/// Where the next pixel is.
const fn pair_order_next<const CHANNELS: usize>() -> [u8; 64] {
    let mut order = [0; 64];
    let mut byte = 0;
    while byte + CHANNELS < 64 {
        order[byte] = (byte + CHANNELS) as u8;
        byte += 1;
    }
    order
}
