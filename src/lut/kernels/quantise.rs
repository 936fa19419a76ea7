//! Coordinates to taps.

use std::mem::MaybeUninit;
use std::ops::Range;

use super::for_each_isa;
use crate::cpu::Isa;
use crate::lut::tap::{ONE, RunKind, Tap};

/// Added to a float64 from 0 to 2^52, it leaves the whole part, rounded to even, in the low bits.
const WHOLE: f64 = (1u64 << 52) as f64;

/// What each cell of a row is.
#[derive(Default)]
pub(crate) struct Kinds {
    kinds: Vec<u8>,
}

impl Kinds {
    /// The kind and the cells of each run, from left to right.
    pub(crate) fn runs(&self) -> impl Iterator<Item = (RunKind, Range<usize>)> {
        let mut next = 0;
        std::iter::from_fn(move || {
            let first = next;
            let &kind = self.kinds.get(first)?;
            next += equal_prefix(&self.kinds[first..], kind);
            Some((RunKind::from_byte(kind), first..next))
        })
    }
}

/// Fills room for taps with zeros.
pub(crate) fn zeroed(room: &mut [MaybeUninit<Tap>]) -> &mut [Tap] {
    room.fill(MaybeUninit::new(Tap::default()));
    // SAFETY: all of them have just been written, and the room has the layout of taps.
    unsafe { &mut *(std::ptr::from_mut(room) as *mut [Tap]) }
}

/// Works out the cells that sample at (us[i], vs[i]): what they are, and their taps as if all were inside.
pub(crate) fn quantise(isa: Isa, us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [Tap], kinds: &mut Kinds) {
    kinds.kinds.resize(us.len(), 0);
    let kinds = &mut kinds.kinds[..];
    // SAFETY: a tap is 8 bytes with the alignment of a number, and any bits are one.
    let taps = unsafe { std::slice::from_raw_parts_mut(taps.as_mut_ptr().cast::<u64>(), taps.len()) };
    quantise_inside(isa, us, vs, source, taps, kinds);
    // most cells are inside; of the others it is found out what they are
    let mut next = 0;
    while next < kinds.len() {
        next += equal_prefix(&kinds[next..], RunKind::Inside as u8);
        let others = next..next + equal_prefix(&kinds[next..], RunKind::Outside as u8);
        next = others.end;
        classify(isa, &us[others.clone()], &vs[others.clone()], source, &mut kinds[others]);
    }
}

fn quantise_inside(isa: Isa, us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [u64], kinds: &mut [u8]) {
    for_each_isa!(
        isa,
        (taps_of_row::<Plain>, taps_of_row::<Rounding<false>>, taps_of_row::<Rounding<true>>)(
            us: &[f64], vs: &[f64], source: (u32, u32), taps: &mut [u64], kinds: &mut [u8]
        )
    );
}

fn classify(isa: Isa, us: &[f64], vs: &[f64], source: (u32, u32), kinds: &mut [u8]) {
    for_each_isa!(
        isa,
        (kinds_of_cells, kinds_of_cells, kinds_of_cells)(us: &[f64], vs: &[f64], source: (u32, u32), kinds: &mut [u8])
    );
}

/// How many entries at the start of `kinds` are `kind`.
fn equal_prefix(kinds: &[u8], kind: u8) -> usize {
    let word = [kind; 16];
    let words = kinds.as_chunks::<16>().0.iter().take_while(|&&sixteen| sixteen == word).count();
    16 * words + kinds[16 * words..].iter().take_while(|&&entry| entry == kind).count()
}

/// The taps of all cells, and [`RunKind::Inside`] or else [`RunKind::Outside`] for each.
#[inline(always)]
fn taps_of_row<A: Arithmetic>(us: &[f64], vs: &[f64], (width, height): (u32, u32), taps: &mut [u64], kinds: &mut [u8]) {
    let cells = us.len();
    let (vs, taps, kinds) = (&vs[..cells], &mut taps[..cells], &mut kinds[..cells]);
    // within 2^-16 of the last pixel a coordinate becomes that pixel, which has no next: such cells are on the rim
    let (last_u, last_v) = (f64::from(width) - 1.0 - 1.0 / STEPS, f64::from(height) - 1.0 - 1.0 / STEPS);
    let stride = f64::from(width);
    let first = WHOLE - stride - 1.0; // the axes count from 1
    // by index: of zipped iterators the compiler makes no vectors
    for i in 0..cells {
        let (u, v) = (us[i], vs[i]);
        let inside = (u >= 0.0) & (u < last_u) & (v >= 0.0) & (v < last_v); // NaN is not
        // elsewhere the tap is anything at all, and not used
        let (x, fx) = axis::<A>(u);
        let (y, fy) = axis::<A>(v);
        let offset = (A::exact_mul_add(y, stride, x) + first).to_bits() & 0xffff_ffff;
        let fractions = (A::exact_mul_add(fy, 65536.0, fx) + WHOLE).to_bits() & 0xffff_ffff;
        // in memory as the fields of `Tap`: offset, x, y
        taps[i] = if cfg!(target_endian = "little") {
            offset | fractions << 32
        } else {
            offset << 32 | (fractions & 0xffff) << 16 | fractions >> 16
        };
        kinds[i] = u8::from(inside);
    }
}

