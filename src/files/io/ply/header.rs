//! The header of a PLY file.

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};

/// How values are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a scalar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    /// Both spellings that are in use.
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one binary value.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A value, or a list of values, that each row of an element has.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    /// Type of the value, or of a list's items.
    pub kind: Kind,
    /// Type of a list's length; none for a single value.
    pub length: Option<Kind>,
}

/// A table of the file.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What the header announces.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// What positions of splats are less by, which are single precision: `comment camsplat offset X Y Z`.
    pub origin: DVec3,
    /// Whether splats were trained with Mip-Splatting's 2D filter: `comment SplatRenderMode: mip`, as Brush writes it.
    pub antialiased: bool,
    /// Offset of the first byte after the header.
    pub end: usize,
}

impl Header {
    /// Parses the header at the start of `bytes`.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        if bytes.is_empty() {
            return Err(Error::input(path, "the file is empty; export it again"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut origin = DVec3::ZERO;
        let mut antialiased = false;
        let mut end = 0;
        for number in 1.. {
            let Some(length) = bytes[end..].iter().position(|&b| b == b'\n') else {
                let what = format!("line {number}: the header has no \"end_header\"; this is not a whole PLY file");
                return Err(Error::input(path, what));
            };
            let text = String::from_utf8_lossy(&bytes[end..end + length]);
            end += length + 1;
            let refuse = |what: &str| Err(Error::input(path, format!("line {number}: {text:?} {what}")));
            let words: Vec<&str> = text.split_whitespace().collect();
            match words[..] {
                ["ply"] if number == 1 => {}
                _ if number == 1 => return refuse("is not \"ply\"; this is not a PLY file"),
                ["end_header"] => break,
                ["comment", "camsplat", "offset", x, y, z] => {
                    let [Ok(x), Ok(y), Ok(z)] = [x, y, z].map(str::parse::<f64>) else {
                        return refuse("gives no offset in three numbers");
                    };
                    origin = DVec3::new(x, y, z);
                }
                ["comment", "SplatRenderMode:", mode] => antialiased = mode == "mip",
                ["comment" | "obj_info", ..] | [] => {}
                ["format", name, "1.0"] => {
                    encoding = match name {
                        "ascii" => Some(Encoding::Ascii),
                        "binary_little_endian" => Some(Encoding::LittleEndian),
                        "binary_big_endian" => Some(Encoding::BigEndian),
                        _ => return refuse("is no known format; export as ascii or binary PLY 1.0"),
                    }
                }
                ["element", name, count] => {
                    let Ok(count) = count.parse() else { return refuse("does not end in a count") };
                    if elements.iter().any(|e| e.name == name) {
                        return refuse("names an element for the second time");
                    }
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                ["property", ref kinds @ .., name] => {
                    let (kind, length) = match *kinds {
                        [kind] => (Kind::named(kind), None),
                        ["list", length, kind] => (Kind::named(kind), Kind::named(length)),
                        _ => (None, None),
                    };
                    let is_list = kinds.first() == Some(&"list");
                    let (Some(kind), true) = (kind, length.is_some() == is_list) else {
                        return refuse("has an unknown type; known are char to double and lists of them");
                    };
                    let Some(element) = elements.last_mut() else { return refuse("stands before any element") };
                    // Some programs write a column twice; the first one counts, and a second one has no name that is asked for.
                    let again = element.properties.iter().any(|p| p.name == name);
                    let name = if again { format!("{name} {}", element.properties.len()) } else { name.into() };
                    element.properties.push(Property { name, kind, length });
                }
                ["format" | "element" | "property", ..] => return refuse("is no header line; export the file again"),
                // Some programs forget the word `comment`.
                _ => {}
            }
        }
        match encoding {
            Some(encoding) => Ok(Self { encoding, elements, origin, antialiased, end }),
            None => Err(Error::input(path, "the header has no \"format\" line; export the file again")),
        }
    }

    /// The element of that name.
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// Type of a single-valued property.
    pub fn kind(&self, element: &str, property: &str) -> Option<Kind> {
        let property = self.element(element)?.properties.iter().find(|p| p.name == property)?;
        property.length.is_none().then_some(property.kind)
    }
}
