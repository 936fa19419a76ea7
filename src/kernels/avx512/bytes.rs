//! Bilinear of 8-bit images.
//!
//! A dot product of four unsigned weight bytes and four signed pixel bytes is one `vpdpbusd` lane. Weights are Q15, so
//! they are split into high and low bytes; pixels become `p - 128`:
//!
//! ```text
//! sum(w p) = 256 sum(hi (p - 128)) + sum(lo (p - 128)) + 128 * 32768        (the weights sum to 32768)
//! ```
//!
//! which is the exact sum of the scalar kernel. The order of the four is top left, top right, bottom right, bottom
//! left, because so the weights' bytes fall into place with two shifts.
//!
//! Pixels get into that order in one of two ways:
//!
//! * **window**: where sixteen neighbouring cells look at 64 or 128 bytes of one row (the far range), the bytes of that
//!   row and the next are loaded once and `vpermi2b` picks all taps of a channel for sixteen cells;
//! * **gather**: elsewhere 16 bytes from either row are loaded for each cell, two cells to a vector, and `vpermi2b`
//!   brings four cells together.

use std::arch::x86_64::*;

use super::{Group, Pixels, all_within, opaque, scalar_positions, window};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;

/// Bytes that a gathering load touches beyond a position.
const GATHERED: usize = 16;

/// Cells whose four pixels exist, of an image of 1 to 4 channels.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn bilinear_u8<const CHANNELS: usize>(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let plane = Plane::new(source).filter(|_| taps.len() >= 16);
    let Some(plane) = plane else { return scalar::bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, cells) };
    let reach = Reach::new(&plane);
    for group in 0..taps.len().div_ceil(16) {
        // the last group reaches back to be whole: some cells are blended twice
        let first = (16 * group).min(taps.len() - 16);
        let taps = taps[first..].first_chunk().expect("sixteen are left");
        let cells = &mut cells[first * CHANNELS..(first + 16) * CHANNELS];
        if !blend_group::<CHANNELS>(&plane, reach, taps, cells) {
            scalar::bilinear::<u8, &[Tap], CHANNELS, false>(source, taps, cells);
        }
    }
}

/// Blends sixteen cells; false, and nothing written, where a load would leave the image.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn blend_group<const CHANNELS: usize>(plane: &Plane<'_>, reach: Reach, taps: &[Tap; 16], cells: &mut [u8]) -> bool {
    let group = Group::load(taps);
    let positions = match CHANNELS {
        1 => plane.positions::<1>(group.offsets),
        2 => plane.positions::<2>(group.offsets),
        3 => plane.positions::<3>(group.offsets),
        _ => plane.positions::<4>(group.offsets),
    };
    let weights = Weights::new(group.fractions);
    let (base, distances) = window::<CHANNELS>(plane, taps, positions);
    let in_reach = |bytes: i32| all_within(distances, bytes - 2 * CHANNELS as i32);
    if in_reach(64) && base as isize <= reach.near {
        let rows = load_window::<1>(plane, base);
        store_planar::<CHANNELS>(planar::<CHANNELS>(&weights, distances, |index| near(&rows, index)), cells);
    } else if in_reach(128) && base as isize <= reach.wide {
        let rows = load_window::<2>(plane, base);
        store_planar::<CHANNELS>(planar::<CHANNELS>(&weights, distances, |index| wide(&rows, index)), cells);
    } else if reach.gathered < 0 || !all_within(positions, reach.gathered as i32) {
        return false;
    } else if CHANNELS == 1 {
        let sums = weights.blend(gather_pairs(plane, taps, positions));
        store_planar::<CHANNELS>([sums, sums, sums, sums], cells);
    } else if CHANNELS == 2 {
        let [left, right] = gather_twos(plane, taps, positions).map(|pixels| weights.blend(pixels));
        store_planar::<CHANNELS>([left, right, right, right], cells);
    } else {
        let at = scalar_positions::<CHANNELS>(plane, taps, positions);
        store_interleaved::<CHANNELS>(gather::<CHANNELS>(plane, at, &weights), cells);
    }
    true
}

/// The last byte positions from which the loads of each way stay inside the image, there and one row below.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    pub(super) near: isize,
    pub(super) wide: isize,
    pub(super) widest: isize,
    pub(super) gathered: isize,
}

