//! Bytes of tables, of a pickle or a file that somebody else made: refused, or a table whose warps touch nothing but
//! the image.

use ipm_rs::{BorderMode, Lut, checksum};

use crate::input::Input;
use crate::uses;

/// Bytes before those that the checksum is of.
const BEFORE: usize = 16;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let bytes = if input.byte() < 64 {
        let mut bytes = input.rest().to_vec();
        mend(&mut bytes);
        input = Input::new(data);
        bytes
    } else {
        forged(&mut input)
    };
    // the numbers of rows and columns, as a file claims them: 2 GB of room for taps are asked for and never touched,
    // which AddressSanitizer does touch
    let claimed =
        |at: usize| bytes.get(at..at + 4).map_or(0, |b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    if claimed(BEFORE).saturating_mul(claimed(BEFORE + 4)) > 1 << 24 {
        return;
    }
    if let Ok(lut) = Lut::from_bytes(&bytes) {
        uses::everything(&lut, &mut input);
    }
}

/// A good table's bytes with some changed, and a checksum that fits them.
fn forged(input: &mut Input<'_>) -> Vec<u8> {
    let (width, height) = (input.count(1, 20), input.count(1, 20));
    let (rows, columns) = (input.count(1, 12), input.count(1, 40));
    let (step_x, step_y) = (input.tame(2.0), input.tame(2.0));
    let (x, y): (Vec<f64>, Vec<f64>) = (0..rows * columns)
        .map(|cell| {
            let (row, column) = ((cell / columns) as f64, (cell % columns) as f64);
            (step_x * column + 0.3 * row - 1.0, step_y * row + 0.2 * column - 0.5)
        })
        .unzip();
    let mode = input.border_mode();
    let mode = if mode == BorderMode::Transparent { BorderMode::Constant } else { mode };
    let lut = Lut::from_maps_with(&x, &y, columns, (width as u32, height as u32), mode, input.flag());
    let lut = lut.expect("good maps");
    let mut bytes = lut.to_bytes().expect("there is memory");
    let changes = input.count(0, 6);
    if changes == 0 {
        assert_eq!(Lut::from_bytes(&bytes).as_ref(), Ok(&lut), "there and back");
    }
    for _ in 0..changes {
        let at = input.count(0, bytes.len() - 1);
        match input.byte() % 4 {
            0 => bytes[at] = input.byte(),
            1 => bytes[at] ^= 1 << (input.byte() % 8),
            2 => bytes[at] = bytes[at].wrapping_add(input.byte() % 5).wrapping_sub(2),
            _ => bytes.truncate(at.max(BEFORE)),
        }
    }
    mend(&mut bytes);
    bytes
}

fn mend(bytes: &mut [u8]) {
    if let Some((head, body)) = bytes.split_at_mut_checked(BEFORE) {
        head[8..].copy_from_slice(&checksum(body).to_le_bytes());
    }
}
