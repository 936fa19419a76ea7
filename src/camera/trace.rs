//! Images of curves, as polylines that stay within a tolerance of them.

use crate::error::{CameraError, Error, Result};
use crate::parallel::check_interrupt;
use crate::view::buffer;

/// What memory is asked for, in errors.
const WHAT: &str = "polyline";

/// A pixel.
pub(super) type Pixel = [f64; 2];

/// Where on a curve, from 0 to 1, and its image, if it has one.
type Point = (f64, Option<Pixel>);

/// Halvings after which a curve is taken for a point: 2^-44 of its way.
const DEEPEST: u32 = 44;

/// Pixels up to which a straight line is drawn as it is, if the image is not larger; farther ends would cost the digits
/// of what is cut from it.
const FAR: f64 = 1e7;

/// Halvings that all curves of a tracer have together, and that each part adds which a curve is begun with. A cut takes
/// [`DEEPEST`] of them.
const HALVINGS: usize = 1 << 16;
const HALVINGS_A_PART: usize = 1 << 8;

/// Parts that one curve may have: those of a line across 8 million nodes of a height map. More come of numbers that
/// overflowed, and would never end.
const MOST_PARTS: usize = 1 << 24;

/// Pixels that two points of a piece are apart, if there is one more between them.
const SHORTEST: f64 = 1e-3;

/// Gathers the image of a curve: clips it to a rectangle, and cuts it where there is no image.
pub(super) struct Tracer {
    low: Pixel,
    high: Pixel,
    tolerance: f64,
    /// [`FAR`], and always well beyond what is kept: what is farther runs off or is missed, however often it is halved.
    far: f64,
    pieces: Vec<Vec<Pixel>>,
    /// Whether the next line may go on with the last piece.
    open: bool,
    /// Halvings that are left.
    left: usize,
}

impl Tracer {
    /// For an image of so many pixels with a margin around the rectangle of their centres.
    pub(super) fn new((width, height): (u32, u32), margin: f64, tolerance: f64) -> Self {
        let high = [f64::from(width - 1) + margin, f64::from(height - 1) + margin];
        let far = FAR.max(2.0 * (high[0].max(high[1]) + tolerance));
        Self { low: [-margin; 2], high, tolerance, far, pieces: Vec::new(), open: false, left: HALVINGS }
    }

    /// What was gathered: polylines of two points or more.
    pub(super) fn finish(self) -> Vec<Vec<Pixel>> {
        self.pieces
    }

    /// Gathers a curve from t = 0 to t = 1 whose image bends by no more than it can in so many equal parts. `image` is
    /// continuous but for where there is none.
    ///
    /// # Errors
    /// [`CameraError::Winding`] for a curve that is not followed in any reasonable number of steps.
    pub(super) fn curve(&mut self, parts: usize, image: &impl Fn(f64) -> Option<Pixel>) -> Result<()> {
        if parts > MOST_PARTS {
            return Err(Error::Camera(CameraError::Winding { tolerance: self.tolerance }));
        }
        self.left = self.left.saturating_add(HALVINGS_A_PART * parts);
        let mut start = (0.0, image(0.0));
        for part in 1..=parts {
            let t = if part == parts { 1.0 } else { part as f64 / parts as f64 };
            let end = (t, image(t));
            check_interrupt()?;
            self.part(start, end, image)?;
            start = end;
        }
        Ok(())
    }

    /// Gathers a curve whose image is straight: of its inner points, which only guard against numbers too large to be
    /// clipped, none is kept.
    ///
    /// # Errors
    /// Those of [`Tracer::curve`].
    pub(super) fn straight(&mut self, image: &impl Fn(f64) -> Option<Pixel>) -> Result<()> {
        let (pieces, points) = (self.pieces.len(), self.pieces.last().map_or(0, Vec::len));
        self.curve(1, image)?;
        for (index, piece) in self.pieces.iter_mut().enumerate().skip(pieces.saturating_sub(1)) {
            let first = if index + 1 == pieces { points } else { 1 };
            if piece.len() > first + 1 {
                piece.drain(first..piece.len() - 1);
            }
        }
        Ok(())
    }

    /// Ends the piece: what follows begins a new one.
    pub(super) fn cut(&mut self) {
        self.open = false;
    }