impl Reach {
    pub(super) fn new(plane: &Plane<'_>) -> Self {
        let limit = |bytes| plane.limit(bytes) as isize;
        Self { near: limit(64), wide: limit(128), widest: limit(256), gathered: limit(GATHERED) }
    }
}

/// The weights of sixteen cells as bytes, in the order top left, top right, bottom right, bottom left.
pub(super) struct Weights {
    high: __m512i,
    low: __m512i,
}

impl Weights {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn new(fractions: __m512i) -> Self {
        // in 16-bit halves of a lane, low | high:
        let xy = _mm512_and_si512(fractions, _mm512_set1_epi16(0x7fff)); // fx | fy
        let yx = _mm512_rol_epi32::<16>(xy); // fy | fx
        let both = _mm512_mulhrs_epi16(xy, yx); // w11 | w11 = (fx fy + 2^14) >> 15
        let one = _mm512_sub_epi16(xy, both); // w01 | w10
        let sum = _mm512_sub_epi16(_mm512_add_epi16(xy, yx), both); // fx + fy - w11, twice
        let none = _mm512_sub_epi16(_mm512_set1_epi16(i16::MIN), sum); // w00 twice: 32768 is 0x8000
        let two = _mm512_mask_blend_epi16(0xaaaa_aaaa, none, both); // w00 | w11
        let low_bytes = _mm512_set1_epi16(0x00ff);
        // bytes of a lane: two's low half, one's low half, two's high half, one's high half = w00, w01, w11, w10
        const SELECT: i32 = 0xca; // c ? a : b, with the mask first
        Self {
            low: _mm512_ternarylogic_epi32::<SELECT>(low_bytes, two, _mm512_slli_epi16::<8>(one)),
            high: _mm512_ternarylogic_epi32::<SELECT>(low_bytes, _mm512_srli_epi16::<8>(two), one),
        }
    }

    /// The blend of each lane's four pixels (already `p - 128`): 0 to 255 in each lane.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn blend(&self, pixels: __m512i) -> __m512i {
        let bias = _mm512_set1_epi32((128 << 15) + (1 << 14));
        let high = _mm512_dpbusd_epi32(_mm512_setzero_si512(), self.high, pixels);
        let sum = _mm512_dpbusd_epi32(_mm512_add_epi32(_mm512_slli_epi32::<8>(high), bias), self.low, pixels);
        _mm512_srli_epi32::<15>(sum)
    }

    /// The weights of one cell in all lanes.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn all(&self, cell: usize) -> Self {
        let cell = _mm512_set1_epi32(cell as i32);
        Self { high: _mm512_permutexvar_epi32(cell, self.high), low: _mm512_permutexvar_epi32(cell, self.low) }
    }

    /// The weights of cells `quarter`, 4 + quarter, 8 + quarter and 12 + quarter, each in all four lanes of a 128-bit
    /// part.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn quarter<const QUARTER: i32>(&self) -> Self {
        Self { high: _mm512_shuffle_epi32::<QUARTER>(self.high), low: _mm512_shuffle_epi32::<QUARTER>(self.low) }
    }
}

/// 64 or 128 bytes (`VECTORS`) from two neighbouring rows, as `p - 128`.
pub(super) struct Window {
    top: [__m512i; 2],
    bottom: [__m512i; 2],
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn load_window<const VECTORS: usize>(plane: &Plane<'_>, base: usize) -> Window {
    debug_assert!(base as isize <= plane.limit(64 * VECTORS) as isize);
    let top = plane.start().wrapping_add(base);
    let bottom = top.wrapping_offset(plane.row_stride);
    let second = 64 * (VECTORS - 1);
    let signed = |at: *const u8| {
        // SAFETY: the caller checked `base` against `Plane::limit(64 * VECTORS)`, so that many bytes exist from here on
        // in this row's window and in the one below.
        let bytes = unsafe { _mm512_loadu_si512(at.cast()) };
        _mm512_xor_si512(bytes, _mm512_set1_epi8(-128))
    };
    Window {
        top: [signed(top), signed(top.wrapping_add(second))],
        bottom: [signed(bottom), signed(bottom.wrapping_add(second))],
    }
}

/// The taps at `index`, from windows of 64 bytes.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn near(rows: &Window, index: __m512i) -> __m512i {
    // bytes 2 and 3 of a lane are of the bottom row: the second table
    let index = _mm512_or_si512(index, _mm512_set1_epi32(0x4040_0000));
    _mm512_permutex2var_epi8(rows.top[0], index, rows.bottom[0])
}

