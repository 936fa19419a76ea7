//! Frames of a drive on one tile: whatever their poses and in whatever order, the same integers.

use ipm_rs::mosaic::{Frame, Kept, OwnedTile};
use ipm_rs::{BevGrid, Ground, ImageView, SampleAt};

use crate::input::Input;
use crate::isas::{Random, noise};

const SIDE: usize = 16;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let channels = input.count(1, 4);
    let kept = Kept { channels, samples: input.count(0, 4), labels: input.count(0, 3) == 0 };
    let ground = Ground::default();
    let at = (input.count(0, SIDE - 1), input.count(0, SIDE - 1));
    let (rows, columns) = (input.count(1, SIDE - at.0), input.count(1, SIDE - at.1));
    let window =
        BevGrid::new((1.0, 1.0 + rows as f64 * 0.5), (-2.0, -2.0 + columns as f64 * 0.5), (0.5, 0.5), SampleAt::Center)
            .expect("whole cells");
    let mut random = Random::new(input.bits());
    let frames: Vec<_> = (0..input.count(1, 3))
        .filter_map(|id| {
            let camera = input.camera(None)?;
            let from = input.point(3.0);
            let distance = (input.number(2.0), input.number(40.0));
            let weight = input.number(1.0);
            let size = (camera.image_size().0 as usize, camera.image_size().1 as usize);
            let pixels: Vec<u8> = noise(size.0 * size.1 * channels, &mut random);
            Some((Frame { camera, mask: None, ground: &ground, from, distance, weight, id: id as u32 }, size, pixels))
        })
        .collect();
    let add =
        |sums: &mut OwnedTile<u8>, order: &mut dyn Iterator<Item = &(Frame<'_>, (usize, usize), Vec<u8>)>, threads| {
            for (frame, size, pixels) in order {
                let image = ImageView::new(pixels, *size, channels).expect("an image");
                let before = sums.clone();
                match frame.add(&image, &window, sums.tile().expect("layers of one tile"), at, Some(threads)) {
                    Ok(counted) => assert!(counted <= rows * columns),
                    Err(_) => assert!(*sums == before, "a frame that is refused adds nothing"),
                }
            }
        };
    let mut one = OwnedTile::new(SIDE, kept).expect("memory for a small tile");
    let mut other = one.clone();
    add(&mut one, &mut frames.iter(), 1);
    add(&mut other, &mut frames.iter().rev(), 2);
    assert!(one == other, "the order of frames changes the map");
    for cell in 0..SIDE * SIDE {
        let (row, column) = (cell / SIDE, cell % SIDE);
        let within = (at.0..at.0 + rows).contains(&row) && (at.1..at.1 + columns).contains(&column);
        assert!(within || one.counts[cell] == 0, "a cell beyond the window was added to");
        assert!(one.counts[cell] as usize <= frames.len());
    }
}
