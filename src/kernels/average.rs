//! Averages, sample by sample: of two rows, of four, and of the probes of a footprint.

use super::halve::Pairs;
use crate::isa::Isa;
use crate::isa::for_each_isa;

/// A sample of which averages can be taken. All instruction sets run the same plain loops, so they agree to the last
/// bit.
pub(crate) trait Average: Sized {
    /// See [`Pairs::boxes`].
    fn boxes(isa: Isa, channels: usize, k: [u32; 2], rows: &[&[Self]], out: &mut [Self]) -> bool;

    /// The sum of a footprint's probes.
    type Sum: Copy + Default + Send + Sync;

    /// `out[i]` is the average of `a[i]` and `b[i]`; integers that lie halfway go `up` or down.
    fn halve(isa: Isa, up: bool, a: &[Self], b: &[Self], out: &mut [Self]);

    /// The averages of neighbouring pixels, each pixel in one of them.
    fn halve_pairs(isa: Isa, up: bool, channels: usize, pixels: &[Self], out: &mut [Self]);

    /// The average of `rows[0]` and `rows[1]`, of `rows[2]` and `rows[3]`, and of these two, which are rounded the other
    /// way.
    fn quarter(isa: Isa, up: bool, rows: [&[Self]; 4], out: &mut [Self]);

    /// The sum with another probe; `first` is the cell's first one, which is no part of it.
    fn accumulate(sum: Self::Sum, first: Self, probe: Self) -> Self::Sum;

    /// [`Average::accumulate`] for neighbouring cells.
    fn add(isa: Isa, first: &[Self], probe: &[Self], sums: &mut [Self::Sum]);

    /// The averages of `count` probes, in place of the first ones. `round_bias` undoes what rounding halfway numbers up in one
    /// more step than down has added: a quarter.
    fn finish(isa: Isa, count: u32, round_bias: bool, sums: &[Self::Sum], cells: &mut [Self]);
}

macro_rules! average {
    ($type:ty, $sum:ty, $up:expr, $down:expr, $add:expr, $finish:expr) => {
        impl Average for $type {
            type Sum = $sum;

            fn boxes(isa: Isa, channels: usize, k: [u32; 2], rows: &[&[$type]], out: &mut [$type]) -> bool {
                <$type as Pairs>::boxes(isa, channels, k, rows, out)
            }

            fn halve(isa: Isa, up: bool, a: &[$type], b: &[$type], out: &mut [$type]) {
                #[inline(always)]
                fn body(up: bool, a: &[$type], b: &[$type], out: &mut [$type]) {
                    let samples = out.len();
                    let (a, b) = (&a[..samples], &b[..samples]);
                    if up {
                        for i in 0..samples {
                        out[i] = $up(a[i], b[i]);
                    }
                    } else {
                        for i in 0..samples {
                        out[i] = $down(a[i], b[i]);
                    }
                    }
                }
                for_each_isa!(isa, (body, body, body)(up: bool, a: &[$type], b: &[$type], out: &mut [$type]));
            }

            fn halve_pairs(isa: Isa, up: bool, channels: usize, pixels: &[$type], out: &mut [$type]) {
                let done = <$type as Pairs>::whole_vectors(isa, up, channels, pixels, out);
                let (pixels, out) = (&pixels[2 * done * channels..], &mut out[done * channels..]);
                /// `CHANNELS` is 0 for other numbers of them.
                #[inline(always)]
                fn some<const CHANNELS: usize>(up: bool, channels: usize, pixels: &[$type], out: &mut [$type]) {
                    let channels = if CHANNELS == 0 { channels } else { CHANNELS };
                    for (pair, out) in pixels.chunks_exact(2 * channels).zip(out.chunks_exact_mut(channels)) {
                        let (left, right) = pair.split_at(channels);
                        for ((out, &a), &b) in out.iter_mut().zip(left).zip(right) {
                            *out = if up { $up(a, b) } else { $down(a, b) };
                        }
                    }
                }
                #[inline(always)]
                fn body(up: bool, channels: usize, pixels: &[$type], out: &mut [$type]) {
                    match channels {
                        1 => some::<1>(up, channels, pixels, out),
                        3 => some::<3>(up, channels, pixels, out),
                        4 => some::<4>(up, channels, pixels, out),
                        _ => some::<0>(up, channels, pixels, out),
                    }
                }
                for_each_isa!(isa, (body, body, body)(
                    up: bool, channels: usize, pixels: &[$type], out: &mut [$type]
                ));
            }

            fn quarter(isa: Isa, up: bool, rows: [&[$type]; 4], out: &mut [$type]) {
                #[inline(always)]
                fn body(up: bool, rows: [&[$type]; 4], out: &mut [$type]) {
                    let samples = out.len();
                    let [a, b, c, d] = rows.map(|row| &row[..samples]);
                    if up {
                        for i in 0..samples {
                        out[i] = $down($up(a[i], b[i]), $up(c[i], d[i]));
                    }
                    } else {
                        for i in 0..samples {
                        out[i] = $up($down(a[i], b[i]), $down(c[i], d[i]));
                    }
                    }
                }
                for_each_isa!(isa, (body, body, body)(up: bool, rows: [&[$type]; 4], out: &mut [$type]));
            }

            #[inline(always)]
            fn accumulate(sum: $sum, first: $type, probe: $type) -> $sum {
                $add(sum, first, probe)
            }

            fn add(isa: Isa, first: &[$type], probe: &[$type], sums: &mut [$sum]) {
                #[inline(always)]
                fn body(first: &[$type], probe: &[$type], sums: &mut [$sum]) {
                    let samples = sums.len();
                    let (first, probe) = (&first[..samples], &probe[..samples]);
                    for i in 0..samples {
                        sums[i] = $add(sums[i], first[i], probe[i]);
                    }
                }
                for_each_isa!(isa, (body, body, body)(first: &[$type], probe: &[$type], sums: &mut [$sum]));
            }

            fn finish(isa: Isa, count: u32, round_bias: bool, sums: &[$sum], cells: &mut [$type]) {
                #[inline(always)]
                fn body(count: u32, round_bias: bool, sums: &[$sum], cells: &mut [$type]) {
                    let samples = cells.len();
                    let sums = &sums[..samples];
                    let finish = $finish(count, round_bias);
                    for i in 0..samples {
                        cells[i] = finish(sums[i], cells[i]);
                    }
                }
                for_each_isa!(isa, (body, body, body)(count: u32, round_bias: bool, sums: &[$sum], cells: &mut [$type]));
            }
        }
    };
}