    /// Gathers a part of a curve, if that takes no more halvings than are left.
    ///
    /// The halves that wait stand in a list: as a recursion, [`DEEPEST`] calls deep, they did not fit a thread's stack of
    /// 32 KiB.
    fn part(&mut self, start: Point, end: Point, image: &impl Fn(f64) -> Option<Pixel>) -> Result<()> {
        let mut waiting = Vec::with_capacity(DEEPEST as usize + 1);
        waiting.push((start, end, DEEPEST));
        while let Some((start, end, depth)) = waiting.pop() {
            let at = |part: f64| start.0 + (end.0 - start.0) * part;
            let between = [0.25, 0.5, 0.75].map(|part| image(at(part)));
            if let (Some(a), Some(b), [Some(p), Some(q), Some(r)]) = (start.1, end.1, between) {
                if self.misses([a, p, q, r, b]) {
                    self.open = false;
                    continue;
                }
                let straight = [p, q, r].iter().all(|point| from_line(point, &a, &b) <= self.tolerance);
                let near = [a, b].as_flattened().iter().all(|coordinate| coordinate.abs() <= self.far);
                if (straight && near) || depth == 0 {
                    self.line(a, b)?;
                    continue;
                }
            } else if depth == 0 || (start.1.is_none() && end.1.is_none() && between.iter().all(Option::is_none)) {
                self.open = false;
                continue;
            }
            self.left =
                self.left.checked_sub(1).ok_or(Error::Camera(CameraError::Winding { tolerance: self.tolerance }))?;
            let middle = (at(0.5), between[1]);
            waiting.push((middle, end, depth - 1));
            waiting.push((start, middle, depth - 1));
        }
        Ok(())
    }

    /// Whether points all lie beyond one side of the rectangle, so that what is between them does too.
    fn misses(&self, points: [Pixel; 5]) -> bool {
        (0..2).any(|axis| {
            points.iter().all(|point| point[axis] < self.low[axis] - self.tolerance)
                || points.iter().all(|point| point[axis] > self.high[axis] + self.tolerance)
        })
    }

    /// Gathers a straight line (Liang and Barsky's clipping).
    pub(super) fn line(&mut self, a: Pixel, b: Pixel) -> Result<()> {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let length = b[axis] - a[axis];
            for (sign, edge) in [(1.0, self.low[axis] - a[axis]), (-1.0, a[axis] - self.high[axis])] {
                let (length, edge) = (sign * length, edge);
                // inside where length t >= edge
                if length > 0.0 {
                    from = from.max(edge / length);
                } else if length < 0.0 {
                    to = to.min(edge / length);
                } else if edge > 0.0 {
                    to = f64::NEG_INFINITY;
                }
            }
        }
        if from > to {
            self.open = false;
            return Ok(());
        }
        let at = |t: f64| {
            let point = [0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * t);
            // rounding must not put it outside
            [0, 1].map(|axis| point[axis].clamp(self.low[axis], self.high[axis]))
        };
        let (start, end) = (if from > 0.0 { at(from) } else { a }, if to < 1.0 { at(to) } else { b });
        match self.pieces.last_mut() {
            Some(piece) if self.open && piece.last() == Some(&start) => match piece.iter().rev().nth(1) {
                // towards a cut the parts become ever shorter
                Some(before) if (end[0] - before[0]).hypot(end[1] - before[1]) < SHORTEST => {
                    piece.pop();
                    piece.push(end);
                }
                _ if end != start => buffer::push(WHAT, piece, end)?,
                _ => {}
            },
            // what only touches a corner is no line
            _ if end != start => buffer::push(WHAT, &mut self.pieces, buffer::copied(WHAT, &[start, end])?)?,
            _ => {}
        }
        self.open = to >= 1.0;
        Ok(())
    }
}

