//! Bilinear of 16-bit and float images: float32 lanes and the expression tree of the scalar kernel.
//!
//! One channel fills a vector with sixteen cells; 3 and 4 channels fill it with four cells of four lanes. Pixels get
//! there in one of two ways:
//!
//! * **window**: where the cells of a vector look at a short stretch of one row, that stretch and the one below are
//!   loaded once, and `vpermt2ps` or `vpermt2w` picks the taps. A lane of `vpermt2w` takes the left and the right pixel
//!   of a 16-bit image at once;
//! * **gather**: elsewhere one load from either row of each cell holds its left and right pixel.
//!
//! For other channel counts a vector holds sixteen channels of one cell.

use std::arch::x86_64::*;

use super::{AHEAD, Group, Pixels, all_within, opaque, scalar_offset, scalar_positions, window};
use crate::kernels::places::Places;
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar, sealed::Blend};
use crate::table::{ONE, Tap};

/// Samples that are blended in float32.
pub(in crate::kernels) trait Float: Blend {}

impl Float for u16 {}
impl Float for f32 {}

/// Bytes that a gathering load touches beyond a position: two pixels fit.
const fn gathered(sample: usize, channels: usize) -> usize {
    if channels == 1 { 2 * sample } else { 8 * sample }
}

/// Cells whose four pixels exist, of an image of 1, 3 or 4 channels.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn bilinear_float<T: Float, P: Places<T>, const CHANNELS: usize>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    let all = places.taps();
    let plane = Plane::new(source).filter(|_| all.len() >= 16);
    let Some(plane) = plane else { return scalar::bilinear::<T, P, CHANNELS, false>(source, places, cells) };
    let limit = |bytes| plane.limit(bytes) as isize;
    let reach = Reach { near: limit(128), wide: limit(256), gathered: limit(gathered(size_of::<T>(), CHANNELS)) };
    for group in 0..all.len().div_ceil(16) {
        // the last group reaches back to be whole: some cells are blended twice
        let first = (16 * group).min(all.len() - 16);
        let taps = all[first..].first_chunk().expect("sixteen are left");
        let at = Sixteen { taps, places, first };
        let cells = &mut cells[first * CHANNELS..(first + 16) * CHANNELS];
        if CHANNELS * size_of::<T>() >= 12 {
            prefetch_quads::<T, CHANNELS>(
                &plane,
                all[(first + 32).min(all.len() - 16)..].first_chunk().expect("sixteen"),
            );
        }
        let blended = match (CHANNELS, size_of::<T>()) {
            (1, _) => blend_planar(&plane, reach, at, cells),
            (3, 2) => blend_quads::<T, P, CHANNELS, 6>(&plane, reach, at, cells),
            (3, _) => blend_quads::<T, P, CHANNELS, 12>(&plane, reach, at, cells),
            (_, 2) => blend_quads::<T, P, CHANNELS, 8>(&plane, reach, at, cells),
            _ => blend_quads::<T, P, CHANNELS, 16>(&plane, reach, at, cells),
        };
        if !blended {
            scalar::bilinear::<T, P, CHANNELS, false>(source, places.part(first..first + 16), cells);
        }
    }
}

/// Sixteen of a run's cells.
#[derive(Clone, Copy)]
struct Sixteen<'a, P> {
    taps: &'a [Tap; 16],
    places: P,
    first: usize,
}

/// The last byte positions from which the loads of each way stay inside the image, there and one row below.
#[derive(Clone, Copy)]
struct Reach {
    near: isize,
    wide: isize,
    gathered: isize,
}

/// The fractions of sixteen cells, or one cell's in all lanes.
#[derive(Clone, Copy)]
pub(super) struct Fractions {
    x: __m512,
    y: __m512,
}

