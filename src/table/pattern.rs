//! Which samples of the source a footprint is averaged from.

/// Sides of a lattice have at most so many probes.
pub(crate) const MAX_PROBES: f32 = 16.0;

/// Boxes have at most `2^MAX_LOG` pixels a side.
pub(crate) const MAX_LOG: u32 = 6;

/// A lattice of `along x down` probes, each over a box of `2^kx x 2^ky` pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct SamplePattern {
    pub(crate) kx: u8,
    pub(crate) ky: u8,
    /// Probes along the side of the footprint that follows the output's row, and along the one down its columns.
    pub(crate) along: u8,
    pub(crate) down: u8,
}

impl SamplePattern {
    /// Plain bilinear: the footprint is no larger than a pixel.
    pub(crate) const BILINEAR: Self = Self { kx: 0, ky: 0, along: 1, down: 1 };

    #[inline]
    pub(crate) fn is_bilinear(self) -> bool {
        self == Self::BILINEAR
    }

    /// One of those that the plan of area has chosen, as bytes.
    #[inline]
    pub(crate) fn unpacked(packed: u32) -> Self {
        let [kx, ky, along, down] = packed.to_le_bytes();
        Self { kx, ky, along, down }
    }

    /// The offsets of `count` probes along a side of length 1, in 1/16384.
    #[inline]
    pub(crate) fn offsets(count: u8) -> &'static [i16] {
        const MOST: usize = MAX_PROBES as usize;
        static OFFSETS: [[i16; MOST]; MOST + 1] = {
            let mut offsets = [[0; MOST]; MOST + 1];
            let mut count = 1;
            while count <= MOST {
                let mut index = 0;
                while index < count {
                    offsets[count][index] = (((2 * index + 1) as i32 - count as i32) * (1 << 13) / count as i32) as i16;
                    index += 1;
                }
                count += 1;
            }
            offsets
        };
        &OFFSETS[usize::from(count)][..count.into()]
    }

    /// Columns and rows of a box.
    pub(crate) fn box_size(self) -> (u32, u32) {
        (1 << self.kx, 1 << self.ky)
    }

    /// Probes of a footprint.
    pub(crate) fn probes(self) -> u32 {
        u32::from(self.along) * u32::from(self.down)
    }

    /// How many times pixels were averaged by twos.
    pub(crate) fn halvings(self) -> u32 {
        u32::from(self.kx) + u32::from(self.ky)
    }
}
