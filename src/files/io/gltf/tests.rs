use json::mesh::Mode;

use super::*;

/// A scene of two triangles as a strip over four vertices, placed by `node`, with `more` entries in the root. The buffer
/// holds positions (48 bytes), colours (16 bytes) and indices (8 bytes), embedded as base64 written by this function.
fn scene(node: &str, primitive: &str, accessors: &str) -> String {
    let mut bytes = Vec::new();
    for v in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]] {
        v.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    for red in [255u8, 255, 255, 0] {
        bytes.extend([red, 0, 0, 255]);
    }
    [0u16, 1, 2, 3].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{node}],
            "meshes": [{{"primitives": [{primitive}]}}],
            "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{}"}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 16}},
                            {{"buffer": 0, "byteOffset": 64, "byteLength": 8}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
                          {{"bufferView": 1, "componentType": 5121, "count": 4, "type": "VEC4", "normalized": true}},
                          {{"bufferView": 2, "componentType": 5123, "count": 4, "type": "SCALAR"}} {accessors}]}}"#,
        bytes.len(),
        encode(&bytes)
    )
}

/// Base64 of a multiple of three bytes.
fn encode(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let groups = bytes.chunks(3).map(|c| u32::from_be_bytes([0, c[0], c[1], c[2]]));
    groups.flat_map(|g| [18, 12, 6, 0].map(|s| digits[(g >> s) as usize & 63] as char)).collect()
}

fn read(text: &str) -> Result<Mesh> {
    match parse(Path::new("no-such-folder/a.gltf"), text.as_bytes(), &mut Vec::new())? {
        Surface::Mesh(mesh) => Ok(mesh),
        Surface::Points(_) => panic!("not a mesh"),
    }
}

const STRIP: &str = r#"{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "mode": 5}"#;

fn normal(mesh: &Mesh, triangle: usize) -> DVec3 {
    let [a, b, c] = mesh.triangles[triangle].map(|v| mesh.positions[v as usize]);
    (b - a).cross(c - a).normalize()
}