impl Fractions {
    /// From x in the low and y in the high half of each lane.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn new(packed: __m512i) -> Self {
        let low = _mm512_set1_epi32(0x7fff); // without the step
        let unit =
            |q15| _mm512_mul_ps(_mm512_cvtepi32_ps(_mm512_and_si512(q15, low)), _mm512_set1_ps(1.0 / ONE as f32));
        Self { x: unit(packed), y: unit(_mm512_srli_epi32::<16>(packed)) }
    }

    /// Exact ones where there are any, else those that the taps say.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn of(exact: Option<[&[f32; 16]; 2]>, packed: __m512i) -> Self {
        match exact {
            // SAFETY: sixteen numbers are 64 bytes; the loads need no alignment.
            Some([x, y]) => unsafe { Self { x: _mm512_loadu_ps(x.as_ptr()), y: _mm512_loadu_ps(y.as_ptr()) } },
            None => Self::new(packed),
        }
    }

    /// The fractions of cells 4 `quad` to 4 `quad` + 3, each in four lanes.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    fn quad(self, quad: usize) -> Self {
        let cells = quad_lanes(quad);
        Self { x: _mm512_permutexvar_ps(cells, self.x), y: _mm512_permutexvar_ps(cells, self.y) }
    }

    /// The fractions of cells 8 `octet` to 8 `octet` + 7, each in two lanes.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn octet(self, octet: usize) -> Self {
        let spread = _mm512_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7);
        let cells = _mm512_add_epi32(spread, _mm512_set1_epi32(8 * octet as i32));
        Self { x: _mm512_permutexvar_ps(cells, self.x), y: _mm512_permutexvar_ps(cells, self.y) }
    }

    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn blend(self, taps: Taps) -> __m512 {
        let mix = |a, b, fraction| _mm512_add_ps(a, _mm512_mul_ps(_mm512_sub_ps(b, a), fraction));
        mix(mix(taps.top[0], taps.top[1], self.x), mix(taps.bottom[0], taps.bottom[1], self.x), self.y)
    }
}

/// The left and the right pixels of both rows.
pub(super) struct Taps {
    pub(super) top: [__m512; 2],
    pub(super) bottom: [__m512; 2],
}

/// Lanes 4 `quad` to 4 `quad` + 3, each four times.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn quad_lanes(quad: usize) -> __m512i {
    let spread = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    _mm512_add_epi32(spread, _mm512_set1_epi32(4 * quad as i32))
}

/// The left and the right pixel of lanes that hold both as 16-bit numbers.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn halves(pairs: __m512i) -> [__m512; 2] {
    let left = _mm512_and_si512(pairs, _mm512_set1_epi32(0xffff));
    [_mm512_cvtepi32_ps(left), _mm512_cvtepi32_ps(_mm512_srli_epi32::<16>(pairs))]
}

/// 16-bit samples from their exact values: rounded, below 65536 because a blend stays between its pixels.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(super) fn rounded(values: __m512) -> __m512i {
    _mm512_cvttps_epi32(_mm512_add_ps(values, _mm512_set1_ps(0.5)))
}

/// 64 bytes from each of `VECTORS` places, and the same one row below.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_window<const VECTORS: usize>(plane: &Plane<'_>, base: usize) -> [[__m512i; VECTORS]; 2] {
    debug_assert!(base as isize <= plane.limit(64 * VECTORS) as isize);
    let top = plane.start().wrapping_add(base);
    let mut rows = [[_mm512_setzero_si512(); VECTORS]; 2];
    for (row, start) in rows.iter_mut().zip([top, top.wrapping_offset(plane.row_stride)]) {
        for (index, vector) in row.iter_mut().enumerate() {
            // SAFETY: the caller checked `base` against `Plane::limit(64 * VECTORS)`, so that many bytes exist from
            // here on in this row's window and in the one below.
            *vector = unsafe { _mm512_loadu_si512(start.wrapping_add(64 * index).cast()) };
        }
    }
    rows
}

