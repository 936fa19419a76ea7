//! Averages, sample by sample: of two rows, of four, and of the probes of a footprint.

use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;

/// A sample of which averages can be taken. All instruction sets run the same plain loops, so they agree to the last
/// bit.
pub trait Average: Sized {
    /// The sum of a footprint's probes.
    type Sum: Copy + Default + Send + Sync;

    /// `out[i]` is the average of `a[i]` and `b[i]`; integers that lie halfway go `up` or down.
    fn halve(isa: Isa, up: bool, a: &[Self], b: &[Self], out: &mut [Self]);

    /// The average of `rows[0]` and `rows[1]`, of `rows[2]` and `rows[3]`, and of these two, which are rounded the other
    /// way.
    fn quarter(isa: Isa, up: bool, rows: [&[Self]; 4], out: &mut [Self]);

    /// Adds another probe of every cell; `first` is their first probe, which is no part of the sums.
    fn add(isa: Isa, first: &[Self], probe: &[Self], sums: &mut [Self::Sum]);

    /// The averages of `count` probes, in place of the first ones. `lean` undoes what rounding halfway numbers up in one
    /// more step than down has added: a quarter.
    fn finish(isa: Isa, count: u32, lean: bool, sums: &[Self::Sum], cells: &mut [Self]);
}

macro_rules! average {
    ($type:ty, $sum:ty, $up:expr, $down:expr, $add:expr, $finish:expr) => {
        impl Average for $type {
            type Sum = $sum;

            fn halve(isa: Isa, up: bool, a: &[$type], b: &[$type], out: &mut [$type]) {
                #[inline(always)]
                fn body(up: bool, a: &[$type], b: &[$type], out: &mut [$type]) {
                    let samples = out.len();
                    let (a, b) = (&a[..samples], &b[..samples]);
                    if up {
                        (0..samples).for_each(|i| out[i] = $up(a[i], b[i]));
                    } else {
                        (0..samples).for_each(|i| out[i] = $down(a[i], b[i]));
                    }
                }
                for_each_isa!(isa, (body, body, body)(up: bool, a: &[$type], b: &[$type], out: &mut [$type]));
            }

            fn quarter(isa: Isa, up: bool, rows: [&[$type]; 4], out: &mut [$type]) {
                #[inline(always)]
                fn body(up: bool, rows: [&[$type]; 4], out: &mut [$type]) {
                    let samples = out.len();
                    let [a, b, c, d] = rows.map(|row| &row[..samples]);
                    if up {
                        (0..samples).for_each(|i| out[i] = $down($up(a[i], b[i]), $up(c[i], d[i])));
                    } else {
                        (0..samples).for_each(|i| out[i] = $up($down(a[i], b[i]), $down(c[i], d[i])));
                    }
                }
                for_each_isa!(isa, (body, body, body)(up: bool, rows: [&[$type]; 4], out: &mut [$type]));
            }

            fn add(isa: Isa, first: &[$type], probe: &[$type], sums: &mut [$sum]) {
                #[inline(always)]
                fn body(first: &[$type], probe: &[$type], sums: &mut [$sum]) {
                    let samples = sums.len();
                    let (first, probe) = (&first[..samples], &probe[..samples]);
                    (0..samples).for_each(|i| sums[i] = $add(sums[i], first[i], probe[i]));
                }
                for_each_isa!(isa, (body, body, body)(first: &[$type], probe: &[$type], sums: &mut [$sum]));
            }

            fn finish(isa: Isa, count: u32, lean: bool, sums: &[$sum], cells: &mut [$type]) {
                #[inline(always)]
                fn body(count: u32, lean: bool, sums: &[$sum], cells: &mut [$type]) {
                    let samples = cells.len();
                    let sums = &sums[..samples];
                    let finish = $finish(count, lean);
                    (0..samples).for_each(|i| cells[i] = finish(sums[i], cells[i]));
                }
                for_each_isa!(isa, (body, body, body)(count: u32, lean: bool, sums: &[$sum], cells: &mut [$type]));
            }
        }
    };
}

// At most 256 probes: their sum fits 16 bits. A quotient is a whole number of 1 / 2 count from a whole number, so half of
// that added keeps the rounding of the multiplication from reaching the next one.
average!(
    u8,
    u16,
    |a: u8, b: u8| ((u16::from(a) + u16::from(b) + 1) >> 1) as u8,
    |a: u8, b: u8| ((u16::from(a) + u16::from(b)) >> 1) as u8,
    |sum: u16, _: u8, probe: u8| sum + u16::from(probe),
    |count: u32, lean: bool| {
        let half = count as f32 * if lean { 0.25 } else { 0.5 } + 0.25;
        let inverse = 1.0 / count as f32;
        move |sum: u16, first: u8| ((f32::from(sum) + f32::from(first) + half) * inverse) as i32 as u8
    }
);

average!(
    u16,
    u32,
    |a: u16, b: u16| ((u32::from(a) + u32::from(b) + 1) >> 1) as u16,
    |a: u16, b: u16| ((u32::from(a) + u32::from(b)) >> 1) as u16,
    |sum: u32, _: u16, probe: u16| sum + u32::from(probe),
    |count: u32, lean: bool| {
        let half = f64::from(count) * if lean { 0.25 } else { 0.5 } + 0.25;
        let inverse = 1.0 / f64::from(count);
        move |sum: u32, first: u16| ((f64::from(sum) + f64::from(first) + half) * inverse) as i32 as u16
    }
);

// differences from the first probe: those of a constant image are 0, whatever their number
average!(
    f32,
    f32,
    |a: f32, b: f32| a * 0.5 + b * 0.5,
    |a: f32, b: f32| a * 0.5 + b * 0.5,
    |sum: f32, first: f32, probe: f32| sum + (probe - first),
    |count: u32, _| {
        let inverse = 1.0 / count as f32;
        move |sum: f32, first: f32| first + sum * inverse
    }
);
