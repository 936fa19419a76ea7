//! Weights of neighbouring cells that the same views see, worked out for all of them at once.

use super::WHAT;
use super::pieces::ONE;
use crate::error::Result;
use crate::isa::{Isa, for_each_isa};
use crate::view::buffer;

/// Weights of less than this share are left out: a camera that is hardly seen costs as much as another.
const LEAST_SHARE: u32 = 64;

/// No raw weight is larger. Those of [`MAX_CAMERAS`](super::MAX_CAMERAS) views sum to less than 2^31, and [`LEAST_SHARE`]
/// times one of them is less too.
pub(super) const MOST_RAW: u32 = (1 << 24) + 1;

/// Cells are worked on so many at a time, the last ones of a lot with what lies behind them: a seam is often a dozen cells
/// wide, and five cells one by one take longer than eight at once.
pub(super) const STEP: usize = 8;

/// The weights of some views in neighbouring cells: first raw ones, in any proportion, then those that sum to [`ONE`].
///
/// The memory is kept from one lot of cells to the next.
#[derive(Default)]
pub(super) struct Shares {
    cells: usize,
    /// The cells, and those behind them that are worked on too.
    worked: usize,
    views: usize,
    /// Of each view the weights of the cells.
    raw: Vec<Vec<u32>>,
    weights: Vec<Vec<u16>>,
    sums: Vec<u32>,
    left: Vec<u32>,
    /// For each cell the place of the view of the largest weight, of equals of the first.
    largest: Vec<u8>,
    /// For each cell the places of the views that have a weight, as bits.
    shown: Vec<u64>,
}

impl Shares {
    /// Makes room for so many views in so many cells.
    pub(super) fn begin(&mut self, views: usize, cells: usize) -> Result<()> {
        (self.cells, self.worked, self.views) = (cells, cells.next_multiple_of(STEP), views);
        let cells = self.worked;
        while self.raw.len() < views {
            buffer::push(WHAT, &mut self.raw, Vec::new())?;
            buffer::push(WHAT, &mut self.weights, Vec::new())?;
        }
        self.raw[..views].iter_mut().try_for_each(|raw| grow(raw, cells))?;
        self.weights[..views].iter_mut().try_for_each(|weights| grow(weights, cells))?;
        grow(&mut self.sums, cells)?;
        grow(&mut self.left, cells)?;
        grow(&mut self.largest, cells)?;
        grow(&mut self.shown, cells)
    }

    /// The raw weights of the view at this place, to be written: at most [`MOST_RAW`], and not 0 for every view. Behind
    /// those of the cells are as many as make them a multiple of [`STEP`], which count for nothing.
    pub(super) fn raw(&mut self, place: usize) -> &mut [u32] {
        &mut self.raw[place][..self.worked]
    }

    /// The weights of the cells for the view at this place.
    pub(super) fn of(&self, place: usize) -> &[u16] {
        &self.weights[place][..self.cells]
    }

    /// Makes weights of the raw ones: in their proportion without the smallest, rounded down; what is left then goes to
    /// the largest.
    pub(super) fn settle(&mut self, isa: Isa) {
        // one call for all passes: a seam is often a dozen cells wide
        let shares = self;
        if shares.views == 2 {
            for_each_isa!(isa, (settle_two, settle_two, settle_two)(shares: &mut Shares));
        } else {
            for_each_isa!(isa, (settle, settle, settle)(shares: &mut Shares));
        }
    }

    /// Neighbouring cells that the same views show, one of them with the largest weight throughout: how many they are, the
    /// place of that view, and the places of all as bits.
    pub(super) fn alike(&self) -> impl Iterator<Item = (usize, u8, u64)> {
        let (largest, shown) = (&self.largest[..self.cells], &self.shown[..self.cells]);
        let mut first = 0;
        std::iter::from_fn(move || {
            let kind = (*largest.get(first)?, shown[first]);
            let same = largest[first..].iter().zip(&shown[first..]);
            let count = same.take_while(|&(&largest, &shown)| (largest, shown) == kind).count();
            first += count;
            Some((count, kind.0, kind.1))
        })
    }
}