/// The taps at `index`, from windows of 128 bytes.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn wide(rows: &Window, index: __m512i) -> __m512i {
    const BOTTOM: u64 = 0xcccc_cccc_cccc_cccc;
    let top = _mm512_permutex2var_epi8(rows.top[0], index, rows.top[1]);
    let bottom = _mm512_permutex2var_epi8(rows.bottom[0], index, rows.bottom[1]);
    _mm512_mask_blend_epi8(BOTTOM, top, bottom)
}

/// 256 bytes from two neighbouring rows: two windows side by side. Probes of cells of 10 and 20 cm are so far apart in three
/// of ten cases, for which gathering takes half as long again.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn load_widest(plane: &Plane<'_>, base: usize) -> [Window; 2] {
    debug_assert!(base as isize <= plane.limit(256) as isize);
    [load_window::<2>(plane, base), load_window::<2>(plane, base + 128)]
}

/// The taps at `index`, from windows of 256 bytes.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn widest([first, second]: &[Window; 2], index: __m512i) -> __m512i {
    // bit 7 of an index says in which one
    _mm512_mask_blend_epi8(_mm512_movepi8_mask(index), wide(first, index), wide(second, index))
}

/// The blends of each channel of sixteen cells; `pick` takes bytes of a window.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn planar<const CHANNELS: usize>(
    weights: &Weights,
    distances: __m512i,
    pick: impl Fn(__m512i) -> __m512i,
) -> [__m512i; 4] {
    let spread = _mm512_broadcast_i32x4(_mm_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12));
    let right = CHANNELS as i32;
    // left, right, right, left in each lane: the four taps' distance from the top-left one, row aside
    let taps = _mm512_add_epi8(_mm512_shuffle_epi8(distances, spread), _mm512_set1_epi32(right << 8 | right << 16));
    let mut blends = [_mm512_setzero_si512(); 4];
    for (channel, blend) in blends.iter_mut().enumerate().take(CHANNELS) {
        *blend = weights.blend(pick(_mm512_add_epi8(taps, _mm512_set1_epi8(channel as i8))));
    }
    blends
}

/// Stores the blends of sixteen cells, a vector for each channel.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_planar<const CHANNELS: usize>(blends: [__m512i; 4], cells: &mut [u8]) {
    assert_eq!(cells.len(), 16 * CHANNELS);
    if CHANNELS == 1 {
        // SAFETY: `cells` holds 16 bytes.
        unsafe { _mm_storeu_si128(cells.as_mut_ptr().cast(), _mm512_cvtepi32_epi8(blends[0])) };
        return;
    }
    let [r, g, b, a] = blends;
    if CHANNELS == 2 {
        let pairs = _mm512_cvtepi32_epi16(_mm512_or_si512(r, _mm512_slli_epi32::<8>(g)));
        // SAFETY: `cells` holds 32 bytes.
        unsafe { _mm256_storeu_si256(cells.as_mut_ptr().cast(), pairs) };
        return;
    }
    const OR: i32 = 0xfe;
    let rgb = _mm512_ternarylogic_epi32::<OR>(r, _mm512_slli_epi32::<8>(g), _mm512_slli_epi32::<16>(b));
    let cell = if CHANNELS == 4 { _mm512_or_si512(rgb, _mm512_slli_epi32::<24>(a)) } else { rgb };
    store_cells::<CHANNELS>(cell, cells);
}

