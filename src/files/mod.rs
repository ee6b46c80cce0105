//! What is read and written: a module per file format, and sets of photos.

pub mod io;
pub mod photos;
