//! The road: a height, a plane or a height map.

pub(crate) mod error;
mod height_map;
mod nodata;
mod peaks;
mod plane;
mod ray;
mod rows;
mod sight;

use std::sync::Arc;

use nalgebra::Vector3;

pub use height_map::HeightMap;
pub use plane::Plane;
pub(crate) use rows::HeightRows;
pub(crate) use sight::Sight;

use crate::error::{Error, GroundError, Result};

/// Metres from the optical centre to a road that is seen edge-on: less is rounding, and no camera is so near.
const EDGE_ON: f64 = 1e-6;

/// The road surface in the vehicle frame, metres: one height for each (x, y), where it is known.
#[derive(Debug, Clone, PartialEq)]
pub enum Ground {
    /// A plane; a road at one height is one that is level.
    Plane(Plane),
    /// Heights at the nodes of a grid, bilinear between them and unknown outside.
    HeightMap(Arc<HeightMap>),
}

impl Ground {
    /// The horizontal plane z = `height`.
    ///
    /// # Errors
    /// [`GroundError::Height`].
    pub fn height(height: f64) -> Result<Self> {
        if height.abs() <= nodata::HIGHEST {
            Ok(Self::Plane(Plane::level(height)))
        } else {
            Err(Error::Ground(GroundError::Height { got: height }))
        }
    }

    /// z of the road at (x, y); NaN where it is unknown.
    #[inline]
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Plane(plane) => plane.height_at(x, y),
            Self::HeightMap(map) => map.height_at(x, y),
        }
    }

    /// Where the ray from `origin` along `direction` first meets the road; `None` where it runs above it, along it or
    /// away, or ends where the road is unknown.
    pub fn intersect(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
        let met = match self {
            Self::Plane(plane) => plane.intersect(origin, direction),
            Self::HeightMap(map) => map.intersect(origin, direction),
        };
        // the way from an eye beyond all measure may be beyond float64
        met.filter(|met| met.iter().all(|number| number.is_finite()))
    }

    /// Whether the road itself stands between `eye` and a point on it: behind a crest, or because the eye lies in the
    /// road's plane and sees it edge-on.
    pub fn hides(&self, eye: &Vector3<f64>, point: &Vector3<f64>) -> bool {
        match self {
            Self::Plane(plane) => plane.is_edge_on(eye),
            Self::HeightMap(map) => map.hides(eye, point),
        }
    }

    /// z of the road below or above `eye`; where that is unknown, of what is known nearest to it.
    pub(crate) fn nearest_height(&self, eye: &Vector3<f64>) -> f64 {
        match self {
            Self::Plane(plane) => plane.height_at(eye.x, eye.y),
            Self::HeightMap(map) => map.nearest_height(eye),
        }
    }
}

/// Whether `eye` and a road `height` above it are in one place but for rounding.
pub(crate) fn is_edge_on(height: f64) -> bool {
    height.abs() <= EDGE_ON
}

impl Default for Ground {
    /// z = 0.
    fn default() -> Self {
        Self::Plane(Plane::level(0.0))
    }
}

impl From<Plane> for Ground {
    fn from(plane: Plane) -> Self {
        Self::Plane(plane)
    }
}

impl From<HeightMap> for Ground {
    fn from(map: HeightMap) -> Self {
        Self::HeightMap(Arc::new(map))
    }
}