/// Distance of a point from the line between two others.
fn from_line(point: &Pixel, a: &Pixel, b: &Pixel) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let square = along[0] * along[0] + along[1] * along[1];
    let t = if square > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (to[0] - along[0] * t).hypot(to[1] - along[1] * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traced(margin: f64, curve: impl Fn(f64) -> Option<Pixel>, parts: usize) -> Vec<Vec<Pixel>> {
        let mut tracer = Tracer::new((101, 51), margin, 0.1);
        tracer.curve(parts, &curve).unwrap();
        tracer.finish()
    }

    #[test]
    fn lines_are_clipped_to_the_rectangle() {
        assert_eq!(traced(0.0, |t| Some([10.0 + 20.0 * t, 20.0]), 1), [[[10.0, 20.0], [30.0, 20.0]]]);
        assert_eq!(traced(0.0, |t| Some([-50.0 + 200.0 * t, 25.0]), 1), [[[0.0, 25.0], [100.0, 25.0]]]);
        assert_eq!(traced(2.0, |t| Some([-50.0 + 200.0 * t, 25.0]), 1), [[[-2.0, 25.0], [102.0, 25.0]]]);
        assert!(traced(0.0, |t| Some([-50.0 + 200.0 * t, 60.0]), 1).is_empty());
        // past the corner
        assert!(traced(0.0, |t| Some([-30.0 + 60.0 * t, 70.0 - 60.0 * t + 40.0]), 1).is_empty());
        assert_eq!(traced(0.0, |t| Some([20.0, 100.0 * t]), 3).len(), 1);
    }

    #[test]
    fn huge_images_margins_and_tolerances_take_no_longer() {
        let off = |t: f64| Some([1e3 + 1e9 * t, 20.0 + 1e8 * t]);
        for (size, margin, tolerance) in [((1 << 30, 1), 0.0, 0.1), ((101, 51), 1e9, 0.1), ((101, 51), 0.0, 1e9)] {
            let mut tracer = Tracer::new(size, margin, tolerance);
            tracer.curve(4, &off).unwrap();
            tracer.curve(1, &|t| Some([1e8 * (1.0 + t), 30.0 + 1e3 * (3.0 * t).sin()])).unwrap();
            assert!(tracer.finish().iter().map(Vec::len).sum::<usize>() < 1000);
        }
    }

    #[test]
    fn a_curve_that_never_gets_straight_is_given_up() {
        let mut tracer = Tracer::new((101, 51), 0.0, 0.1);
        // in the image everywhere and nowhere smooth: digits of t, shuffled
        let noise = |t: f64| (t.to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 24);
        let result = tracer.curve(8, &|t| Some([100.0 * noise(t), 50.0 * noise(t + 0.5)]));
        assert!(matches!(result, Err(Error::Camera(CameraError::Winding { .. }))), "{result:?}");
    }

    #[test]
    fn a_curve_stays_within_the_tolerance_and_comes_back_in_pieces() {
        let circle = |t: f64| {
            let (sin, cos) = (t * std::f64::consts::TAU).sin_cos();
            [50.0 + 40.0 * cos, 25.0 + 40.0 * sin]
        };
        let pieces = traced(0.0, |t| Some(circle(t)), 8);
        // its upper and its lower cap lie outside: right arc, left arc, right arc
        assert_eq!(pieces.len(), 3);
        assert!(pieces.iter().flatten().all(|p| p[1] >= 0.0 && p[1] <= 50.0));
        for k in 0..5000 {
            let point = circle(f64::from(k) / 5000.0);
            if point[1] > 0.0 && point[1] < 50.0 {
                let nearest = pieces.iter().flat_map(|piece| piece.windows(2)).map(|w| from_line(&point, &w[0], &w[1]));
                assert!(nearest.fold(f64::INFINITY, f64::min) <= 0.1);
            }
        }
    }

    #[test]
    fn where_there_is_no_image_it_is_cut_and_what_runs_off_to_infinity_is_clipped() {
        let pieces = traced(0.0, |t| (!(0.3..=0.6).contains(&t)).then_some([100.0 * t, 10.0]), 10);
        assert_eq!(pieces.len(), 2);
        assert!((pieces[0].last().unwrap()[0] - 30.0).abs() < 1e-6);
        assert!((pieces[1][0][0] - 60.0).abs() < 1e-6);
        // a line that comes towards the camera's plane at t = 0.5
        let pieces = traced(0.0, |t| (t < 0.5).then(|| [50.0, 10.0 + 1.0 / (0.5 - t)]), 1);
        assert_eq!(pieces.len(), 1);
        assert!((pieces[0].last().unwrap()[1] - 50.0).abs() < 1e-6, "{pieces:?}");
    }
}
