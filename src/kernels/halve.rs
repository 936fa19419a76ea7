//! Averages of neighbouring pixels of 8 bits, a vector of them at a time: no compiler finds these shuffles.
//!
//! With AVX2 and AVX-512 a row of most levels is made in one go, from the source's rows to overlapping boxes, in the first
//! cache or in registers. Step by step, each from memory to memory, levels took twice as long with AVX-512 and were more than
//! half of all instructions of 20 cm cells with AVX2.

#[cfg(target_arch = "x86_64")]
use super::{avx2, avx512};
use crate::isa::Isa;
#[cfg(any(target_arch = "x86_64", test))]
use crate::isa::by_isa;

/// Samples of which an instruction set may average whole vectors.
pub(super) trait Pairs: Sized {
    /// Averages as many pairs of neighbouring pixels as fill whole vectors; returns how many. The rest is left to the
    /// caller, and may have been written to.
    fn whole_vectors(_isa: Isa, _up: bool, _channels: usize, _pixels: &[Self], _out: &mut [Self]) -> usize {
        0
    }

    /// Writes a row of boxes of `2^kx` pixels that overlap by half, from `rows` that hold their pixels and no more: those
    /// of the source or, where there is but one, its rows averaged already. They are `2^ky` rows of the source. False, and
    /// nothing written, where there is no such kernel.
    fn boxes(_isa: Isa, _channels: usize, _k: [u32; 2], _rows: &[&[Self]], _out: &mut [Self]) -> bool {
        false
    }
}

impl Pairs for u16 {}

impl Pairs for f32 {}

impl Pairs for f64 {}

impl Pairs for u8 {
    #[cfg(target_arch = "x86_64")]
    fn whole_vectors(isa: Isa, up: bool, channels: usize, pixels: &[u8], out: &mut [u8]) -> usize {
        by_isa!(
            isa,
            Scalar => 0,
            // SAFETY: an `Isa` other than scalar comes here only from `active`, `checked`, `available` or `or_scalar`,
            // which found that the CPU has what it needs.
            Avx2 => unsafe {
                match channels {
                    1 => x86::avx2::<1>(up, pixels, out),
                    2 => x86::avx2::<2>(up, pixels, out),
                    3 => x86::avx2::<3>(up, pixels, out),
                    4 => x86::avx2::<4>(up, pixels, out),
                    _ => 0,
                }
            },
            // SAFETY: as above.
            Avx512 => unsafe {
                match channels {
                    1 => x86::avx512::<1>(up, pixels, out),
                    2 => x86::avx512::<2>(up, pixels, out),
                    3 => x86::avx512::<3>(up, pixels, out),
                    4 => x86::avx512::<4>(up, pixels, out),
                    _ => 0,
                }
            },
            Neon => 0,
        )
    }

