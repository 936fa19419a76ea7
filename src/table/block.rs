//! Blocks of neighbouring cells that are averaged alike, and the sides of their footprints as a few numbers.

use super::pattern::SamplePattern;

/// Cells of one vector, the columns of the widest blocks.
pub(crate) const LANES: usize = 16;

/// How many columns and rows the blocks of a row have: [`LANES`] by [`Size::MOST_ROWS`], or fewer where footprints change
/// much from cell to cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    columns: u8,
    rows: u8,
}

impl Size {
    /// From the largest to the one for coarse cells right beside a fisheye. With 4 rows alone plans take one and a half times
    /// as long, of 5 x 2.5 cm cells twice.
    pub(crate) const ALL: [Self; 5] =
        [Self::new(16, 16), Self::new(16, 8), Self::new(16, 4), Self::new(8, 4), Self::new(4, 4)];

    pub(crate) const MOST_ROWS: usize = Self::ALL[0].rows();
    pub(crate) const FEWEST_ROWS: usize = Self::ALL[4].rows();
    pub(crate) const FEWEST_COLUMNS: usize = Self::ALL[4].columns();

    const fn new(columns: u8, rows: u8) -> Self {
        Self { columns, rows }
    }

    pub(crate) const fn columns(self) -> usize {
        self.columns as usize
    }

    pub(crate) const fn rows(self) -> usize {
        self.rows as usize
    }

    /// Of blocks of so many columns.
    pub(crate) fn basis(self) -> &'static Basis {
        static BASES: [Basis; 3] = [basis(Size::ALL[0]), basis(Size::ALL[3]), basis(Size::ALL[4])];
        match self.columns {
            16 => &BASES[0],
            8 => &BASES[1],
            _ => &BASES[2],
        }
    }

    /// The distance of a column from the block's middle: from -16 to 16, however many there are.
    pub(crate) const fn distance(self, column: usize) -> i32 {
        (2 * column as i32 + 1 - self.columns as i32) * (LANES / self.columns()) as i32
    }

    /// Half rows from the block's middle to a row.
    pub(crate) const fn half_rows(self, row: usize) -> i16 {
        2 * row as i16 + 1 - self.rows as i16
    }

    /// Columns at which sides are looked at: about where Chebyshev's polynomial of degree four is zero.
    pub(crate) const fn nodes(self) -> [usize; 4] {
        match self.columns {
            16 => [1, 5, 10, 14],
            8 => [0, 2, 5, 7],
            _ => [0, 1, 2, 3],
        }
    }
}

/// Neighbouring cells that are averaged alike, as many as the [`Size`] says.
///
/// The sides of their footprints are cubic in the column and linear in the row: to keep them for each cell took 16 bytes a
/// cell and more time than a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    /// For x and y of the side along the output's row, and x and y of the one down its columns, four coefficients of
    /// the [`Basis`]. In 1/2048 pixel before [`Block::shift`].
    pub(crate) coefficients: [i16; 16],
    /// By how much these change in half a row.
    pub(crate) changes: [i16; 16],
    /// The middle of a footprint from where its cell samples, 1/1024 pixel.
    pub(crate) offset: [i16; 2],
    pub(crate) pattern: SamplePattern,
    /// Sides are in 1/1024 pixel after shifting left by so many bits.
    pub(crate) shift: u8,
    /// Whether probes may leave the level.
    pub(crate) clipped: bool,
}

/// What coefficients are multiplied with in each column, in 1/64: polynomials of degree 0 to 3 of the distance from the
/// block's middle, of which it only matters that they differ, are even or odd and fit 16 bits. Columns that a block does
/// not have are as its last.
pub(crate) type Basis = [[i16; LANES]; 4];

const fn basis(size: Size) -> Basis {
    let mut basis = [[0; LANES]; 4];
    let mut lane = 0;
    while lane < LANES {
        let column = if lane < size.columns() { lane } else { size.columns() - 1 };
        let at = polynomials(size.distance(column));
        let mut degree = 0;
        while degree < 4 {
            basis[degree][lane] = at[degree];
            degree += 1;
        }
        lane += 1;
    }
    basis
}

/// The basis at a distance from a block's middle.
pub(crate) const fn polynomials(distance: i32) -> [i16; 4] {
    let cube = distance * distance * distance;
    // rounded alike on either side
    let third = if cube < 0 { -((16 - cube) / 32) } else { (16 + cube) / 32 };
    [64, 4 * distance as i16, (distance * distance - 85) as i16, third as i16]
}

impl Block {
    /// Cells that see no image, or a pixel or less of it.
    pub(crate) const BILINEAR: Self = Self {
        coefficients: [0; 16],
        changes: [0; 16],
        offset: [0; 2],
        pattern: SamplePattern::BILINEAR,
        shift: 0,
        clipped: false,
    };

    pub(crate) fn is_bilinear(&self) -> bool {
        self.pattern.is_bilinear()
    }

    /// One of the sides of the footprints of a row of the block so far from its middle, x along, y along, x down or y down,
    /// in 1/1024 pixel before the shift.
    #[inline(always)]
    pub(crate) fn side(&self, side: usize, half_rows: i16, basis: &Basis) -> [i16; LANES] {
        let (coefficients, changes) = (&self.coefficients[4 * side..][..4], &self.changes[4 * side..][..4]);
        let of_row = |degree: usize| i32::from(coefficients[degree] + changes[degree] * half_rows);
        let [c0, c1, c2, c3] = [of_row(0), of_row(1), of_row(2), of_row(3)];
        lanes(|i| {
            let [b0, b1, b2, b3] = [basis[0][i], basis[1][i], basis[2][i], basis[3][i]].map(i32::from);
            ((c0 * b0 + c1 * b1 + c2 * b2 + c3 * b3) >> 7) as i16
        })
    }
}

/// A number for each of so many. One array at a time: of loops that write two the compiler makes no vectors.
#[inline(always)]
pub(crate) fn lanes<T: Copy + Default, const N: usize>(of: impl Fn(usize) -> T) -> [T; N] {
    let mut lanes = [T::default(); N];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = of(i);
    }
    lanes
}
