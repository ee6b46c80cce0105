//! A camera as the stages know it.

crate::gpu_struct! {
    /// A pinhole camera in the training frame. Rows of the camera-from-world rotation, with the translation last.
    pub struct View {
        /// First row.
        pub row_x: [f32; 4],
        /// Second row.
        pub row_y: [f32; 4],
        /// Third row.
        pub row_z: [f32; 4],
        /// Camera centre.
        pub position: [f32; 3],
        /// Nothing nearer along the optical axis is drawn.
        pub near: f32,
        /// Focal lengths in pixels.
        pub focal: [f32; 2],
        /// Principal point in pixels.
        pub principal: [f32; 2],
        /// Width in pixels.
        pub width: u32,
        /// Height in pixels.
        pub height: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}
