//! How far the probes of blocks reach, and which may leave the level that they look at.

use std::ops::Range;

use super::block::{Block, LANES, ROWS, Width, lanes};
use super::rows::OUTSIDE;
use super::{Level, Q, Shape};
use crate::cpu::Isa;
use crate::lut::kernels::for_each_isa;

/// Columns and rows of the coordinates of a row of blocks, and of the rows before and after it; entry i + 1 of a row is of
/// cell i.
type Axes<'a> = [[&'a [i32]; 2]; ROWS + 2];

/// The entries of their levels that the probes of the blocks of a row touch, from left to right and from top to bottom,
/// 1/1024 entry, not yet kept inside the level. Nothing is told of blocks that are bilinear.
pub(super) struct Reaches {
    x: [Vec<Quarters>; 2],
    y: [Vec<Quarters>; 2],
}

/// The least or greatest number of each quarter of a block's columns. Down to one, the compiler would take the lanes of
/// its vectors one by one.
type Quarters = [i32; 4];

impl Reaches {
    /// Of rows of so many blocks.
    pub(super) fn new(blocks: usize) -> Self {
        let none = || [vec![Quarters::default(); blocks], vec![Quarters::default(); blocks]];
        Self { x: none(), y: none() }
    }

    /// Works them out for neighbouring blocks, the first of which is the `first`-th of its row, on a source of this size,
    /// whose probes are so far from the middles of footprints; tells blocks whether their probes may leave the level.
    pub(super) fn read(
        &mut self,
        isa: Isa,
        source: (u32, u32),
        width: Width,
        first: usize,
        (blocks, fars): (&mut [Block], &[[i32; 2]]),
        axes: Axes<'_>,
    ) {
        let into = [&mut self.x, &mut self.y].map(|axis| axis.each_mut().map(|bound| &mut bound[..]));
        reach_of_blocks(isa, source, (width, first), (blocks, fars), axes, into);
        for (index, block) in (first..).zip(blocks).filter(|(_, block)| !block.is_bilinear()) {
            let lattice = Lattice::new(block.shape, source);
            let [x, y] = self.bounds(index);
            block.clipped = x.0 < 0 || y.0 < 0 || x.1 >= lattice.last[0] || y.1 >= lattice.last[1];
        }
    }

    fn bounds(&self, block: usize) -> [(i32, i32); 2] {
        [&self.x, &self.y].map(|[low, high]| {
            let (low, high) = (low[block].into_iter().min(), high[block].into_iter().max());
            (low.unwrap_or(0), high.unwrap_or(0))
        })
    }

    /// Columns and rows that a block touches in the level of `shape`, those left out that a source of this size does not
    /// have.
    pub(super) fn entries(&self, block: usize, shape: Shape, source: (u32, u32)) -> [Range<u32>; 2] {
        let Lattice { last, .. } = Lattice::new(shape, source);
        let [x, y] = self.bounds(block);
        [(x, last[0]), (y, last[1])].map(|((low, high), last)| {
            let entry = |at: i32| (at.clamp(0, last) >> Q) as u32;
            entry(low)..(entry(high) + 2).min(entry(last) + 1)
        })
    }
}

/// What all footprints of a shape have in common.
#[derive(Clone, Copy)]
struct Lattice {
    /// How far the outermost probe is along each side, in 1/16384 of it.
    outermost: [i32; 2],
    /// The box's top-left pixel from its middle, in 1/1024 pixel.
    corner: [i32; 2],
    /// The last entry of the level in each direction, in 1/1024 entry.
    last: [i32; 2],
    /// log2 of the pixels from entry to entry.
    steps: [u32; 2],
}

impl Lattice {
    #[inline(always)]
    fn new(shape: Shape, (width, height): (u32, u32)) -> Self {
        let (box_width, box_height) = shape.box_size();
        Self {
            outermost: [shape.along, shape.down]
                .map(|count| Shape::offsets(count).last().map_or(0, |&last| last.into())),
            corner: [box_width, box_height].map(|size| (size as i32 - 1) << (Q - 1)),
            last: [(width, shape.kx), (height, shape.ky)]
                .map(|(side, k)| ((Level::boxes(side, k.into()) - 1) as i32) << Q),
            steps: [shape.kx, shape.ky].map(|k| Level::log_step(k.into())),
        }
    }

    /// How far from its middle the probes of a footprint are at most along an axis, in 1/1024 pixel.
    #[inline(always)]
    fn far_of(&self, along: i16, down: i16, shift: u8) -> i32 {
        let sum = i32::from(along).abs() * self.outermost[0] + i32::from(down).abs() * self.outermost[1];
        (sum >> (14 - u32::from(shift))) + 1
    }
}

