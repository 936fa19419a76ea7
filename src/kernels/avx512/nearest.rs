//! Nearest: pixels are copied, whatever they are made of.
//!
//! * **window**: where sixteen neighbouring cells look at 64, 128 or 256 bytes of one row, the bytes of that row and the
//!   next are loaded once, and `vpermi2b` picks the pixels, up to 4 bytes for each lane;
//! * **one by one**: elsewhere and for larger pixels each is loaded and stored with up to 3 bytes more than it has; the
//!   next one overwrites what was too much.

use std::arch::x86_64::*;

use super::{Group, all_within, window};
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};
use crate::table::Tap;
use crate::view::{Sample, as_bytes_mut};

/// Bytes that are loaded for a pixel of so many.
const fn loaded(pixel: usize) -> usize {
    if pixel <= 16 { pixel.next_power_of_two() } else { pixel }
}

/// Cells whose four pixels exist, of pixels of 1, 2, 3, 4, 6, 8, 12 or 16 bytes.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn nearest<T: Sample, const PIXEL: usize>(
    source: &Source<'_, T>,
    taps: &[Tap],
    cells: &mut [T],
) {
    let plane = Plane::new(source).filter(|_| taps.len() >= 16);
    let Some(plane) = plane else { return scalar::nearest::<T, 0, false>(source, taps, cells) };
    copy_run::<PIXEL>(&plane, taps, as_bytes_mut(cells));
}

/// The last byte positions from which the loads of each way stay inside the image, there and one row below.
#[derive(Clone, Copy)]
struct Reach {
    near: isize,
    wide: isize,
    widest: isize,
    single: isize,
}

/// Apart from [`nearest`], so that there is one of it for all dtypes and its constants stay in registers.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn copy_run<const PIXEL: usize>(plane: &Plane<'_>, taps: &[Tap], cells: &mut [u8]) {
    debug_assert_eq!(plane.pixel as usize, PIXEL);
    let limit = |bytes| plane.limit(bytes) as isize;
    let reach = Reach { near: limit(64), wide: limit(128), widest: limit(256), single: limit(PIXEL + loaded(PIXEL)) };
    for group in 0..taps.len().div_ceil(16) {
        // the last group reaches back to be whole: some cells are copied twice
        let first = (16 * group).min(taps.len() - 16);
        let taps = taps[first..].first_chunk().expect("sixteen are left");
        copy_group::<PIXEL>(plane, reach, taps, &mut cells[first * PIXEL..(first + 16) * PIXEL]);
    }
}

/// Copies sixteen cells.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn copy_group<const PIXEL: usize>(plane: &Plane<'_>, reach: Reach, taps: &[Tap; 16], cells: &mut [u8]) {
    let group = Group::load(taps);
    let positions = match PIXEL {
        1 => plane.positions::<1>(group.offsets),
        2 => plane.positions::<2>(group.offsets),
        3 => plane.positions::<3>(group.offsets),
        4 => plane.positions::<4>(group.offsets),
        8 => plane.positions::<8>(group.offsets),
        16 => plane.positions::<16>(group.offsets),
        _ => plane.positions::<0>(group.offsets),
    };
    if PIXEL <= 4 && copy_window::<PIXEL>(plane, reach, taps, &group, positions, cells) {
        return;
    }
    assert_eq!(cells.len(), 16 * PIXEL);
    let at = cells.as_mut_ptr();
    // near the end of the image, every pixel is copied like the last one of a group
    let exact = reach.single < 0 || !all_within(positions, reach.single as i32);
    let nearest = step_right::<PIXEL>(&group, positions);
    let stride = _mm512_set1_epi32(plane.row_stride as i32);
    let nearest = _mm512_mask_add_epi32(nearest, below(&group), nearest, stride);
    // working the positions out one by one with scalar code took 10 to 20 % longer
    let mut lanes = [0u32; 16];
    // SAFETY: sixteen lanes are 64 bytes.
    unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), nearest) };
    for (cell, lane) in lanes.iter().enumerate() {
        // SAFETY: a reference is good to read. Volatile, or the compiler takes the lane out of the vector.
        let position = unsafe { std::ptr::read_volatile(lane) } as usize;
        let from = plane.start().wrapping_add(position);
        copy_pixel::<PIXEL>(from, at.wrapping_add(cell * PIXEL), exact || cell == 15);
    }
}

/// Positions one pixel further where the nearest is the right one.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn step_right<const PIXEL: usize>(group: &Group, positions: __m512i) -> __m512i {
    let right = _mm512_test_epi32_mask(group.fractions, _mm512_set1_epi32(0x8000));
    _mm512_mask_add_epi32(positions, right, positions, _mm512_set1_epi32(PIXEL as i32))
}

