//! What a table was built from.

use crate::camera::Camera;
use crate::grid::BevGrid;
use crate::ground::Ground;

/// A grid, and the camera and road that its cells were projected through, if that is how they were.
#[derive(Clone)]
pub(crate) struct Scene {
    grid: BevGrid,
    view: Option<(Camera, Ground)>,
}

impl Scene {
    pub(crate) fn new(grid: BevGrid, view: Option<(Camera, Ground)>) -> Self {
        Self { grid, view }
    }

    pub(crate) fn grid(&self) -> &BevGrid {
        &self.grid
    }

    pub(crate) fn camera(&self) -> Option<&Camera> {
        self.view.as_ref().map(|(camera, _)| camera)
    }

    pub(crate) fn ground(&self) -> Option<&Ground> {
        self.view.as_ref().map(|(_, ground)| ground)
    }
}