    #[cfg(target_arch = "x86_64")]
    fn boxes(isa: Isa, channels: usize, k: [u32; 2], rows: &[&[u8]], out: &mut [u8]) -> bool {
        by_isa!(
            isa,
            Scalar => false,
            // SAFETY: an `Isa` other than scalar comes here only from `active`, `checked`, `available` or `or_scalar`,
            // which found that the CPU has what it needs.
            Avx2 => unsafe {
                match channels {
                    1 => avx2::boxes_u8::<1>(k, rows, out),
                    2 => avx2::boxes_u8::<2>(k, rows, out),
                    3 => avx2::boxes_u8::<3>(k, rows, out),
                    4 => avx2::boxes_u8::<4>(k, rows, out),
                    _ => false,
                }
            },
            // SAFETY: as above.
            Avx512 => unsafe {
                match channels {
                    1 => avx512::boxes_u8::<1>(k, rows, out),
                    2 => avx512::boxes_u8::<2>(k, rows, out),
                    3 => avx512::boxes_u8::<3>(k, rows, out),
                    4 => avx512::boxes_u8::<4>(k, rows, out),
                    _ => false,
                }
            },
            Neon => false,
        )
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    /// Where the left one of each pair is among the bytes of a vector of `N` bytes of averages.
    const fn left<const CHANNELS: usize, const N: usize>() -> [u8; N] {
        let mut order = [0; N];
        let mut byte = 0;
        // a pixel that the vector holds in part is not one of those averaged
        while byte < N / CHANNELS * CHANNELS {
            order[byte] = (2 * (byte / CHANNELS) * CHANNELS + byte % CHANNELS) as u8;
            byte += 1;
        }
        order
    }

    /// 64 bytes at a time.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vnni")]
    pub(super) fn avx512<const CHANNELS: usize>(up: bool, pixels: &[u8], out: &mut [u8]) -> usize {
        let order = const { left::<CHANNELS, 64>() };
        // SAFETY: the array is 64 bytes.
        let left = unsafe { _mm512_loadu_si512(order.as_ptr().cast()) };
        let right = _mm512_add_epi8(left, _mm512_set1_epi8(CHANNELS as i8));
        let flip = _mm512_set1_epi8(if up { 0 } else { -1 });
        let pairs_of = |low: __m512i, high: __m512i| {
            let [a, b] = [left, right].map(|order| _mm512_permutex2var_epi8(low, order, high));
            // halfway down is halfway up of what is left to 255
            let average = _mm512_avg_epu8(_mm512_xor_si512(a, flip), _mm512_xor_si512(b, flip));
            _mm512_xor_si512(average, flip)
        };
        let pairs = 64 / CHANNELS;
        let mut done = 0;
        while let (Some(from), Some(to)) = (
            pixels.get(2 * done * CHANNELS..).and_then(<[u8]>::first_chunk::<128>),
            out.get_mut(done * CHANNELS..).and_then(<[u8]>::first_chunk_mut::<64>),
        ) {
            // SAFETY: the arrays are 128 and 64 bytes.
            unsafe {
                let (low, high) =
                    (_mm512_loadu_si512(from.as_ptr().cast()), _mm512_loadu_si512(from[64..].as_ptr().cast()));
                _mm512_storeu_si512(to.as_mut_ptr().cast(), pairs_of(low, high));
            }
            done += pairs;
        }
        // what is left, at most a vector's worth, byte by byte as far as there are any
        let count = ((pixels.len() / 2).min(out.len()) / CHANNELS - done).min(pairs);
        let (from, to) = (&pixels[2 * done * CHANNELS..], &mut out[done * CHANNELS..]);
        let bytes = count * CHANNELS;
        let first = |count: usize| if count < 64 { (1u64 << count) - 1 } else { u64::MAX };
        assert!(2 * bytes <= from.len() && bytes <= to.len());
        // SAFETY: nothing is loaded or stored without its bit, and so many bytes exist.
        unsafe {
            let low = _mm512_maskz_loadu_epi8(first(2 * bytes), from.as_ptr().cast());
            let rest = first((2 * bytes).saturating_sub(64));
            let high = _mm512_maskz_loadu_epi8(rest, from.as_ptr().wrapping_add(64).cast());
            let average = pairs_of(low, high);
            _mm512_mask_storeu_epi8(to.as_mut_ptr().cast(), first(bytes), average);
        }
        done + count
    }

    /// 8 bytes at a time.
    #[target_feature(enable = "avx2")]
    pub(super) fn avx2<const CHANNELS: usize>(up: bool, pixels: &[u8], out: &mut [u8]) -> usize {
        let order = const { left::<CHANNELS, 8>() };
        // SAFETY: the array is 8 bytes.
        let left = unsafe { _mm_loadl_epi64(order.as_ptr().cast()) };
        let right = _mm_add_epi8(left, _mm_set1_epi8(CHANNELS as i8));
        let flip = _mm_set1_epi8(if up { 0 } else { -1 });
        let pairs = 8 / CHANNELS;
        let mut done = 0;
        while let (Some(from), Some(to)) = (
            pixels.get(2 * done * CHANNELS..).and_then(<[u8]>::first_chunk::<16>),
            out.get_mut(done * CHANNELS..).and_then(<[u8]>::first_chunk_mut::<8>),
        ) {
            // SAFETY: the arrays are 16 and 8 bytes.
            unsafe {
                let bytes = _mm_xor_si128(_mm_loadu_si128(from.as_ptr().cast()), flip);
                let [a, b] = [left, right].map(|order| _mm_shuffle_epi8(bytes, order));
                _mm_storel_epi64(to.as_mut_ptr().cast(), _mm_xor_si128(_mm_avg_epu8(a, b), flip));
            }
            done += pairs;
        }
        done
    }
}

#[cfg(test)]
mod tests {
    use super::super::average::Average;
    use super::*;

    #[test]
    fn boxes_in_one_go_are_those_made_step_by_step() {
        let mut state = 1u32;
        let mut byte = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        for (channels, kx, ky, count) in (1..=5).flat_map(|channels| {
            (1..=5u32).flat_map(move |kx| {
                (0..=4)
                    .flat_map(move |ky| [1, 14, 15, 19, 20, 21, 41, 63, 64, 150].map(|count| (channels, kx, ky, count)))
            })
        }) {
            // no byte more than boxes have
            let samples = ((count + 1) * channels) << (kx - 1);
            let rows = if ky > 2 { 1 } else { 1 << ky };
            let rows: Vec<Vec<u8>> = (0..rows).map(|_| (0..samples).map(|_| byte()).collect()).collect();
            let rows: Vec<&[u8]> = rows.iter().map(|row| &row[..]).collect();

            let mut row = rows[0].to_vec();
            match *rows {
                [a, b] => u8::halve(Isa::Scalar, true, a, b, &mut row),
                [a, b, c, d] => u8::quarter(Isa::Scalar, true, [a, b, c, d], &mut row),
                _ => {}
            }
            for k in 0..kx - 1 {
                let mut next = vec![0; row.len() / 2];
                u8::halve_pairs(Isa::Scalar, (k + ky).is_multiple_of(2), channels, &row, &mut next);
                row = next;
            }
            let mut expected = vec![0; count * channels];
            u8::halve(Isa::Scalar, (kx - 1 + ky).is_multiple_of(2), &row, &row[channels..], &mut expected);

            for &isa in Isa::available() {
                let mut out = vec![7; count * channels];
                let case = format!("{isa:?}, {channels} channels, {kx} x {ky}, {count} boxes");
                if <u8 as Pairs>::boxes(isa, channels, [kx, ky], &rows, &mut out) {
                    assert_eq!(out, expected, "{case}");
                } else {
                    assert!(out.iter().all(|&byte| byte == 7), "{case}");
                    let widths = by_isa!(isa, Scalar => 0..0, Avx2 => 1..5, Avx512 => 2..5, Neon => 0..0);
                    let enough = isa == Isa::Avx2 || count >= 64 / channels;
                    assert!(channels > 4 || !widths.contains(&kx) || !enough, "{case}");
                }
            }
        }
    }
}
