//! Between the image and the road.

use nalgebra::Vector3;

use super::{Camera, Projection};
use crate::ground::Ground;

impl Camera {
    /// Where the ray through a pixel first meets the road, in the vehicle frame; `None` where it does not.
    pub fn ground_from_pixel(&self, pixel: [f64; 2], ground: &Ground) -> Option<Vector3<f64>> {
        ground.intersect(&self.position(), &(self.vehicle_from_camera.rotation() * self.ray(pixel)?))
    }

    /// Where the road at (x, y) falls on the image. Where it is not known there is no pixel; where a crest hides it the
    /// pixel is exact and not valid.
    pub fn project_ground(&self, [x, y]: [f64; 2], ground: &Ground) -> Projection {
        let point = Vector3::new(x, y, ground.height_at(x, y));
        let mut projection = self.project(&point);
        projection.valid = projection.valid && !ground.hides(&self.position(), &point);
        projection
    }
}