/// Stores sixteen cells of four bytes, without the fourth where there are three channels.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn store_cells<const CHANNELS: usize>(sixteen: __m512i, cells: &mut [u8]) {
    assert_eq!(cells.len(), 16 * CHANNELS);
    let at = cells.as_mut_ptr();
    if CHANNELS == 4 {
        // SAFETY: `cells` holds 64 bytes.
        unsafe { _mm512_storeu_si512(at.cast(), sixteen) };
        return;
    }
    #[rustfmt::skip]
    let drop_fourth = _mm512_set_epi8(
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        62, 61, 60, 58, 57, 56, 54, 53, 52, 50, 49, 48, 46, 45, 44, 42,
        41, 40, 38, 37, 36, 34, 33, 32, 30, 29, 28, 26, 25, 24, 22, 21,
        20, 18, 17, 16, 14, 13, 12, 10, 9, 8, 6, 5, 4, 2, 1, 0,
    );
    let packed = _mm512_permutexvar_epi8(drop_fourth, sixteen);
    // SAFETY: `cells` holds 48 bytes: 32 and 16.
    unsafe {
        _mm256_storeu_si256(at.cast(), _mm512_castsi512_si256(packed));
        _mm_storeu_si128(at.add(32).cast(), _mm512_extracti32x4_epi32::<2>(packed));
    }
}

/// The blends of sixteen cells of 3 or 4 channels, four lanes to a cell: vector q holds cells q, 4 + q, 8 + q, 12 + q.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn gather<const CHANNELS: usize>(plane: &Plane<'_>, at: [usize; 16], weights: &Weights) -> [__m512i; 4] {
    let quarter = |q: usize| {
        let left = load_cells(plane, at[q], at[4 + q]);
        let right = load_cells(plane, at[8 + q], at[12 + q]);
        // vector of two cells: 16 bytes of its top row, 16 of its bottom row, the same of the other cell
        let cell_order = |cell: i8, channels: i8| {
            let tap = |channel: i8| {
                let (left, right) = (32 * cell + channel, 32 * cell + channel + channels);
                [left, right, right + 16, left + 16]
            };
            [tap(0), tap(1), tap(2), tap(if channels == 4 { 3 } else { 2 })]
        };
        let order = [0, 1, 2, 3].map(|cell| cell_order(cell, CHANNELS as i8));
        // SAFETY: an array of 64 bytes is a vector.
        let order = unsafe { std::mem::transmute::<[[[i8; 4]; 4]; 4], __m512i>(order) };
        _mm512_xor_si512(_mm512_permutex2var_epi8(left, order, right), _mm512_set1_epi8(-128))
    };
    [
        weights.quarter::<0b00_00_00_00>().blend(quarter(0)),
        weights.quarter::<0b01_01_01_01>().blend(quarter(1)),
        weights.quarter::<0b10_10_10_10>().blend(quarter(2)),
        weights.quarter::<0b11_11_11_11>().blend(quarter(3)),
    ]
}

/// 16 bytes of the top and of the bottom row of one cell, then of another.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_cells(plane: &Plane<'_>, one: usize, other: usize) -> __m512i {
    let load = |position: usize, row: isize| {
        let at = plane.start().wrapping_add(position).wrapping_offset(row);
        // SAFETY: the caller checked every position against `Plane::limit(GATHERED)`: 16 bytes exist from there on, in
        // this row and one row below.
        unsafe { _mm_loadu_si128(at.cast()) }
    };
    let cells = _mm512_castsi128_si512(load(one, 0));
    let cells = _mm512_inserti32x4::<1>(cells, load(one, plane.row_stride));
    let cells = _mm512_inserti32x4::<2>(cells, load(other, 0));
    opaque(_mm512_inserti32x4::<3>(cells, load(other, plane.row_stride)))
}

/// Stores what [`gather`] returns.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_interleaved<const CHANNELS: usize>(blends: [__m512i; 4], cells: &mut [u8]) {
    // part i of a vector is a cell 4 i + q: packing the four vectors puts the cells of a part in their order
    let first = _mm512_packus_epi32(blends[0], blends[1]);
    let second = _mm512_packus_epi32(blends[2], blends[3]);
    store_cells::<CHANNELS>(_mm512_packus_epi16(first, second), cells);
}

