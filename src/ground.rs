//! The road.

use nalgebra::Vector3;

use crate::error::{Error, Result};

/// The road surface in the vehicle frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    height: f64,
}

impl Ground {
    /// The horizontal plane z = `height`.
    ///
    /// # Errors
    /// [`Error::Ground`].
    pub fn height(height: f64) -> Result<Self> {
        if height.is_finite() { Ok(Self { height }) } else { Err(Error::Ground { got: height }) }
    }

    /// z of the road at (x, y).
    #[inline]
    pub fn height_at(&self, _x: f64, _y: f64) -> f64 {
        self.height
    }

    /// Where the ray from `origin` along `direction` meets the road; `None` where it runs above it, along it or away.
    pub fn intersect(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let distance = (self.height - origin.z) / direction.z;
        let point = origin + direction * distance;
        // a ray within rounding of the horizon ends at infinity
        (distance > 0.0 && point.x.is_finite() && point.y.is_finite())
            .then(|| Vector3::new(point.x, point.y, self.height))
    }
}

impl Default for Ground {
    /// z = 0.
    fn default() -> Self {
        Self { height: 0.0 }
    }
}