/// The taps at `index` from windows of 2 or 4 vectors: lanes of a float image, pairs of halves of a 16-bit image.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn pick<T: Float, const VECTORS: usize>(rows: &[[__m512i; VECTORS]; 2], left: __m512i, right: i32) -> Taps {
    if size_of::<T>() == 2 {
        let index = _mm512_or_si512(left, _mm512_slli_epi32::<16>(left));
        let index = _mm512_add_epi32(index, _mm512_set1_epi32(right << 16));
        let beyond = if VECTORS > 2 { _mm512_test_epi16_mask(index, _mm512_set1_epi16(64)) } else { 0 };
        let pairs = |row: &[__m512i; VECTORS]| {
            let near = _mm512_permutex2var_epi16(row[0], index, row[1]);
            if VECTORS == 2 {
                return near;
            }
            let far = _mm512_permutex2var_epi16(row[VECTORS - 2], index, row[VECTORS - 1]);
            _mm512_mask_blend_epi16(beyond, near, far)
        };
        return Taps { top: halves(pairs(&rows[0])), bottom: halves(pairs(&rows[1])) };
    }
    let right = _mm512_add_epi32(left, _mm512_set1_epi32(right));
    let both = [left, right].map(|index| {
        let beyond = if VECTORS > 2 { _mm512_test_epi32_mask(index, _mm512_set1_epi32(32)) } else { 0 };
        (index, beyond)
    });
    let taps = |row: &[__m512i; VECTORS]| {
        both.map(|(index, beyond)| {
            let near = _mm512_permutex2var_epi32(row[0], index, row[1]);
            if VECTORS == 2 {
                return _mm512_castsi512_ps(near);
            }
            let far = _mm512_permutex2var_epi32(row[VECTORS - 2], index, row[VECTORS - 1]);
            _mm512_castsi512_ps(_mm512_mask_blend_epi32(beyond, near, far))
        })
    };
    Taps { top: taps(&rows[0]), bottom: taps(&rows[1]) }
}

/// Blends sixteen cells of one channel; false, and nothing written, where a load would leave the image.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn blend_planar<T: Float, P: Places<T>>(plane: &Plane<'_>, reach: Reach, at: Sixteen<'_, P>, cells: &mut [T]) -> bool {
    let (taps, group) = (at.taps, Group::load(at.taps));
    let (positions, (base, distances)) = if size_of::<T>() == 2 {
        let positions = plane.positions::<2>(group.offsets);
        (positions, window::<2>(plane, taps, positions))
    } else {
        let positions = plane.positions::<4>(group.offsets);
        (positions, window::<4>(plane, taps, positions))
    };
    let in_reach = |bytes: i32| all_within(distances, bytes - 2 * size_of::<T>() as i32);
    let left = if size_of::<T>() == 2 { _mm512_srli_epi32::<1>(distances) } else { _mm512_srli_epi32::<2>(distances) };
    let pixels = if in_reach(128) && base as isize <= reach.near {
        pick::<T, 2>(&load_window(plane, base), left, 1)
    } else if in_reach(256) && base as isize <= reach.wide {
        pick::<T, 4>(&load_window(plane, base), left, 1)
    } else if reach.gathered < 0 || !all_within(positions, reach.gathered as i32) {
        return false;
    } else {
        gather_planar::<T>(plane, taps, positions)
    };
    let blends = Fractions::of(at.places.floats(at.first), group.fractions).blend(pixels);
    assert_eq!(cells.len(), 16);
    let at = cells.as_mut_ptr();
    if size_of::<T>() == 2 {
        // SAFETY: `cells` holds 32 bytes.
        unsafe { _mm256_storeu_si256(at.cast(), _mm512_cvtepi32_epi16(rounded(blends))) };
    } else {
        // SAFETY: `cells` holds 64 bytes.
        unsafe { _mm512_storeu_ps(at.cast(), blends) };
    }
    true
}

/// The pixels of sixteen cells of one channel, two loads to a cell.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn gather_planar<T: Float>(plane: &Plane<'_>, taps: &[Tap; 16], positions: __m512i) -> Taps {
    if size_of::<T>() == 2 {
        let at = scalar_positions::<2>(plane, taps, positions);
        let pairs = |row: isize| {
            let lanes = at.map(|position| {
                let at = plane.start().wrapping_add(position).wrapping_offset(row);
                // SAFETY: the caller checked every position against `Plane::limit` of these 4 bytes.
                unsafe { at.cast::<u32>().read_unaligned() }
            });
            // SAFETY: sixteen lanes are 64 bytes.
            halves(unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) })
        };
        return Taps { top: pairs(0), bottom: pairs(plane.row_stride) };
    }
    let at = scalar_positions::<4>(plane, taps, positions);
    let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    let odd = _mm512_or_si512(even, _mm512_set1_epi32(1));
    let pixels = |row: isize| {
        let load = |cell: usize| {
            let at = |cell: usize| plane.start().wrapping_add(at[cell]).wrapping_offset(row).cast::<f64>();
            // SAFETY: the caller checked every position against `Plane::limit` of these 8 bytes.
            unsafe { _mm_loadh_pd(_mm_load_sd(at(cell)), at(cell + 1)) }
        };
        let eight = |cell: usize| {
            let four = |cell: usize| _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(load(cell)), load(cell + 2));
            let both = _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(four(cell)), four(cell + 4));
            opaque(_mm512_castpd_si512(both))
        };
        let (first, second) = (eight(0), eight(8));
        [even, odd].map(|index| _mm512_castsi512_ps(_mm512_permutex2var_epi32(first, index, second)))
    };
    Taps { top: pixels(0), bottom: pixels(plane.row_stride) }
}