/// The four pixels of sixteen cells of one channel, in the weights' order, as `p - 128`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn gather_pairs(plane: &Plane<'_>, taps: &[Tap; 16], positions: __m512i) -> __m512i {
    let at = scalar_positions::<1>(plane, taps, positions);
    let pixels = at.map(|position| {
        let top = plane.start().wrapping_add(position);
        let bottom = top.wrapping_offset(plane.row_stride);
        // SAFETY: as in `load_cells`, of which these are the first two bytes of each row.
        let (top, bottom) = unsafe { (top.cast::<u16>().read_unaligned(), bottom.cast::<u16>().read_unaligned()) };
        u32::from(top) | u32::from(bottom.swap_bytes()) << 16
    });
    // SAFETY: sixteen lanes are 64 bytes.
    let pixels = unsafe { _mm512_loadu_si512(pixels.as_ptr().cast()) };
    _mm512_xor_si512(pixels, _mm512_set1_epi8(-128))
}

/// The four pixels of sixteen cells of two channels, as [`gather_pairs`] gives them, a vector for each channel.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn gather_twos(plane: &Plane<'_>, taps: &[Tap; 16], positions: __m512i) -> [__m512i; 2] {
    let at = scalar_positions::<2>(plane, taps, positions);
    let row = |row: isize| {
        let pixels = at.map(|position| {
            let at = plane.start().wrapping_add(position).wrapping_offset(row);
            // SAFETY: as in `load_cells`, of which these are the first four bytes of a row.
            unsafe { at.cast::<u32>().read_unaligned() }
        });
        // SAFETY: sixteen lanes are 64 bytes.
        unsafe { _mm512_loadu_si512(pixels.as_ptr().cast()) }
    };
    let (top, bottom) = (row(0), row(plane.row_stride));
    // bytes 0 and 2 of a lane are the left and right pixel's first channel; 64 is the first byte of the second table
    let lanes = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, 52, 56, 60);
    let lanes = _mm512_mullo_epi32(lanes, _mm512_set1_epi32(0x0101_0101));
    [0x4042_0200, 0x4143_0301].map(|order| {
        let index = _mm512_add_epi32(lanes, _mm512_set1_epi32(order));
        _mm512_xor_si512(_mm512_permutex2var_epi8(top, index, bottom), _mm512_set1_epi8(-128))
    })
}

/// Cells whose four pixels exist, of an image of any channels: sixteen channels of one cell at a time.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn bilinear_u8_any(source: &Source<'_, u8>, taps: &[Tap], cells: &mut [u8]) {
    let image = Pixels::new(source);
    let channels = image.channels;
    // byte i of the four pixels to lane i
    let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let together = _mm512_mullo_epi32(lanes, _mm512_set1_epi32(0x0101_0101));
    let together = _mm512_add_epi8(together, _mm512_set1_epi32(0x3020_1000));
    for (taps, cells) in taps.chunks(16).zip(cells.chunks_mut(16 * channels)) {
        let sixteen = std::array::from_fn(|cell| taps[cell.min(taps.len() - 1)]);
        let weights = Weights::new(Group::load(&sixteen).fractions);
        for (index, (tap, cell)) in taps.iter().zip(cells.chunks_exact_mut(channels)).enumerate() {
            let weights = weights.all(index);
            let [left_top, right_top, left_bottom, right_bottom] = image.of(tap);
            for first in (0..channels).step_by(16) {
                let mask = u16::MAX >> (16 - (channels - first).min(16));
                let load = |pixel: &[u8]| {
                    // SAFETY: nothing is loaded without its bit, and the pixel has so many channels from `first` on.
                    unsafe { _mm_maskz_loadu_epi8(mask, pixel[first..].as_ptr().cast()) }
                };
                let pixels = _mm512_castsi128_si512(load(left_top));
                let pixels = _mm512_inserti32x4::<1>(pixels, load(right_top));
                let pixels = _mm512_inserti32x4::<2>(pixels, load(right_bottom));
                let pixels = _mm512_inserti32x4::<3>(pixels, load(left_bottom));
                let pixels = _mm512_permutexvar_epi8(together, pixels);
                let blends = weights.blend(_mm512_xor_si512(pixels, _mm512_set1_epi8(-128)));
                let cell = cell[first..].as_mut_ptr();
                // SAFETY: nothing is stored without its bit.
                unsafe { _mm_mask_storeu_epi8(cell.cast(), mask, _mm512_cvtepi32_epi8(blends)) };
            }
        }
    }
}
