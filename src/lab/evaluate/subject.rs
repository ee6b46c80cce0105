//! What is evaluated on, read and checked.

use std::path::Path;

use super::pool::Pool;
use super::scene::Scene;

/// A subject. All of one evaluation are of one [`Kind`](super::kind::Kind).
pub enum Subject {
    /// A scene that is photographed: an object or a room.
    Scene(Box<Scene>),
    /// Photos that have been taken.
    Pool(Box<Pool>),
}

impl Subject {
    /// Name in tables and of its folder.
    pub fn name(&self) -> &str {
        match self {
            Self::Scene(scene) => &scene.name,
            Self::Pool(pool) => &pool.name,
        }
    }

    /// Whether the built-in studio lights it.
    pub fn in_studio(&self) -> bool {
        matches!(self, Self::Scene(scene) if scene.in_studio)
    }

    /// Where it was read from.
    pub fn path(&self) -> &Path {
        match self {
            Self::Scene(scene) => &scene.path,
            Self::Pool(pool) => pool.path(),
        }
    }
}
