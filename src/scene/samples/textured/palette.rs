//! The finishes that furniture comes in.

use super::furnisher::{Finish, Gloss};
use super::texture::Texture;

pub(super) const OAK: Finish = Finish::of(Texture::Wood).tinted(216, 178, 134).with(Gloss::Satin);
pub(super) const WALNUT: Finish = Finish::of(Texture::Wood).tinted(150, 106, 76).with(Gloss::Satin);
pub(super) const DARK_WOOD: Finish = Finish::of(Texture::Wood).tinted(110, 80, 62).with(Gloss::Satin);
pub(super) const WHITE: Finish = Finish::of(Texture::Paint).tinted(240, 236, 226).with(Gloss::Satin);
pub(super) const SAGE: Finish = Finish::of(Texture::Paint).tinted(166, 178, 160).with(Gloss::Satin);
pub(super) const GRAPHITE: Finish = Finish::of(Texture::Paint).tinted(92, 92, 96).with(Gloss::Satin);
pub(super) const BRASS: Finish = Finish::of(Texture::Paint).tinted(214, 178, 112).with(Gloss::Metal);
pub(super) const STEEL: Finish = Finish::of(Texture::Paint).tinted(200, 202, 204).with(Gloss::Metal);

pub(super) const SOFA: Finish = Finish::of(Texture::Weave).tinted(150, 160, 158);
pub(super) const SLATE: Finish = Finish::of(Texture::Weave).tinted(130, 140, 156);
pub(super) const OATMEAL: Finish = Finish::of(Texture::Weave).tinted(238, 226, 204);
pub(super) const MUSTARD: Finish = Finish::of(Texture::Weave).tinted(222, 178, 104);
pub(super) const RUST: Finish = Finish::of(Texture::Weave).tinted(202, 126, 92);
pub(super) const CURTAIN: Finish = Finish::of(Texture::Weave).tinted(232, 222, 206);
pub(super) const LINEN: Finish = Finish::of(Texture::Linen);
pub(super) const LEATHER: Finish = Finish::of(Texture::Stoneware).tinted(170, 118, 84).with(Gloss::Satin);

pub(super) const CREAM_GLAZE: Finish = Finish::of(Texture::Stoneware).tinted(240, 232, 216).with(Gloss::Glazed);
pub(super) const BLUE_GLAZE: Finish = Finish::of(Texture::Stoneware).tinted(116, 146, 170).with(Gloss::Glazed);
pub(super) const CLAY: Finish = Finish::of(Texture::Stoneware).tinted(206, 142, 108);
pub(super) const PAPER: Finish = Finish::of(Texture::Paper);
pub(super) const SPINES: Finish = Finish::of(Texture::Spines);