fn reach_of_blocks(
    isa: Isa,
    source: (u32, u32),
    (width, first): (Width, usize),
    (blocks, fars): (&[Block], &[[i32; 2]]),
    axes: Axes<'_>,
    into: [[&mut [Quarters]; 2]; 2],
) {
    #[inline(always)]
    fn body(
        source: (u32, u32),
        width: Width,
        first: usize,
        blocks: &[Block],
        fars: &[[i32; 2]],
        axes: Axes<'_>,
        into: [[&mut [Quarters]; 2]; 2],
    ) {
        let [[left, right], [top, bottom]] = into;
        for (index, (block, &far)) in (first..).zip(blocks.iter().zip(fars)) {
            if block.is_bilinear() {
                continue;
            }
            let lattice = Lattice::new(block.shape, source);
            let at = 1 + index * width.columns();
            // of narrow blocks the next ones' columns too: a little more than they reach
            (left[index], right[index]) = of_axis(&lattice, block, far, 0, axes, at);
            (top[index], bottom[index]) = of_axis(&lattice, block, far, 1, axes, at);
        }
    }
    #[inline(always)]
    fn of_axis(
        lattice: &Lattice,
        block: &Block,
        far: [i32; 2],
        axis: usize,
        axes: Axes<'_>,
        at: usize,
    ) -> (Quarters, Quarters) {
        let [lowest, highest] = bounds_of_rows(axes, axis, at);
        let (low, high) = (of_quarters(&lowest, smaller), of_quarters(&highest, larger));
        let middle = i32::from(block.offset[axis]) - lattice.corner[axis];
        let (low_way, high_way, step) = (middle - far[axis], middle + far[axis], lattice.steps[axis]);
        (lanes(|i| (low[i] + low_way) >> step), lanes(|i| (high[i] + high_way) >> step))
    }
    for_each_isa!(isa, (body, body, body)(
        source: (u32, u32),
        width: Width,
        first: usize,
        blocks: &[Block],
        fars: &[[i32; 2]],
        axes: Axes<'_>,
        into: [[&mut [Quarters]; 2]; 2],
    ));
}

/// The least and the greatest coordinate of each column of a block, whose first row's entries begin at `at`. Of a column
/// without an image they are far beyond those of any other.
#[inline(always)]
fn bounds_of_rows(axes: Axes<'_>, axis: usize, at: usize) -> [[i32; LANES]; 2] {
    const FAR: i32 = 1 << 30;
    let (mut least, mut greatest) = ([FAR; LANES], [-FAR; LANES]);
    for row in &axes[1..=ROWS] {
        let row: &[i32; LANES] = row[axis][at..].first_chunk().expect("rows go on to the end of a block");
        least = lanes(|i| smaller(least[i], if row[i] == OUTSIDE { FAR } else { row[i] }));
        greatest = lanes(|i| larger(greatest[i], if row[i] == OUTSIDE { -FAR } else { row[i] }));
    }
    [least, greatest]
}

/// Tells for each of neighbouring footprints of a shape, whose sides are shifted by so much, 1 if a probe leaves the level
/// of a source of this size.
pub(crate) fn leaves(
    isa: Isa,
    (shape, shift): (Shape, u8),
    source: (u32, u32),
    centre: [&[i32]; 2],
    sides: [&[i16]; 4],
    leaves: &mut [u8],
) {
    #[inline(always)]
    fn body(lattice: Lattice, shift: u8, centre: [&[i32]; 2], sides: [&[i16]; 4], leaves: &mut [u8]) {
        let cells = leaves.len();
        leaves.fill(0);
        for axis in 0..2 {
            let (centre, along, down) = (&centre[axis][..cells], &sides[axis][..cells], &sides[2 + axis][..cells]);
            let Lattice { corner, last, steps, .. } = lattice;
            for i in 0..cells {
                let far = lattice.far_of(along[i], down[i], shift);
                let middle = centre[i].wrapping_sub(corner[axis]);
                let (low, high) = (middle.wrapping_sub(far) >> steps[axis], middle.wrapping_add(far) >> steps[axis]);
                leaves[i] |= u8::from((low < 0) | (high >= last[axis]));
            }
        }
    }
    let lattice = Lattice::new(shape, source);
    for_each_isa!(isa, (body, body, body)(
        lattice: Lattice, shift: u8, centre: [&[i32]; 2], sides: [&[i16]; 4], leaves: &mut [u8]
    ));
}

#[inline(always)]
fn of_quarters(numbers: &[i32; LANES], of_two: impl Fn(i32, i32) -> i32) -> Quarters {
    lanes(|i| of_two(of_two(numbers[i], numbers[i + 4]), of_two(numbers[i + 8], numbers[i + 12])))
}

#[inline(always)]
fn smaller(a: i32, b: i32) -> i32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: i32, b: i32) -> i32 {
    if a > b { a } else { b }
}
