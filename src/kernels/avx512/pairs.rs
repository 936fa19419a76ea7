//! Bilinear of 16-bit and float images of two channels, such as optical flow: eight cells of two lanes fill a vector. One
//! load from either row of each cell holds its left and right pixel and no byte more.

use std::arch::x86_64::*;

use super::floats::{Float, Fractions, Taps, halves, rounded};
use super::{Group, opaque, scalar_positions};
use crate::kernels::places::Places;
use crate::kernels::plane::Plane;
use crate::kernels::{Source, scalar};

/// Cells whose four pixels exist, of an image of two channels.
///
/// # Safety
/// The CPU has AVX-512 F, BW, VL, VBMI and VNNI.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
pub(in crate::kernels) fn bilinear_float_pairs<T: Float, P: Places<T>>(
    source: &Source<'_, T>,
    places: P,
    cells: &mut [T],
) {
    let all = places.taps();
    let plane = Plane::new(source).filter(|_| all.len() >= 16);
    let Some(plane) = plane else { return scalar::bilinear::<T, P, 2, false>(source, places, cells) };
    for group in 0..all.len().div_ceil(16) {
        // the last group reaches back to be whole: some cells are blended twice
        let first = (16 * group).min(all.len() - 16);
        let taps = all[first..].first_chunk().expect("sixteen are left");
        let group = Group::load(taps);
        let at = if size_of::<T>() == 2 {
            scalar_positions::<4>(&plane, taps, plane.positions::<4>(group.offsets))
        } else {
            scalar_positions::<8>(&plane, taps, plane.positions::<8>(group.offsets))
        };
        let fractions = Fractions::of(places.floats(first), group.fractions);
        for octet in 0..2 {
            let at = at[8 * octet..].first_chunk().expect("eight are left");
            let pixels =
                Taps { top: load_octet::<T>(&plane, at, 0), bottom: load_octet::<T>(&plane, at, plane.row_stride) };
            let blends = fractions.octet(octet).blend(pixels);
            store_octet(blends, cells[2 * (first + 8 * octet)..].first_chunk_mut().expect("eight cells are left"));
        }
    }
}

/// The left and the right pixels of eight cells, from one row.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn load_octet<T: Float>(plane: &Plane<'_>, at: &[usize; 8], row: isize) -> [__m512; 2] {
    let at = |cell: usize| plane.start().wrapping_add(at[cell]).wrapping_offset(row);
    if size_of::<T>() == 2 {
        let two = |cell: usize| {
            // SAFETY: a tap of the table has two pixels, 8 bytes, in this row and in the one below.
            unsafe { _mm_loadh_pd(_mm_load_sd(at(cell).cast()), at(cell + 1).cast()) }
        };
        let four = |cell: usize| _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(two(cell)), two(cell + 2));
        let eight = opaque(_mm512_castpd_si512(_mm512_insertf64x4::<1>(_mm512_castpd256_pd512(four(0)), four(4))));
        // left and right in turn
        let order = _mm_setr_epi8(0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15);
        return halves(_mm512_shuffle_epi8(eight, _mm512_broadcast_i32x4(order)));
    }
    let load = |cell: usize| {
        // SAFETY: as above, 16 bytes.
        unsafe { _mm_loadu_si128(at(cell).cast()) }
    };
    let four = |cell: usize| {
        let cells = _mm512_inserti32x4::<1>(_mm512_castsi128_si512(load(cell)), load(cell + 1));
        let cells = _mm512_inserti32x4::<2>(cells, load(cell + 2));
        opaque(_mm512_inserti32x4::<3>(cells, load(cell + 3)))
    };
    let (first, second) = (four(0), four(4));
    let left = _mm512_setr_epi32(0, 1, 4, 5, 8, 9, 12, 13, 16, 17, 20, 21, 24, 25, 28, 29);
    let right = _mm512_or_si512(left, _mm512_set1_epi32(2));
    [left, right].map(|index| _mm512_castsi512_ps(_mm512_permutex2var_epi32(first, index, second)))
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
fn store_octet<T: Float>(blends: __m512, cells: &mut [T; 16]) {
    let at = cells.as_mut_ptr();
    if size_of::<T>() == 2 {
        // SAFETY: sixteen samples of 2 bytes.
        unsafe { _mm256_storeu_si256(at.cast(), _mm512_cvtepi32_epi16(rounded(blends))) };
    } else {
        // SAFETY: sixteen samples of 4 bytes.
        unsafe { _mm512_storeu_ps(at.cast(), blends) };
    }
}