/// The cells whose nearest pixel is in the row below.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn below(group: &Group) -> __mmask16 {
    _mm512_cmplt_epi32_mask(group.fractions, _mm512_setzero_si512())
}

/// Copies sixteen cells out of a window; false, and nothing written, where none of those that the image has room for
/// holds them all.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn copy_window<const PIXEL: usize>(
    plane: &Plane<'_>,
    reach: Reach,
    taps: &[Tap; 16],
    group: &Group,
    positions: __m512i,
    cells: &mut [u8],
) -> bool {
    let (base, distances) = window::<PIXEL>(plane, taps, positions);
    let in_reach = |bytes: i32| all_within(distances, bytes - 2 * PIXEL as i32);
    let nearest = step_right::<PIXEL>(group, distances);
    let below = below(group);
    let spread = _mm512_broadcast_i32x4(_mm_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12));
    let index = _mm512_add_epi8(_mm512_shuffle_epi8(nearest, spread), _mm512_set1_epi32(0x0302_0100));
    let rows = [plane.start().wrapping_add(base), plane.start().wrapping_add(base).wrapping_offset(plane.row_stride)];
    let load = |row: usize, vector: usize| {
        // SAFETY: `base` is checked below against `Plane::limit` of the vectors that are loaded.
        unsafe { _mm512_loadu_si512(rows[row].wrapping_add(64 * vector).cast()) }
    };
    // sixteen cells of larger pixels rarely fit 64 bytes: the check costs more than the loads it saves
    let pixels = if PIXEL <= 2 && in_reach(64) && base as isize <= reach.near {
        // bit 6 of an index chooses the second table
        let index = _mm512_mask_xor_epi32(index, below, index, _mm512_set1_epi8(64));
        _mm512_permutex2var_epi8(load(0, 0), index, load(1, 0))
    } else if in_reach(128) && base as isize <= reach.wide {
        let pick = |row| _mm512_permutex2var_epi8(load(row, 0), index, load(row, 1));
        _mm512_mask_mov_epi32(pick(0), below, pick(1))
    } else if in_reach(256) && base as isize <= reach.widest {
        let far = _mm512_movepi8_mask(index);
        let pick = |row| {
            let near = _mm512_permutex2var_epi8(load(row, 0), index, load(row, 1));
            _mm512_mask_mov_epi8(near, far, _mm512_permutex2var_epi8(load(row, 2), index, load(row, 3)))
        };
        _mm512_mask_mov_epi32(pick(0), below, pick(1))
    } else {
        return false;
    };
    store_lanes::<PIXEL>(pixels, cells);
    true
}

/// Copies a pixel, with more bytes than it has unless that would reach into what is not ours.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn copy_pixel<const PIXEL: usize>(from: *const u8, to: *mut u8, exact: bool) {
    // SAFETY: the pixel exists, and so does its cell. Unless it is to be exact, the caller checked the position of the
    // top-left pixel against `Plane::limit` of one pixel and `loaded(PIXEL)` bytes, and the cells go on behind this one.
    unsafe {
        match PIXEL {
            1 => *to = *from,
            2 => to.cast::<u16>().write_unaligned(from.cast::<u16>().read_unaligned()),
            4 => to.cast::<u32>().write_unaligned(from.cast::<u32>().read_unaligned()),
            8 => to.cast::<u64>().write_unaligned(from.cast::<u64>().read_unaligned()),
            16 => _mm_storeu_si128(to.cast(), _mm_loadu_si128(from.cast())),
            _ if exact => std::ptr::copy_nonoverlapping(from, to, PIXEL),
            3 => to.cast::<u32>().write_unaligned(from.cast::<u32>().read_unaligned()),
            6 => to.cast::<u64>().write_unaligned(from.cast::<u64>().read_unaligned()),
            12 => _mm_storeu_si128(to.cast(), _mm_loadu_si128(from.cast())),
            _ => unreachable!("no kernel for such pixels"),
        }
    }
}

/// Stores sixteen cells from the low bytes of lanes.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_lanes<const PIXEL: usize>(lanes: __m512i, cells: &mut [u8]) {
    assert_eq!(cells.len(), 16 * PIXEL);
    let at = cells.as_mut_ptr();
    // SAFETY: `cells` holds 16 pixels, and so many bytes are stored.
    unsafe {
        match PIXEL {
            1 => _mm_storeu_si128(at.cast(), _mm512_cvtepi32_epi8(lanes)),
            2 => _mm256_storeu_si256(at.cast(), _mm512_cvtepi32_epi16(lanes)),
            3 => super::bytes::store_cells::<3>(lanes, cells),
            _ => _mm512_storeu_si512(at.cast(), lanes),
        }
    }
}