/// Makes a buffer at least so long.
fn grow<T: Clone + Default>(buffer: &mut Vec<T>, cells: usize) -> Result<()> {
    if buffer.len() < cells { buffer::resize(WHAT, buffer, cells, T::default()) } else { Ok(()) }
}

#[inline(always)]
fn settle(all: &mut Shares) {
    let (cells, views) = (all.worked, all.views);
    let (raw, weights) = (&mut all.raw[..views], &mut all.weights[..views]);
    let (sums, left) = (&mut all.sums[..cells], &mut all.left[..cells]);
    let (largest, shown) = (&mut all.largest[..cells], &mut all.shown[..cells]);
    sum(raw, sums);
    for raw in raw.iter_mut() {
        raw.iter_mut().zip(&*sums).for_each(|(raw, &sum)| *raw = if *raw * LEAST_SHARE >= sum { *raw } else { 0 });
    }
    sum(raw, sums);
    left.fill(ONE);
    shown.fill(0);
    for (place, (raw, weights)) in raw.iter().zip(weights.iter_mut()).enumerate() {
        // In f64 the quotient of integers below 2^40 and 2^31 is off by less than 2^-38, and one that is no integer is
        // at least 2^-31 away from the next: rounding it down is exact.
        for (((&raw, &sum), weight), left) in raw.iter().zip(&*sums).zip(&mut *weights).zip(&mut *left) {
            let share = (f64::from(raw as i32) * f64::from(ONE) / f64::from(sum as i32)) as i32 as u32;
            *weight = share as u16;
            *left -= share;
        }
        let bit = 1 << place;
        shown.iter_mut().zip(&*weights).for_each(|(shown, &weight)| *shown |= if weight > 0 { bit } else { 0 });
    }
    // the sums are done with: the largest weights so far
    sums.fill(0);
    largest.fill(0);
    for (place, weights) in weights.iter().enumerate() {
        for ((&weight, most), largest) in weights.iter().zip(&mut *sums).zip(&mut *largest) {
            let (weight, wins) = (u32::from(weight), u32::from(weight) > *most);
            *most = if wins { weight } else { *most };
            *largest = if wins { place as u8 } else { *largest };
        }
    }
    for (cell, (&largest, &left)) in largest.iter().zip(&*left).enumerate() {
        weights[usize::from(largest)][cell] += left as u16;
    }
}

/// [`settle`] of two views, as nearly all seams are: one division for each cell, of float32, in a third of the time.
#[inline(always)]
fn settle_two(all: &mut Shares) {
    let cells = all.worked;
    let (raw, weights) = (&all.raw[..2], &mut all.weights[..2]);
    let (ones, others) = (&raw[0][..cells], &raw[1][..cells]);
    let [one_weights, other_weights] = weights else { unreachable!("two views") };
    let (one_weights, other_weights) = (&mut one_weights[..cells], &mut other_weights[..cells]);
    let (largest, shown) = (&mut all.largest[..cells], &mut all.shown[..cells]);
    for i in 0..cells {
        let (one, other) = (ones[i], others[i]);
        let (sum, less) = (one + other, one.min(other));
        // The quotient is at most half of ONE and off by less than 1, so it is rounded down by what remains; that is
        // less than twice the sum, whose 26 bits fit, also where products wrapped around.
        let guess = (less as i32 as f32 * ONE as f32 / sum as i32 as f32) as i32 as u32;
        let remains = less.wrapping_mul(ONE).wrapping_sub(guess.wrapping_mul(sum)) as i32;
        let share = guess + u32::from(remains >= sum as i32) - u32::from(remains < 0);
        let share = if less * LEAST_SHARE >= sum { share } else { 0 };
        let wins = other > one;
        one_weights[i] = if wins { share } else { ONE - share } as u16;
        other_weights[i] = if wins { ONE - share } else { share } as u16;
        largest[i] = u8::from(wins);
        shown[i] = if share > 0 { 0b11 } else { 1 << u32::from(wins) };
    }
}

