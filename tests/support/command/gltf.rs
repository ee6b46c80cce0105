//! A scene with materials, and light around it.

use super::Place;

/// A cube of side 2 as glTF, each side of its own four vertices, with `more` in its root.
pub fn cube(more: &str) -> String {
    let mut bytes = Vec::new();
    let mut indices: Vec<u16> = Vec::new();
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let first = (bytes.len() / 12) as u16;
            for [u, v] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0f32]] {
                let mut corner = [0.0; 3];
                (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (side, u, v);
                corner.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            }
            let order = if side > 0.0 { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
            indices.extend(order.map(|i| first + i));
        }
    }
    indices.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    let data = base64(&bytes);
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}}]}}],
            "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{data}"}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 288}}, {{"buffer": 0, "byteOffset": 288, "byteLength": 72}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 24, "type": "VEC3"}},
                          {{"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}}] {more}}}"#,
        bytes.len()
    )
}

/// Base64 of a multiple of three bytes.
fn base64(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let groups = bytes.chunks(3).map(|c| u32::from_be_bytes([0, c[0], c[1], c[2]]));
    groups.flat_map(|g| [18, 12, 6, 0].map(|s| digits[(g >> s) as usize & 63] as char)).collect()
}

/// An environment map that is as bright everywhere.
pub fn sky() -> Vec<u8> {
    let mut sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    sky.extend([128, 128, 128, 129].repeat(8));
    sky
}

/// A place with `cube.gltf`, a cube of one colour, and `sky.hdr`, light from all around.
pub fn lit_cube() -> Place {
    let place = Place::new();
    let material = r#"{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.1, 1], "metallicFactor": 0}}"#;
    place.write("cube.gltf", cube(&format!(", \"materials\": [{material}]")));
    place.write("sky.hdr", sky());
    place
}
