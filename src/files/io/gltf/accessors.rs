//! Typed reading of accessors, dense and sparse.

use gltf_json as json;
use json::accessor::{Accessor, ComponentType, Type};
use json::validation::Checked;

use super::buffers::Buffers;
use crate::error::{Error, Result};

/// Values in bytes, evenly spaced; checked to lie inside.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    kind: ComponentType,
    /// Whether integers represent fractions of their largest value.
    normalized: bool,
}

impl Strided<'_> {
    /// Component `c` of value `i`.
    fn get(&self, i: usize, c: usize) -> f64 {
        let at = i * self.stride + c * self.kind.size();
        let b = &self.bytes[at..at + self.kind.size()];
        let (value, largest) = match self.kind {
            ComponentType::I8 => (f64::from(b[0] as i8), 127.0),
            ComponentType::U8 => (f64::from(b[0]), 255.0),
            ComponentType::I16 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            ComponentType::U16 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            ComponentType::U32 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), f64::from(u32::MAX)),
            ComponentType::F32 => return f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        if self.normalized { (value / largest).max(-1.0) } else { value }
    }
}

impl Buffers<'_> {
    /// The values of an accessor with `N` components, or more of which the first `N` are taken; `what` names the part
    /// for messages. Integers are as stored, or fractions where the accessor is normalised.
    pub fn vectors<const N: usize>(&self, index: usize, what: &str) -> Result<Vec<[f64; N]>> {
        let (accessor, kind, components) = self.accessor(index, what)?;
        if components < N || components > 4 {
            return Err(self.fault(index, what, &format!("has {components} components and not {N}")));
        }
        self.values(index, what, accessor, kind, components)
    }

    /// The vertex indices of an accessor.
    pub fn indices(&self, index: usize, what: &str) -> Result<Vec<u32>> {
        let (accessor, kind, components) = self.accessor(index, what)?;
        if components != 1 || !matches!(kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(self.fault(index, what, "does not hold unsigned indices"));
        }
        let values = self.values::<1>(index, what, accessor, kind, components)?;
        Ok(values.into_iter().map(|[v]| v as u32).collect())
    }

    /// An accessor, its type and its number of components.
    fn accessor(&self, index: usize, what: &str) -> Result<(&Accessor, ComponentType, usize)> {
        let Some(accessor) = self.root.accessors.get(index) else {
            return Err(self.fault(index, what, "is not there"));
        };
        let (Checked::Valid(kind), Checked::Valid(shape)) = (accessor.component_type, accessor.type_) else {
            return Err(self.fault(index, what, "has an unknown type"));
        };
        let components = match shape {
            // Columns of small matrices are padded, but none of the attributes read here is a matrix.
            Type::Mat2 | Type::Mat3 | Type::Mat4 => 16,
            _ => shape.multiplicity(),
        };
        Ok((accessor, kind.0, components))
    }

    fn fault(&self, index: usize, what: &str, fault: &str) -> Error {
        Error::input(self.path, format!("accessor {index} of {what} {fault}; export the file again"))
    }

    /// All values, with the sparse ones put in place.
    fn values<const N: usize>(
        &self,
        index: usize,
        what: &str,
        accessor: &Accessor,
        kind: ComponentType,
        components: usize,
    ) -> Result<Vec<[f64; N]>> {
        let count = match usize::try_from(accessor.count.0) {
            Ok(count) if count <= self.size() => count,
            _ => return Err(self.fault(index, what, "announces more values than the file has bytes")),
        };
        let normalized = accessor.normalized;
        let element = components * kind.size();
        let strided = |view: usize, offset: u64, count: usize, kind: ComponentType, element: usize| {
            let bytes = self.view(view)?;
            let stride = self.root.buffer_views[view].byte_stride.map_or(element, |stride| stride.0);
            let start = usize::try_from(offset).unwrap_or(usize::MAX).min(bytes.len());
            let end = match count {
                0 => Some(0),
                _ => (count - 1).checked_mul(stride).and_then(|last| last.checked_add(element)),
            };
            let fits = |rest: &&[u8]| stride >= element && end.is_some_and(|end| end <= rest.len());
            match bytes.get(start..).filter(fits) {
                Some(bytes) => Ok(Strided { bytes, stride, kind, normalized }),
                None => Err(self.fault(index, what, "reaches beyond its buffer view")),
            }
        };
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let dense = strided(view.value(), offset, count, kind, element)?;
                (0..count).map(|i| std::array::from_fn(|c| dense.get(i, c))).collect()
            }
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(place_kind) = sparse.indices.component_type else {
                return Err(self.fault(index, what, "has places of an unknown type"));
            };
            let place_kind = place_kind.0;
            let changed = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
            let view = sparse.indices.buffer_view.value();
            let mut places = strided(view, sparse.indices.byte_offset.0, changed, place_kind, place_kind.size())?;
            places.normalized = false;
            let view = sparse.values.buffer_view.value();
            let changes = strided(view, sparse.values.byte_offset.0, changed, kind, element)?;
            for i in 0..changed {
                match values.get_mut(places.get(i, 0) as usize) {
                    Some(value) => *value = std::array::from_fn(|c| changes.get(i, c)),
                    None => return Err(self.fault(index, what, "changes a value beyond its last")),
                }
            }
        }
        Ok(values)
    }
}
