//! A capture while it is taken: photos as they arrive in a folder ([`inbox`]), frames of videos ([`video`]), poses by structure from motion
//! ([`sfm`]) or as they lie beside the photos ([`given`]), and what is shown of it to the photographer ([`board`]).

pub mod board;
pub mod given;
pub mod inbox;
pub mod sfm;
pub mod video;
