//! The probes of footprints as taps of the bilinear kernels.

use super::footprints::Footprints;
use super::plan::{PatternSpan, RipLevel, RowPlan};
use crate::isa::Isa;
use crate::isa::for_each_isa;
use crate::kernels::FRACTION_BITS;
use crate::kernels::Probes;
use crate::table::Tap;
use crate::table::pattern::SamplePattern;

/// How the taps of a span's probes follow from its footprints.
#[derive(Clone, Copy)]
pub(super) struct Lattice {
    pub(super) pattern: SamplePattern,
    /// Footprints are in 1/1024 pixel after shifting left by so much.
    shift: u8,
    /// From the middle of a box to its top-left pixel, 1/1024 pixel.
    corner: [i32; 2],
    /// log2 of the source's pixels from entry to entry of the level.
    steps: [u32; 2],
    /// The level's first column and row, and how many columns it has.
    first: [i32; 2],
    width: i32,
}

impl Lattice {
    /// `first` are the first column and row of the level, `width` are its columns.
    pub(super) fn new(pattern_span: &PatternSpan, first: [u32; 2], width: usize) -> Self {
        let (box_width, box_height) = pattern_span.pattern.box_size();
        Self {
            pattern: pattern_span.pattern,
            shift: pattern_span.shift,
            corner: [box_width, box_height].map(|size| (size as i32 - 1) << (FRACTION_BITS - 1)),
            steps: [pattern_span.pattern.kx, pattern_span.pattern.ky].map(|k| RipLevel::log_step(k.into())),
            first: first.map(|first| first as i32),
            width: width as i32,
        }
    }

    /// The taps of one probe of neighbouring footprints, none of which may be clipped.
    pub(super) fn taps(self, isa: Isa, probe: (u8, u8), cells: &Footprints, first: usize, taps: &mut [Tap]) {
        let range = first..first + taps.len();
        let sides = cells.sides.each_ref().map(|side| &side[range.clone()]);
        let centre = cells.centre.each_ref().map(|axis| &axis[range.clone()]);
        // SAFETY: a tap is 8 bytes with the alignment of a number, and any bits are one.
        let taps = unsafe { std::slice::from_raw_parts_mut(taps.as_mut_ptr().cast::<u64>(), taps.len()) };
        taps_of_cells(isa, self, self.offsets(probe), centre, sides, taps);
    }

    /// The probes of a span of a row, whose cells have these taps on a source of this width: for kernels that find them
    /// themselves.
    pub(super) fn probes<'a>(
        self,
        plan: &RowPlan<'a>,
        pattern_span: &PatternSpan,
        taps: &'a [Tap],
        width: u32,
    ) -> Probes<'a> {
        let (blocks, first) = plan.blocks(pattern_span);
        Probes {
            taps,
            source_width: width,
            blocks,
            size: plan.size,
            half_rows: plan.half_rows,
            skip: pattern_span.first - first,
            offsets: [SamplePattern::offsets(self.pattern.along), SamplePattern::offsets(self.pattern.down)],
            shift: 14 - u32::from(self.shift),
            origin: [0, 1].map(|axis| self.corner[axis] + (self.first[axis] << (FRACTION_BITS + self.steps[axis]))),
            steps: self.steps,
            round_bias: has_round_bias(self.pattern),
        }
    }

    /// How far a probe is along each side of the footprint, in 1/16384.
    fn offsets(self, (along, down): (u8, u8)) -> [i32; 2] {
        let offset = |index: u8, count: u8| SamplePattern::offsets(count)[usize::from(index)].into();
        [offset(along, self.pattern.along), offset(down, self.pattern.down)]
    }

    /// Calls `probe` for each probe of a footprint that lies on a source of this size, or for its middle where none does: with
    /// the top-left and the bottom-right of the four entries of the whole level that it is blended from, and its fractions.
    /// Returns how many there were.
    pub(super) fn each_probe(
        self,
        cells: &Footprints,
        cell: usize,
        size: [i32; 2],
        mut probe: impl FnMut([usize; 2], [usize; 2], [u32; 2]),
    ) -> u32 {
        let last = self.last_entry(size);
        let mut at = |position: [i32; 2]| {
            let ([x, y], fractions) = self.entry(position, last);
            probe([x, y], [(x + 1).min(last[0] as usize), (y + 1).min(last[1] as usize)], fractions);
        };
        let mut count = 0;
        for position in probes_of(self.pattern).map(|probe| self.position(probe, cells, cell)) {
            if Self::is_inside(position, size) {
                at(position);
                count += 1;
            }
        }
        if count == 0 {
            at([0, 1].map(|axis| cells.centre[axis][cell]));
            count = 1;
        }
        count
    }

    /// Where a probe of one footprint is on the source, 1/1024 pixel.
    fn position(self, probe: (u8, u8), cells: &Footprints, cell: usize) -> [i32; 2] {
        let offsets = self.offsets(probe);
        [0, 1].map(|axis| {
            let sides = [axis, 2 + axis].map(|side| i32::from(cells.sides[side][cell]));
            cells.centre[axis][cell] + probe_offset(self, offsets, sides)
        })
    }

    /// Whether a position lies on a pixel of the image.
    fn is_inside(position: [i32; 2], size: [i32; 2]) -> bool {
        (0..2).all(|axis| (0..size[axis]).contains(&((position[axis] + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS)))
    }

    /// The last column and row of the level of a source of this size.
    fn last_entry(self, [width, height]: [i32; 2]) -> [i32; 2] {
        [(width, self.pattern.kx), (height, self.pattern.ky)]
            .map(|(side, k)| RipLevel::boxes(side as u32, k.into()) as i32 - 1)
    }

    /// The entry of the level whose box is around a position, moved so far that box and neighbours exist: whole column
    /// and row, and fractions in Q15. `last` is the level's last column and row.
    fn entry(self, position: [i32; 2], last: [i32; 2]) -> ([usize; 2], [u32; 2]) {
        let entry = |axis: usize| {
            let at = ((position[axis] - self.corner[axis]) >> self.steps[axis]).clamp(0, last[axis] << FRACTION_BITS);
            ((at >> FRACTION_BITS) as usize, ((at & ((1 << FRACTION_BITS) - 1)) << (15 - FRACTION_BITS)) as u32)
        };
        let ((x, fx), (y, fy)) = (entry(0), entry(1));
        ([x, y], [fx, fy])
    }
}