/// Blends sixteen cells of 3 or 4 channels, four at a time; false, and nothing written, where a load would leave the
/// image.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn blend_quads<T: Float, P: Places<T>, const CHANNELS: usize, const PIXEL: usize>(
    plane: &Plane<'_>,
    reach: Reach,
    at: Sixteen<'_, P>,
    cells: &mut [T],
) -> bool {
    let (taps, group) = (at.taps, Group::load(at.taps));
    let positions = match PIXEL {
        6 => plane.positions::<6>(group.offsets),
        8 => plane.positions::<8>(group.offsets),
        12 => plane.positions::<12>(group.offsets),
        _ => plane.positions::<16>(group.offsets),
    };
    // the cells of a quad run along a row, so its lowest is the first or, where the view is mirrored, the last
    let bases = _mm512_min_epu32(
        _mm512_shuffle_epi32::<0b00_00_00_00>(positions),
        _mm512_shuffle_epi32::<0b11_11_11_11>(positions),
    );
    let distances = _mm512_sub_epi32(positions, bases);
    let fractions = Fractions::of(at.places.floats(at.first), group.fractions);
    if reach.near >= 0 && all_within(distances, 128 - 2 * PIXEL as i32) && all_within(bases, reach.near as i32) {
        let bases = quad_bases::<PIXEL>(plane, taps, bases);
        let samples =
            if size_of::<T>() == 2 { _mm512_srli_epi32::<1>(distances) } else { _mm512_srli_epi32::<2>(distances) };
        // the fourth lane of a cell of 3 channels repeats the third: no other cell's NaN or denormal is worked on
        let channel = _mm512_broadcast_i32x4(_mm_setr_epi32(0, 1, 2, CHANNELS as i32 - 1));
        let quad = |quad: usize| {
            let left = _mm512_add_epi32(_mm512_permutexvar_epi32(quad_lanes(quad), samples), channel);
            let pixels = pick::<T, 2>(&load_window(plane, bases[quad]), left, CHANNELS as i32);
            fractions.quad(quad).blend(pixels)
        };
        store_quads::<T, CHANNELS>([quad(0), quad(1), quad(2), quad(3)], cells);
    } else if reach.gathered < 0 || !all_within(positions, reach.gathered as i32) {
        return false;
    } else {
        let at = scalar_positions::<PIXEL>(plane, taps, positions);
        let quad = |quad: usize| {
            let at = at[4 * quad..].first_chunk().expect("four are left");
            let pixels = if size_of::<T>() == 2 {
                Taps {
                    top: halves(load_quad_u16::<CHANNELS>(plane, at, 0)),
                    bottom: halves(load_quad_u16::<CHANNELS>(plane, at, plane.row_stride)),
                }
            } else {
                Taps {
                    top: load_quad_f32::<CHANNELS>(plane, at, 0),
                    bottom: load_quad_f32::<CHANNELS>(plane, at, plane.row_stride),
                }
            };
            fractions.quad(quad).blend(pixels)
        };
        store_quads::<T, CHANNELS>([quad(0), quad(1), quad(2), quad(3)], cells);
    }
    true
}

/// Fetches the pixels of sixteen cells ahead of time, one line of either row for each quad: 3 float channels took 0.78
/// ms with it and 0.92 without. Pixels of fewer bytes gain nothing.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn prefetch_quads<T: Float, const CHANNELS: usize>(plane: &Plane<'_>, taps: &[Tap; 16]) {
    if plane.strided.is_some() {
        return;
    }
    for cell in [0, 4, 8, 12] {
        let at = plane.start().wrapping_add(scalar_offset(taps, cell) * CHANNELS * size_of::<T>());
        _mm_prefetch::<_MM_HINT_T0>(at.cast());
        _mm_prefetch::<_MM_HINT_T0>(at.wrapping_offset(plane.row_stride).cast());
    }
}