/// If this failed, strips, node transforms or vertex colours would come out wrong or inside out.
#[test]
fn a_strip_faces_one_way_and_is_placed() {
    let mesh = read(&scene(r#"{"mesh": 0, "translation": [0, 0, 5], "scale": [2, 2, 2]}"#, STRIP, "")).unwrap();
    assert_eq!(mesh.positions[3], DVec3::new(2.0, 2.0, 5.0));
    assert_eq!(mesh.triangles.len(), 2);
    assert!((0..2).all(|t| normal(&mesh, t) == DVec3::Z), "{:?}", mesh.triangles);
    // Means of linear 1, 1, 1 and of 1, 1, 0.
    assert_eq!(mesh.colours, [[255, 0, 0], [213, 0, 0]]);
}

/// If this failed, mirrored instances would show their inside.
#[test]
fn a_mirrored_node_keeps_its_outside() {
    let mesh = read(&scene(r#"{"mesh": 0, "scale": [-1, 1, 1]}"#, STRIP, "")).unwrap();
    assert!((0..2).all(|t| normal(&mesh, t) == DVec3::Z), "{:?}", mesh.triangles);
}

/// If this failed, fans and parts without indices would be read wrongly.
#[test]
fn fans_and_plain_lists_are_unfolded() {
    let fan = nodes::unfold(Checked::Valid(Mode::TriangleFan), &[9, 1, 2, 3]).unwrap();
    assert_eq!(fan, [[1, 2, 9], [2, 3, 9]]);
    let mesh = read(&scene(r#"{"mesh": 0}"#, r#"{"attributes": {"POSITION": 0}}"#, "")).unwrap();
    assert_eq!((mesh.triangles, mesh.positions.len()), (vec![[0, 1, 2]], 3));
}

/// If this failed, sparse accessors would lose their changes.
#[test]
fn sparse_values_replace_the_dense_ones() {
    // Place 1 (the first u16 of the index buffer at offset 2) takes the first position.
    let sparse = r#", {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": 2, "byteOffset": 2, "componentType": 5123}, "values": {"bufferView": 0, "byteOffset": 24}}}"#;
    let mesh = read(&scene(r#"{"mesh": 0}"#, r#"{"attributes": {"POSITION": 3}}"#, sparse)).unwrap();
    assert_eq!(mesh.positions, [DVec3::ZERO, DVec3::Y, DVec3::Y]);
}

/// If this failed, a damaged or hostile file could panic, loop, or allocate without bound.
#[test]
fn faults_are_named() {
    let accessor = |accessor: &str| {
        let text = scene(r#"{"mesh": 0}"#, r#"{"attributes": {"POSITION": 3}}"#, &format!(", {accessor}"));
        read(&text).unwrap_err().to_string()
    };
    let far = accessor(r#"{"bufferView": 0, "byteOffset": 4, "componentType": 5126, "count": 4, "type": "VEC3"}"#);
    assert!(far.contains("accessor 3 of mesh 0, part 0 reaches beyond its buffer view"), "{far}");
    let huge = accessor(r#"{"componentType": 5126, "count": 99999999999, "type": "VEC3"}"#);
    assert!(huge.contains("announces more values than the file has bytes"), "{huge}");
    let wrong = accessor(r#"{"bufferView": 0, "componentType": 5126, "count": 4, "type": "SCALAR"}"#);
    assert!(wrong.contains("has 1 components"), "{wrong}");
    let part = |node: &str, primitive: &str| read(&scene(node, primitive, "")).unwrap_err().to_string();
    assert!(part(r#"{"mesh": 7}"#, STRIP).contains("mesh 7 is not there"));
    assert!(part(r#"{"mesh": 0, "children": [0]}"#, STRIP).contains("node 0 hangs in the scene twice"));
    assert!(part(r#"{"mesh": 0}"#, r#"{"attributes": {"POSITION": 77}}"#).contains("accessor 77"));
    assert!(
        part(r#"{"mesh": 0}"#, r#"{"attributes": {"POSITION": 0}, "mode": 1}"#)
            .contains("no triangles, and 1 parts of points or lines")
    );
    assert!(part(r#"{"mesh": 0, "scale": [1, 1, 1e39]}"#, STRIP).contains("line 1"), "1e39 is no f32");
    let needs = r#"{"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression", "EXT_baz"]}"#;
    assert!(read(needs).unwrap_err().to_string().contains("(KHR_draco_mesh_compression, EXT_baz)"));
    let far = part(r#"{"mesh": 0, "scale": [1e38, 1e38, 1e38], "translation": [3e38, 3e38, 3e38]}"#, STRIP);
    assert!(far.contains("triangles have a corner that is not finite"), "{far}");
    assert!(read(r#"{"asset": {"version": "1.0"}}"#).unwrap_err().to_string().contains("convert it"));
    let short = parse(Path::new("a.glb"), b"glTF\x02\0\0\0\xff\0\0\0", &mut Vec::new()).unwrap_err().to_string();
    assert!(short.contains("announces 255 bytes and has 12"), "{short}");
}

/// If this failed, triangles would be painted from another place of their texture, or with another curve than sRGB.
#[test]
fn a_texture_is_sampled_at_the_middle_of_a_triangle() {
    // Four texels: red, green / blue, white.
    let mut image = image::RgbImage::new(2, 2);
    for (i, colour) in [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]].into_iter().enumerate() {
        image.put_pixel(i as u32 % 2, i as u32 / 2, image::Rgb(colour));
    }
    let mut png = Vec::new();
    image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    png.resize(png.len().next_multiple_of(3), 0);
    // The positions' x and y serve as texture coordinates: the first triangle's middle is (1/3, 1/3), the red texel.
    let painted = |transform: &str, node: &str| {
        let part = r#"{"attributes": {"POSITION": 0, "TEXCOORD_0": 3}, "material": 0}"#;
        let uv = r#", {"bufferView": 3, "componentType": 5126, "count": 4, "type": "VEC2"}"#;
        let material = format!(
            r#""materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [1, 0.5, 1, 1], "baseColorTexture":
                {{"index": 0 {transform}}}}}}}], "textures": [{{"source": 0}}],
                "images": [{{"uri": "data:image/png;base64,{}"}}],"#,
            encode(&png)
        );
        let view = r#", {"buffer": 0, "byteLength": 44, "byteStride": 12}],
            "accessors""#;
        let text = scene(node, part, uv).replace("\"meshes\"", &format!("{material} \"meshes\""));
        let end = text.find("\"accessors\"").unwrap();
        let text = format!(
            "{}{view}{}",
            text[..end].trim_end().trim_end_matches(',').trim_end_matches(']'),
            &text[end + 11..]
        );
        read(&text).unwrap().colours
    };
    assert_eq!(painted("", r#"{"mesh": 0}"#), [[255, 0, 0]]);
    let moved = r#", "extensions": {"KHR_texture_transform": {"offset": [0.5, 1]}}"#;
    // Half of linear green is 188 in sRGB.
    assert_eq!(painted(moved, r#"{"mesh": 0}"#), [[0, 188, 0]]);
    // A quarter turn takes (1/3, 1/3) to (1/3, -1/3), which repeats at (1/3, 2/3): the blue texel.
    let turned = r#", "extensions": {"KHR_texture_transform": {"rotation": 1.5707963}}"#;
    assert_eq!(painted(turned, r#"{"mesh": 0}"#), [[0, 0, 255]]);
}
