//! What is wrong with a rig.

/// Cameras, masks, images or gains that make no rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// No cameras, or more than a rig can have.
    #[error("rig: expected 1 to {limit} cameras, got {got}")]
    CameraCount {
        /// Cameras that came.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// Two cameras of one name.
    #[error("rig: expected a name of its own for each camera, got {name:?} twice")]
    NameTwice {
        /// The name.
        name: String,
    },
    /// Masks for other cameras than there are.
    #[error("rig: expected a mask, or none, for each camera, got {got} masks")]
    MaskCount {
        /// Masks that came.
        got: usize,
    },
    /// A mask of another size than its camera's images.
    #[error(
        "rig: expected masks of the size of their images, got {got:?} for {name:?} of {} x {}", expected.0, expected.1
    )]
    MaskSize {
        /// The camera's name.
        name: String,
        /// (width, height) of its images.
        expected: (u32, u32),
        /// (width, height) of the mask.
        got: (u32, u32),
    },
    /// A feather that is no distance.
    #[error("rig: expected feather from 0 to 1000 metres, got {got}")]
    Feather {
        /// Metres that came.
        got: f64,
    },
    /// Another number of images than of cameras.
    #[error("rig: expected an image for each camera, got {got} for {cameras} cameras")]
    ImageCount {
        /// Images that came.
        got: usize,
        /// Cameras of the rig.
        cameras: usize,
    },
    /// Not one image.
    #[error("rig: expected at least one camera whose picture is there, got none")]
    NoImage,
    /// Another number of gains than of channels of cameras.
    #[error(
        "rig: expected a gain for each channel of each camera, got {got} for {cameras} cameras of {channels} channels"
    )]
    GainCount {
        /// Gains that came.
        got: usize,
        /// Cameras of the rig.
        cameras: usize,
        /// Channels of their images.
        channels: usize,
    },
    /// A gain by which nothing is to be seen.
    #[error("rig: expected gains from 0 to 1000, got {got}")]
    Gain {
        /// The gain that came.
        got: f32,
    },
    /// A gain from before that is none.
    #[error("rig: expected previous gains above 0, got {got}")]
    PreviousGain {
        /// The gain that came.
        got: f32,
    },
}