/// Halfway down: halfway up of what is left to the largest number. The compiler knows the instruction for up alone.
macro_rules! halfway {
    ($type:ty, $wide:ty) => {
        (
            |a: $type, b: $type| ((<$wide>::from(a) + <$wide>::from(b) + 1) >> 1) as $type,
            |a: $type, b: $type| !(((<$wide>::from(!a) + <$wide>::from(!b) + 1) >> 1) as $type),
        )
    };
}

// The sum of at most 256 probes fits 16 bits. Its quotient is whole, or by 1 / count or more below a whole number; the
// rounded inverse adds less than 2^16 / 2^24, so that the whole part is right, and the product fits 32 bits:
// 255.5 count (2^24 / count + 1) < 2^32.
average!(
    u8,
    u16,
    halfway!(u8, u16).0,
    halfway!(u8, u16).1,
    |sum: u16, _: u8, probe: u8| sum + u16::from(probe),
    |count: u32, round_bias: bool| {
        let (half, inverse) = (count / if round_bias { 4 } else { 2 }, (1u32 << 24).div_ceil(count));
        move |sum: u16, first: u8| (((u32::from(sum) + u32::from(first) + half) * inverse) >> 24) as u8
    }
);

// likewise: 2^25 / 2^40
average!(
    u16,
    u32,
    halfway!(u16, u32).0,
    halfway!(u16, u32).1,
    |sum: u32, _: u16, probe: u16| sum + u32::from(probe),
    |count: u32, round_bias: bool| {
        let (half, inverse) = (count / if round_bias { 4 } else { 2 }, (1u64 << 40).div_ceil(count.into()));
        move |sum: u32, first: u16| ((u64::from(sum + u32::from(first) + half) * inverse) >> 40) as u16
    }
);

// differences from the first probe: those of a constant image are 0, whatever their number
macro_rules! average_floats {
    ($float:ty) => {
        average!(
            $float,
            $float,
            |a: $float, b: $float| a * 0.5 + b * 0.5,
            |a: $float, b: $float| a * 0.5 + b * 0.5,
            |sum: $float, first: $float, probe: $float| sum + (probe - first),
            |count: u32, _| {
                let inverse = 1.0 / <$float>::from(count as u16); // at most 256
                move |sum: $float, first: $float| first + sum * inverse
            }
        );
    };
}
average_floats!(f32);
average_floats!(f64);
