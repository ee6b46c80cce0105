//! A capture while it is taken: photos as they arrive in a folder ([`inbox`]), frames of videos ([`video`]), poses by structure from motion
//! ([`sfm`]) or as they lie beside the photos ([`given`]), where the photographer can hold a camera ([`person`]), and what is shown to them
//! ([`board`]).

pub mod board;
pub mod given;
pub mod inbox;
pub mod person;
pub mod sfm;
pub mod video;