/// The lowest position of each quad as a number.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn quad_bases<const PIXEL: usize>(plane: &Plane<'_>, taps: &[Tap; 16], bases: __m512i) -> [usize; 4] {
    if plane.strided.is_none() {
        return [0, 4, 8, 12].map(|cell| scalar_offset(taps, cell).min(scalar_offset(taps, cell + 3)) * PIXEL);
    }
    let mut lanes = [0u32; 16];
    // SAFETY: sixteen lanes are 64 bytes.
    unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), bases) };
    [0, 4, 8, 12].map(|lane| lanes[lane] as usize)
}

/// The left and right pixels of four cells of a 16-bit image as halves of lanes, from one row.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_quad_u16<const CHANNELS: usize>(plane: &Plane<'_>, at: &[usize; 4], row: isize) -> __m512i {
    let load = |cell: usize| {
        let at = plane.start().wrapping_add(at[cell]).wrapping_offset(row);
        // SAFETY: the caller checked every position against `Plane::limit` of these 16 bytes.
        unsafe { _mm_loadu_si128(at.cast()) }
    };
    let cells = _mm512_inserti32x4::<1>(_mm512_castsi128_si512(load(0)), load(1));
    let cells = _mm512_inserti32x4::<2>(cells, load(2));
    let cells = opaque(_mm512_inserti32x4::<3>(cells, load(3)));
    // left and right in turn: channel c of the right pixel is `CHANNELS` samples further
    let order = match CHANNELS {
        3 => _mm_setr_epi8(0, 1, 6, 7, 2, 3, 8, 9, 4, 5, 10, 11, 4, 5, 10, 11),
        _ => _mm_setr_epi8(0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15),
    };
    _mm512_shuffle_epi8(cells, _mm512_broadcast_i32x4(order))
}

/// The left and right pixels of four cells of a float image, from one row.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_quad_f32<const CHANNELS: usize>(plane: &Plane<'_>, at: &[usize; 4], row: isize) -> [__m512; 2] {
    let load = |cell: usize| {
        let at = plane.start().wrapping_add(at[cell]).wrapping_offset(row);
        // SAFETY: the caller checked every position against `Plane::limit` of these 32 bytes.
        unsafe { _mm256_loadu_si256(at.cast()) }
    };
    let two = |cell: usize| opaque(_mm512_inserti64x4::<1>(_mm512_castsi256_si512(load(cell)), load(cell + 1)));
    let (first, second) = (two(0), two(2));
    let left = match CHANNELS {
        3 => _mm512_setr_epi32(0, 1, 2, 2, 8, 9, 10, 10, 16, 17, 18, 18, 24, 25, 26, 26),
        _ => _mm512_setr_epi32(0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27),
    };
    let right = _mm512_add_epi32(left, _mm512_set1_epi32(CHANNELS as i32));
    [left, right].map(|index| _mm512_castsi512_ps(_mm512_permutex2var_epi32(first, index, second)))
}

