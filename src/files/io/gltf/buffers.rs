//! The bytes of a glTF file: its chunks, buffers and buffer views.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use gltf_json as json;

use crate::error::{Error, Result};
use crate::files::io::binary::Cursor;

/// Splits a .glb into its JSON and its binary chunk; a .gltf is all JSON.
pub(super) fn split<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let mut cursor = Cursor::new(path, bytes, 4);
    let version = cursor.u32("the version")?;
    if version != 2 {
        return Err(cursor.error(format!("this is binary glTF {version}; convert it to glTF 2.0")));
    }
    let length = cursor.u32("the length")?;
    if length as usize > bytes.len() {
        return Err(cursor.error(format!(
            "the file is cut short: it announces {length} bytes and has {}; copy or export it again",
            bytes.len()
        )));
    }
    let length = cursor.u32("the first chunk's length")?;
    if &cursor.array("the first chunk's type")? != b"JSON" {
        return Err(cursor.error("the first chunk is not JSON; export the file again"));
    }
    let text = cursor.take(length as usize, "the JSON chunk")?;
    if cursor.rest().len() < 8 {
        return Ok((text, None));
    }
    let length = cursor.u32("the second chunk's length")?;
    let is_binary = &cursor.array("the second chunk's type")? == b"BIN\0";
    let chunk = cursor.take(length as usize, "the binary chunk")?;
    Ok((text, is_binary.then_some(chunk)))
}

/// All buffers of a file.
pub(super) struct Buffers<'a> {
    pub path: &'a Path,
    pub root: &'a json::Root,
    /// The distinct sources of bytes.
    sources: Vec<Cow<'a, [u8]>>,
    /// Which source each buffer is.
    buffers: Vec<usize>,
}

impl<'a> Buffers<'a> {
    /// Finds the bytes of every buffer: the binary chunk, a data URI, or a file beside `path`.
    pub fn load(path: &'a Path, root: &'a json::Root, chunk: Option<&'a [u8]>) -> Result<Self> {
        let mut sources: Vec<Cow<'a, [u8]>> = Vec::new();
        let mut buffers = Vec::with_capacity(root.buffers.len());
        // Buffers of one URI are one source, which is read once.
        let mut known: HashMap<Option<&str>, usize> = HashMap::new();
        for (i, buffer) in root.buffers.iter().enumerate() {
            let refuse = |what: String| Error::input(path, format!("buffer {i} {what}"));
            let uri = buffer.uri.as_deref();
            let source = match known.get(&uri) {
                Some(&source) => source,
                None => {
                    sources.push(match (uri, chunk) {
                        (Some(uri), _) => {
                            resolve(path, uri).map_err(|what| refuse(format!("is missing: {what}")))?.into()
                        }
                        (None, Some(chunk)) => chunk.into(),
                        (None, None) => return Err(refuse("is nowhere to be found; export the file again".into())),
                    });
                    known.insert(uri, sources.len() - 1);
                    sources.len() - 1
                }
            };
            let (announced, found) = (buffer.byte_length.0, sources[source].len());
            if announced > found as u64 {
                return Err(refuse(format!(
                    "is cut short: it announces {announced} bytes and has {found}; copy or export it again"
                )));
            }
            buffers.push(source);
        }
        Ok(Self { path, root, sources, buffers })
    }

    /// Bytes of a buffer view.
    pub fn view(&self, index: usize) -> Result<&[u8]> {
        let refuse = |what| Err(Error::input(self.path, format!("buffer view {index} {what}; export the file again")));
        let Some(view) = self.root.buffer_views.get(index) else { return refuse("is not there") };
        let Some(&source) = self.buffers.get(view.buffer.value()) else {
            return refuse("is of a buffer that is not there");
        };
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0);
        let range = usize::try_from(start).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        match range.and_then(|(start, end)| self.sources[source].get(start..end)) {
            Some(bytes) => Ok(bytes),
            None => refuse("reaches beyond its buffer"),
        }
    }

    /// Bytes of all buffers together: more things than this cannot be described by them.
    pub fn size(&self) -> usize {
        self.sources.iter().map(|source| source.len()).sum()
    }
}

/// The bytes behind a URI: base64 data, or a file beside `path`.
pub(super) fn resolve(path: &Path, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((_, data)) = data.split_once(";base64,") else { return Err("its data URI is not base64".into()) };
        return base64(data.as_bytes()).ok_or_else(|| "its base64 data is damaged; export the file again".into());
    }
    let name = percent_decoded(uri);
    let relative = Path::new(&name);
    if name.contains("://") || relative.is_absolute() {
        return Err(format!("{name:?} is no file beside this one; store it there"));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(relative);
    // Only a plain file is opened: a name can lead to a device that never ends.
    if !file.is_file() {
        return Err(format!("the file {name:?} is not beside this one; store it there"));
    }
    std::fs::read(&file).map_err(|e| format!("{name:?}: {e}"))
}

/// A URI's path with `%20` and the like decoded.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = (first == b'%').then(|| after.get(..2)).flatten();
        let code = code.and_then(|hex| std::str::from_utf8(hex).ok()).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Decodes base64 (RFC 4648) with or without padding.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii();
    let padding = text.iter().rev().take_while(|&&c| c == b'=').count().min(2);
    let text = &text[..text.len() - padding];
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.chunks(4) {
        let mut bits = 0u32;
        for &c in group {
            let value = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' | b'-' => 62,
                b'/' | b'_' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        let whole = match group.len() {
            1 => return None,
            n => n - 1,
        };
        bits <<= 6 * (4 - group.len());
        bytes.extend(&bits.to_be_bytes()[1..1 + whole]);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, embedded buffers would be shifted or cut: the test vectors are those of RFC 4648.
    #[test]
    fn base64_follows_its_standard() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmE=", "fooba"), ("Zm8", "fo")]
        {
            assert_eq!(base64(text.as_bytes()).unwrap(), bytes.as_bytes());
        }
        assert!(base64(b"Z").is_none() && base64(b"Zm9*").is_none());
    }

    /// If this failed, files with blanks in their names would not be found, or a file could reach beyond its folder.
    #[test]
    fn names_are_decoded_and_kept_beside_the_file() {
        assert_eq!(percent_decoded("a%20b%2Fc%"), "a b/c%");
        assert!(resolve(Path::new("x/a.gltf"), "/etc/hostname").unwrap_err().contains("no file beside"));
        assert!(resolve(Path::new("x/a.gltf"), "https://a.b/c").unwrap_err().contains("no file beside"));
    }
}
