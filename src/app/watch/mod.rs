//! A capture while it is taken: photos as they arrive in a folder ([`inbox`]), their poses by structure from motion ([`sfm`]), and what is
//! shown of it to the photographer ([`board`]).

pub mod board;
pub mod inbox;
pub mod sfm;