/// The sums over the views.
#[inline(always)]
fn sum(raw: &[Vec<u32>], sums: &mut [u32]) {
    sums.fill(0);
    for raw in raw {
        sums.iter_mut().zip(raw).for_each(|(sum, &raw)| *sum += raw);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights of one cell.
    fn settled(raw: &[u32]) -> (Vec<u16>, Vec<(usize, u8, u64)>) {
        let mut shares = Shares::default();
        shares.begin(raw.len(), 1).unwrap();
        raw.iter().enumerate().for_each(|(place, &raw)| shares.raw(place)[0] = raw);
        shares.settle(Isa::Scalar);
        ((0..raw.len()).map(|place| shares.of(place)[0]).collect(), shares.alike().collect())
    }

    #[test]
    fn weights_sum_to_one_and_the_smallest_are_left_out() {
        assert_eq!(settled(&[1 << 24, 1, 1 << 24]), (vec![1 << 14, 0, 1 << 14], vec![(1, 0, 0b101)]));
        let (weights, _) = settled(&[3, 1, 3]);
        assert_eq!(weights.iter().copied().map(u32::from).sum::<u32>(), ONE);
        assert!(weights[0] > weights[2] && weights[2] > 2 * weights[1], "the rest goes to the largest: {weights:?}");
        assert_eq!(settled(&[0, 5, 0]), (vec![0, 1 << 15, 0], vec![(1, 1, 0b010)]));
    }

    #[test]
    fn shares_are_those_of_integer_division_on_every_isa() {
        // steps that meet exact quotients and their neighbours, on both sides of the least share
        let raws = || (0..40u32).map(|n| (n * n * 419 + n) % (MOST_RAW + 1)).chain(MOST_RAW - 5..=MOST_RAW);
        let pairs: Vec<[u32; 2]> =
            raws().flat_map(|one| raws().map(move |two| [one, two])).filter(|pair| *pair != [0, 0]).collect();
        for &isa in Isa::available() {
            let mut shares = Shares::default();
            shares.begin(2, pairs.len()).unwrap();
            (0..2).for_each(|place| {
                shares.raw(place).iter_mut().zip(&pairs).for_each(|(raw, pair)| *raw = pair[place]);
            });
            shares.settle(isa);
            for (cell, pair) in pairs.iter().enumerate() {
                let kept = pair.map(|raw| if raw * 64 >= pair[0] + pair[1] { u64::from(raw) } else { 0 });
                let mut expected = kept.map(|raw| raw * u64::from(ONE) / (kept[0] + kept[1]));
                expected[usize::from(expected[1] > expected[0])] += u64::from(ONE) - expected[0] - expected[1];
                assert_eq!([shares.of(0)[cell], shares.of(1)[cell]].map(u64::from), expected, "{pair:?} {isa:?}");
            }
            assert_eq!(shares.alike().map(|(count, ..)| count).sum::<usize>(), pairs.len());
            for (cell, pair) in pairs.iter().enumerate() {
                let weights = [shares.of(0)[cell], shares.of(1)[cell]];
                let shown = u64::from(weights[0] > 0) | u64::from(weights[1] > 0) << 1;
                assert_eq!(
                    (shares.largest[cell], shares.shown[cell]),
                    (u8::from(pair[1] > pair[0]), shown),
                    "{pair:?}"
                );
            }
        }
    }

    #[test]
    fn two_views_share_as_any_number_does() {
        let raws = [1, 2, 63, 64, 65, 1000, 262_143, 262_144, (1 << 23) - 1, 1 << 23, (1 << 24) - 1, 1 << 24, MOST_RAW];
        for one in raws {
            for other in raws {
                let (mut two, mut many) = (Shares::default(), Shares::default());
                for shares in [&mut two, &mut many] {
                    shares.begin(2, 1).unwrap();
                    (shares.raw(0)[0], shares.raw(1)[0]) = (one, other);
                }
                settle_two(&mut two);
                settle(&mut many);
                assert_eq!([two.of(0), two.of(1)], [many.of(0), many.of(1)], "{one} {other}");
                assert!(two.alike().eq(many.alike()), "{one} {other}");
            }
        }
    }
}