/// The probes of a pattern.
pub(super) fn probes_of(pattern: SamplePattern) -> impl Iterator<Item = (u8, u8)> {
    (0..pattern.along).flat_map(move |along| (0..pattern.down).map(move |down| (along, down)))
}

/// Whether averages of this pattern's levels were rounded up once more than down.
pub(super) fn has_round_bias(pattern: SamplePattern) -> bool {
    pattern.halvings() % 2 == 1
}

#[inline(always)]
fn probe_offset(lattice: Lattice, offsets: [i32; 2], sides: [i32; 2]) -> i32 {
    (sides[0] * offsets[0] + sides[1] * offsets[1]) >> (14 - lattice.shift)
}

fn taps_of_cells(
    isa: Isa,
    lattice: Lattice,
    offsets: [i32; 2],
    centre: [&[i32]; 2],
    sides: [&[i16]; 4],
    taps: &mut [u64],
) {
    for_each_isa!(isa, (body, body, body)(
        lattice: Lattice, offsets: [i32; 2], centre: [&[i32]; 2], sides: [&[i16]; 4], taps: &mut [u64]
    ));
}

#[inline(always)]
fn body(lattice: Lattice, offsets: [i32; 2], centre: [&[i32]; 2], sides: [&[i16]; 4], taps: &mut [u64]) {
    let cells = taps.len();
    let ([x, y], [ax, ay, bx, by]) = (centre.map(|axis| &axis[..cells]), sides.map(|side| &side[..cells]));
    for i in 0..cells {
        let at = |axis: usize, centre: i32, a: i16, b: i16| {
            // wrapping, for the cells without an image that fill a vector
            centre.wrapping_sub(lattice.corner[axis]).wrapping_add(probe_offset(lattice, offsets, [a.into(), b.into()]))
        };
        let column = (at(0, x[i], ax[i], bx[i]) >> lattice.steps[0]).wrapping_sub(lattice.first[0] << FRACTION_BITS);
        let row = (at(1, y[i], ay[i], by[i]) >> lattice.steps[1]).wrapping_sub(lattice.first[1] << FRACTION_BITS);
        // rows times columns fit 32 bits, if not always with a sign
        let offset = (row >> FRACTION_BITS).wrapping_mul(lattice.width).wrapping_add(column >> FRACTION_BITS) as u32;
        let fraction = |at: i32| (at as u32 & ((1 << FRACTION_BITS) - 1)) << (15 - FRACTION_BITS);
        let fractions = if cfg!(target_endian = "little") {
            fraction(column) | fraction(row) << 16
        } else {
            fraction(column) << 16 | fraction(row)
        };
        taps[i] = if cfg!(target_endian = "little") {
            u64::from(offset) | u64::from(fractions) << 32
        } else {
            u64::from(offset) << 32 | u64::from(fractions)
        };
    }
}
