//! Reads an SPZ file with the crate `spz` and writes it again: `spz_crate IN.spz OUT.spz`, in the axes of the file that was converted.

use spz::prelude::*;

fn main() {
    let [_, from, to] = std::env::args().collect::<Vec<_>>().try_into().expect("give IN.spz and OUT.spz");
    let read = UnpackOptions::builder().to_coord_system(CoordinateSystem::UNSPECIFIED).build();
    let splats = GaussianSplat::load_packed_from_file(&from, &read).expect("it does not read the file");
    let written = PackOptions::builder().from(CoordinateSystem::UNSPECIFIED).build();
    splats.save_as_packed(&to, &written).expect("it does not write the file");
}
