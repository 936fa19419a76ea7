//! Numbers and choices out of bytes.

use arbitrary::Unstructured;
use ipm_rs::{BorderMode, Camera, Lens, Pinhole};
use nalgebra::Vector3;

/// Bytes that are used up. What comes after the last of them is zeros, so every input is a whole call.
pub(crate) struct Input<'a>(Unstructured<'a>);

impl<'a> Input<'a> {
    pub(crate) fn new(data: &'a [u8]) -> Self {
        Self(Unstructured::new(data))
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.0.arbitrary().unwrap_or_default()
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0.arbitrary().unwrap_or_default()
    }

    /// From `least` to `most`, both of them too.
    pub(crate) fn count(&mut self, least: usize, most: usize) -> usize {
        let span = (most - least + 1) as u64;
        let bits: u64 =
            if span <= 256 { self.byte().into() } else { self.0.arbitrary::<u32>().unwrap_or_default().into() };
        least + (bits % span) as usize
    }

    pub(crate) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.count(0, all.len() - 1)]
    }

    /// What is left, as it is.
    pub(crate) fn rest(self) -> &'a [u8] {
        self.0.take_rest()
    }

    /// Any float at all, but mostly one between -1 and 1 times `scale`, whole and half ones among them.
    pub(crate) fn number(&mut self, scale: f64) -> f64 {
        const ODD: [f64; 12] = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            -0.0,
            1e-9,
            1e9,
            9_007_199_254_740_993.0,
            -4_294_967_296.0,
        ];
        match self.byte() {
            0 => 0.0,
            kind @ 1..=12 => ODD[usize::from(kind) - 1],
            13..=20 => f64::from_bits(self.bits()),
            21..=60 => f64::from(self.byte() as i8) / 2.0,
            61..=90 => scale * f64::from(self.byte() as i8) / 128.0,
            _ => scale * f64::from(self.0.arbitrary::<i32>().unwrap_or_default()) / 2_147_483_648.0,
        }
    }

    /// A number between -1 and 1 times `scale`: for what would be refused else, and nothing come of the call.
    pub(crate) fn tame(&mut self, scale: f64) -> f64 {
        scale * f64::from(self.0.arbitrary::<i32>().unwrap_or_default()) / 2_147_483_648.0
    }

    pub(crate) fn numbers(&mut self, count: usize, scale: f64) -> Vec<f64> {
        (0..count).map(|_| self.number(scale)).collect()
    }

    pub(crate) fn point(&mut self, scale: f64) -> [f64; 2] {
        [self.number(scale), self.number(scale)]
    }

    pub(crate) fn vector(&mut self, scale: f64) -> Vector3<f64> {
        Vector3::new(self.number(scale), self.number(scale), self.number(scale))
    }

    pub(crate) fn border_mode(&mut self) -> BorderMode {
        self.one_of(&BorderMode::ALL)
    }

    /// A camera somewhere above the road, of any lens or none, whose images have at most 64 x 64 pixels.
    pub(crate) fn camera(&mut self, lens: impl Into<Option<Lens>>) -> Option<Camera> {
        let size = (self.count(1, 64) as u32, self.count(1, 64) as u32);
        let model = if self.byte() < 250 {
            let focal = 20.0 + self.tame(19.0);
            let centre = [self.tame(40.0) + 32.0, self.tame(40.0) + 32.0];
            Pinhole::new(focal, focal * (1.0 + self.tame(0.5)), centre[0], centre[1], self.tame(1.0))
        } else {
            Pinhole::new(self.number(1e3), self.number(1e3), self.number(1e3), self.number(1e3), self.number(1.0))
        };
        let position = [self.tame(2.0), self.tame(2.0), self.number(4.0)];
        let [roll, pitch, yaw] = [0.5, 1.6, 3.2].map(|most| self.tame(most));
        Camera::from_euler(model.ok()?, size, position, roll, pitch, yaw).ok().map(|camera| camera.with_lens(lens))
    }
}