/// What cells are that [`taps_of_row`] did not find inside.
#[inline(always)]
fn kinds_of_cells(us: &[f64], vs: &[f64], (width, height): (u32, u32), kinds: &mut [u8]) {
    let cells = us.len();
    let (vs, kinds) = (&vs[..cells], &mut kinds[..cells]);
    let (w, h) = (f64::from(width), f64::from(height));
    for i in 0..cells {
        let (u, v) = (us[i], vs[i]);
        let near = (u > -1.0) & (u < w) & (v > -1.0) & (v < h); // NaN is not
        let valid = (u >= 0.0) & (v >= 0.0) & (u <= w - 1.0) & (v <= h - 1.0);
        // outside 0, rim 2, halo 3
        kinds[i] = u8::from(near) * (3 - u8::from(valid));
    }
}

const STEPS: f64 = ONE as f64;

/// One more than the whole pixel at or before a coordinate above -1, and the Q15 fraction, plus 32768 where the nearest
/// pixel is the next one. Within 2^-16 of the next pixel the coordinate is that pixel.
#[inline(always)]
fn axis<A: Arithmetic>(coordinate: f64) -> (f64, f64) {
    // one pixel more than it is, so that it is positive, in steps, rounded half up
    let steps = A::floor(A::exact_mul_add(coordinate, STEPS, STEPS + 0.5));
    let pixel = A::floor(steps * (1.0 / STEPS));
    let fraction = A::exact_mul_add(pixel, -STEPS, steps);
    let step = A::nearest(coordinate) - pixel + 1.0; // half to even, as np.round: 0 or 1
    (pixel, A::exact_mul_add(step, STEPS, fraction))
}

/// Operations that the instruction sets have in different forms, with the same results.
trait Arithmetic {
    /// The floor of a number from 0 to 2^51.
    fn floor(number: f64) -> f64;
    /// The nearest whole number, halves to even, of a number below 2^51.
    fn nearest(number: f64) -> f64;
    /// a b + c, where a b is exact: fused or not is the same.
    fn exact_mul_add(a: f64, b: f64, c: f64) -> f64;
}

/// Without an instruction for rounding: the baseline.
struct Plain;

impl Arithmetic for Plain {
    #[inline(always)]
    fn floor(number: f64) -> f64 {
        let rounded = (number + WHOLE) - WHOLE;
        rounded - if rounded > number { 1.0 } else { 0.0 }
    }

    #[inline(always)]
    fn nearest(number: f64) -> f64 {
        (number + 1.5 * WHOLE) - 1.5 * WHOLE
    }

    #[inline(always)]
    fn exact_mul_add(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

/// With one, and where `FUSED` with one that multiplies and adds.
#[cfg(target_arch = "x86_64")]
struct Rounding<const FUSED: bool>;

#[cfg(target_arch = "x86_64")]
impl<const FUSED: bool> Arithmetic for Rounding<FUSED> {
    #[inline(always)]
    fn floor(number: f64) -> f64 {
        number.floor()
    }

    #[inline(always)]
    fn nearest(number: f64) -> f64 {
        number.round_ties_even()
    }

    #[inline(always)]
    fn exact_mul_add(a: f64, b: f64, c: f64) -> f64 {
        if FUSED { a.mul_add(b, c) } else { a * b + c }
    }
}

/// The whole pixel and the packed fraction of one coordinate.
pub(crate) fn quantise_one(coordinate: f64) -> (i64, u16) {
    let (pixel, fraction) = axis::<Plain>(coordinate);
    (pixel as i64 - 1, fraction as u16)
}