/// Stores four quads, sixteen cells.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_quads<T: Float, const CHANNELS: usize>(quads: [__m512; 4], cells: &mut [T]) {
    assert_eq!(cells.len(), 16 * CHANNELS);
    let at = cells.as_mut_ptr().cast::<u8>();
    let store = |vectors: &[__m512i]| {
        for (index, &vector) in vectors.iter().enumerate() {
            // SAFETY: `cells` holds a vector for each: 3 or 4 of floats, half as many of 16-bit samples.
            unsafe { _mm512_storeu_si512(at.add(64 * index).cast(), vector) };
        }
    };
    if size_of::<T>() == 2 {
        let [a, b, c, d] = quads.map(|quad| rounded(quad));
        if CHANNELS == 4 {
            #[rustfmt::skip]
            let low = _mm512_set_epi16(
                62, 60, 58, 56, 54, 52, 50, 48, 46, 44, 42, 40, 38, 36, 34, 32,
                30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0,
            );
            return store(&[_mm512_permutex2var_epi16(a, low, b), _mm512_permutex2var_epi16(c, low, d)]);
        }
        // eight cells of three samples out of two quads: 48 bytes, the others are zero
        #[rustfmt::skip]
        let low = _mm512_set_epi16(
            0, 0, 0, 0, 0, 0, 0, 0, 60, 58, 56, 52, 50, 48, 44, 42,
            40, 36, 34, 32, 28, 26, 24, 20, 18, 16, 12, 10, 8, 4, 2, 0,
        );
        for (index, (one, other)) in [(a, b), (c, d)].into_iter().enumerate() {
            let eight = _mm512_permutex2var_epi16(one, low, other);
            // SAFETY: `cells` holds 96 bytes, 32 and 16 for each pair of quads.
            unsafe {
                let at = at.add(48 * index);
                _mm256_storeu_si256(at.cast(), _mm512_castsi512_si256(eight));
                _mm_storeu_si128(at.add(32).cast(), _mm512_extracti32x4_epi32::<2>(eight));
            }
        }
        return;
    }
    let [a, b, c, d] = quads.map(|quad| _mm512_castps_si512(quad));
    if CHANNELS == 4 {
        return store(&[a, b, c, d]);
    }
    // every fourth lane goes: 12 of a and 4 of b, 8 of b and 8 of c, 4 of c and 12 of d
    let first = _mm512_setr_epi32(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18, 20);
    let second = _mm512_setr_epi32(5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18, 20, 21, 22, 24, 25);
    let third = _mm512_setr_epi32(10, 12, 13, 14, 16, 17, 18, 20, 21, 22, 24, 25, 26, 28, 29, 30);
    store(&[
        _mm512_permutex2var_epi32(a, first, b),
        _mm512_permutex2var_epi32(b, second, c),
        _mm512_permutex2var_epi32(c, third, d),
    ]);
}

/// Cells whose four pixels exist, of an image of any channels: sixteen channels of one cell at a time.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn bilinear_float_any<T: Float, P: Places<T>>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    let (image, taps) = (Pixels::new(source), places.taps());
    let channels = image.channels;
    for (index, (tap, cell)) in taps.iter().zip(cells.chunks_exact_mut(channels)).enumerate() {
        if image.is_wide() {
            image.prefetch(&taps[(index + AHEAD).min(taps.len() - 1)]);
        }
        let pixels = image.of(tap);
        let fractions = match places.floats::<1>(index) {
            Some([[x], [y]]) => Fractions { x: _mm512_set1_ps(*x), y: _mm512_set1_ps(*y) },
            None => Fractions::new(_mm512_set1_epi32((tap.fx() | tap.fy() << 16) as i32)),
        };
        for first in (0..channels).step_by(16) {
            let lanes = u16::MAX >> (16 - (channels - first).min(16));
            let [left_top, right_top, left_bottom, right_bottom] =
                pixels.map(|pixel| load_lanes(&pixel[first..], lanes));
            let blends = fractions.blend(Taps { top: [left_top, right_top], bottom: [left_bottom, right_bottom] });
            store_lanes(blends, &mut cell[first..], lanes);
        }
    }
}

/// As many samples as `lanes` has bits.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_lanes<T: Float>(samples: &[T], lanes: u16) -> __m512 {
    debug_assert!(samples.len() >= lanes.count_ones() as usize);
    let at = samples.as_ptr();
    if size_of::<T>() == 2 {
        // SAFETY: nothing is loaded without its bit, and the caller has so many samples.
        let halves = unsafe { _mm256_maskz_loadu_epi16(lanes, at.cast()) };
        return _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(halves));
    }
    // SAFETY: as above.
    unsafe { _mm512_maskz_loadu_ps(lanes, at.cast()) }
}

/// The counterpart of [`load_lanes`].
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_lanes<T: Float>(blends: __m512, samples: &mut [T], lanes: u16) {
    debug_assert!(samples.len() >= lanes.count_ones() as usize);
    let at = samples.as_mut_ptr();
    if size_of::<T>() == 2 {
        // SAFETY: nothing is stored without its bit, and the caller has so many samples.
        unsafe { _mm256_mask_storeu_epi16(at.cast(), lanes, _mm512_cvtepi32_epi16(rounded(blends))) };
        return;
    }
    // SAFETY: as above.
    unsafe { _mm512_mask_storeu_ps(at.cast(), lanes, blends) };
}
