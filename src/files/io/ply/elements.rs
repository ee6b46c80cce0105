//! The values of a PLY file, column by column.

use std::collections::HashMap;
use std::path::Path;

use super::header::{Encoding, Header, Kind, Property};
use crate::error::{Error, Result};

/// A list for each row of an element.
#[derive(Debug, Default)]
pub(super) struct Lists {
    /// Where each list ends in `values`.
    ends: Vec<usize>,
    values: Vec<f64>,
}

impl Lists {
    /// Number of lists.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// The lists in order.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.values[start..end])
    }
}

/// The requested columns of a file by element and property; every PLY type is exact in f64.
#[derive(Debug, Default)]
pub(super) struct Columns {
    scalars: HashMap<(String, String), Vec<f64>>,
    lists: HashMap<(String, String), Lists>,
}

impl Columns {
    /// Takes the column of a single-valued property.
    pub fn scalars(&mut self, element: &str, property: &str) -> Option<Vec<f64>> {
        self.scalars.remove(&(element.into(), property.into()))
    }

    /// Adds a column.
    pub fn insert(&mut self, element: &str, property: &str, values: Vec<f64>) {
        self.scalars.insert((element.into(), property.into()), values);
    }

    /// Takes the column of a list property.
    pub fn lists(&mut self, element: &str, property: &str) -> Option<Lists> {
        self.lists.remove(&(element.into(), property.into()))
    }
}

/// One column while it is read.
enum Column {
    Skipped,
    Scalars(Vec<f64>),
    Lists(Lists),
}

/// Reads the columns that `wanted(element, property)` accepts. Nothing is allocated for rows that are not in the file.
pub(super) fn read(path: &Path, bytes: &[u8], header: &Header, wanted: impl Fn(&str, &str) -> bool) -> Result<Columns> {
    let mut columns = Columns::default();
    let mut values = Values { bytes, at: header.end, encoding: header.encoding };
    for element in &header.elements {
        let least = element.properties.iter().map(|p| values.least(p.length.unwrap_or(p.kind))).sum::<usize>();
        if least == 0 {
            continue;
        }
        if element.count > values.left() / least {
            return Err(Error::input(
                path,
                format!(
                    "byte {}: the file is cut short: it announces {} of the element {:?}, {least} bytes each or more, \
                     and {} bytes are left; copy or export it again",
                    values.at,
                    element.count,
                    element.name,
                    bytes.len() - values.at
                ),
            ));
        }
        let start = |property: &Property| match property.length {
            _ if !wanted(&element.name, &property.name) => Column::Skipped,
            None => Column::Scalars(Vec::with_capacity(element.count)),
            Some(_) => Column::Lists(Lists::default()),
        };
        let mut table: Vec<Column> = element.properties.iter().map(start).collect();
        for row in 0..element.count {
            for (property, column) in element.properties.iter().zip(&mut table) {
                values.cell(property, column).map_err(|what| {
                    Error::input(
                        path,
                        format!("byte {}: {} {row}, property {:?}: {what}", values.at, element.name, property.name),
                    )
                })?;
            }
        }
        for (property, column) in element.properties.iter().zip(table) {
            let key = (element.name.clone(), property.name.clone());
            match column {
                Column::Skipped => {}
                Column::Scalars(scalars) => drop(columns.scalars.insert(key, scalars)),
                Column::Lists(lists) => drop(columns.lists.insert(key, lists)),
            }
        }
    }
    Ok(columns)
}

/// A number, also such as Windows' libraries print that are none: "-nan(ind)", "1.#QNAN", "1.#INF".
fn number(text: &str) -> Option<f64> {
    text.parse().ok().or_else(|| {
        let text = text.to_ascii_lowercase();
        (text.contains("nan") || text.contains("1.#")).then_some(f64::NAN)
    })
}

/// The values that follow the header.
struct Values<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl Values<'_> {
    /// Fewest bytes that a value of that type takes: in ascii, a digit and a separator.
    fn least(&self, kind: Kind) -> usize {
        if self.encoding == Encoding::Ascii { 2 } else { kind.size() }
    }

    /// Bytes left for values; the last value of an ascii file needs nothing after it.
    fn left(&self) -> usize {
        self.bytes.len() - self.at + usize::from(self.encoding == Encoding::Ascii)
    }

    /// Reads what one row has of `property` into its column.
    fn cell(&mut self, property: &Property, column: &mut Column) -> Result<(), String> {
        let Some(length) = property.length else {
            let value = self.value(property.kind)?;
            if let Column::Scalars(scalars) = column {
                scalars.push(value);
            }
            return Ok(());
        };
        let length = self.value(length)?;
        let most = self.left() / self.least(property.kind);
        if !(length >= 0.0 && length.fract() == 0.0 && length <= most as f64) {
            return Err(format!("a list of {length} values does not fit the file; copy or export it again"));
        }
        for _ in 0..length as usize {
            let value = self.value(property.kind)?;
            if let Column::Lists(lists) = column {
                lists.values.push(value);
            }
        }
        if let Column::Lists(lists) = column {
            lists.ends.push(lists.values.len());
        }
        Ok(())
    }

    /// The next value.
    fn value(&mut self, kind: Kind) -> Result<f64, String> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            Encoding::LittleEndian => Ok(match kind {
                Kind::I8 => i8::from_le_bytes(self.array()?).into(),
                Kind::U8 => u8::from_le_bytes(self.array()?).into(),
                Kind::I16 => i16::from_le_bytes(self.array()?).into(),
                Kind::U16 => u16::from_le_bytes(self.array()?).into(),
                Kind::I32 => i32::from_le_bytes(self.array()?).into(),
                Kind::U32 => u32::from_le_bytes(self.array()?).into(),
                Kind::F32 => f32::from_le_bytes(self.array()?).into(),
                Kind::F64 => f64::from_le_bytes(self.array()?),
            }),
            Encoding::BigEndian => Ok(match kind {
                Kind::I8 => i8::from_be_bytes(self.array()?).into(),
                Kind::U8 => u8::from_be_bytes(self.array()?).into(),
                Kind::I16 => i16::from_be_bytes(self.array()?).into(),
                Kind::U16 => u16::from_be_bytes(self.array()?).into(),
                Kind::I32 => i32::from_be_bytes(self.array()?).into(),
                Kind::U32 => u32::from_be_bytes(self.array()?).into(),
                Kind::F32 => f32::from_be_bytes(self.array()?).into(),
                Kind::F64 => f64::from_be_bytes(self.array()?),
            }),
        }
    }

    /// The next bytes of a binary file.
    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let Some(taken) = self.bytes.get(self.at..self.at + N) else {
            return Err("the file is cut short here; copy or export it again".into());
        };
        let mut array = [0; N];
        array.copy_from_slice(taken);
        self.at += N;
        Ok(array)
    }

    /// The next number of an ascii file.
    fn word(&mut self) -> Result<f64, String> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let rest = &rest[start..];
        let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        if word.is_empty() {
            return Err("the file is cut short here; copy or export it again".into());
        }
        self.at += start;
        match std::str::from_utf8(word).ok().and_then(number) {
            Some(value) => {
                self.at += word.len();
                Ok(value)
            }
            None => Err(format!("{:?} is not a number", String::from_utf8_lossy(&word[..word.len().min(40)]))),
        }
    }
}
