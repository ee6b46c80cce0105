//! Just enough SPIR-V reflection for compute stages: storage-buffer bindings, the push-constant block, the structs that
//! buffers hold, specialisation constants and the workgroup size.

use std::collections::HashMap;

/// A scalar, vector, struct or array member of a struct.
#[derive(PartialEq)]
pub struct Member {
    pub name: String,
    pub offset: u32,
    pub size: u32,
}

/// A struct with explicit offsets; `size` is its stride in an array where it is used in one.
#[derive(Default, PartialEq)]
pub struct Layout {
    pub name: String,
    pub size: u32,
    pub members: Vec<Member>,
}

/// A storage buffer.
pub struct Binding {
    pub slot: u32,
    pub name: String,
    pub writable: bool,
}

/// What a module declares.
pub struct Module {
    pub local_size: [u32; 3],
    /// Whether it has operations of subgroups.
    pub subgroups: bool,
    pub bindings: Vec<Binding>,
    pub push: Layout,
    pub structs: Vec<Layout>,
    /// Number and name of each specialisation constant.
    pub specialised: Vec<(u32, String)>,
}

enum Type {
    Scalar(u32),
    Vector(u32, u32),
    Matrix,
    Array(u32, u32),
    RuntimeArray(u32),
    Struct(Vec<u32>),
    Pointer(u32),
}

#[derive(Default)]
struct Tables {
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    offsets: HashMap<(u32, u32), u32>,
    member_readonly: HashMap<(u32, u32), bool>,
    strides: HashMap<u32, u32>,
    slots: HashMap<u32, u32>,
    types: HashMap<u32, Type>,
    constants: HashMap<u32, u32>,
    // Of what is decorated with SpecId.
    specialised: HashMap<u32, u32>,
    composites: HashMap<u32, Vec<u32>>,
    workgroup_size: Option<u32>,
    variables: Vec<(u32, u32, u32)>,
    local_size: [u32; 3],
    subgroups: bool,
}

const STORAGE_BUFFER: u32 = 12;
const PUSH_CONSTANT: u32 = 9;

/// Reads a SPIR-V module. Errors name what the reader does not support.
pub fn reflect(words: &[u32]) -> Result<Module, String> {
    let tables = read(words)?;
    let mut module = Module {
        local_size: tables.local_size,
        subgroups: tables.subgroups,
        bindings: Vec::new(),
        push: Layout::default(),
        structs: Vec::new(),
        specialised: tables.specialised()?,
    };
    for &(pointer, id, class) in &tables.variables {
        let Some(Type::Pointer(block)) = tables.types.get(&pointer) else { continue };
        if class == PUSH_CONSTANT {
            module.push = tables.layout(*block)?;
        } else if class == STORAGE_BUFFER {
            let Some(Type::Struct(members)) = tables.types.get(block) else {
                return Err("arrays of buffers are not supported".into());
            };
            // The block's only member names the buffer: `readonly buffer Splats { CameraState splats[]; }` is `splats`.
            let [member] = members[..] else { return Err("a buffer block has exactly one member".into()) };
            module.bindings.push(Binding {
                slot: *tables.slots.get(&id).ok_or("a buffer without a binding")?,
                name: tables.member_names.get(&(*block, 0)).cloned().unwrap_or_default(),
                writable: !tables.member_readonly.contains_key(&(*block, 0)),
            });
            let element = match tables.types.get(&member) {
                Some(Type::RuntimeArray(element) | Type::Array(element, _)) => *element,
                _ => member,
            };
            if let Some(Type::Struct(_)) = tables.types.get(&element) {
                let mut layout = tables.layout(element)?;
                layout.size = tables.strides.get(&member).copied().unwrap_or(layout.size);
                match module.structs.iter().find(|known| known.name == layout.name) {
                    Some(known) if *known != layout => {
                        return Err(format!("two layouts of the struct {}", layout.name));
                    }
                    Some(_) => {}
                    None => module.structs.push(layout),
                }
            } else if let Some(stride) = tables.strides.get(&member) {
                let size = tables.size(element)?;
                // Three words are aligned as four.
                let expected = if size == 12 { 16 } else { size };
                if *stride != expected {
                    return Err(format!(
                        "an array of stride {stride} where std430 has {expected}; declare the block std430"
                    ));
                }
            }
        }
    }
    module.bindings.sort_by_key(|binding| binding.slot);
    Ok(module)
}

fn read(words: &[u32]) -> Result<Tables, String> {
    if words.first() != Some(&0x0723_0203) {
        return Err("not a SPIR-V module".into());
    }
    let mut tables = Tables::default();
    let mut at = 5;
    while at < words.len() {
        let (length, opcode) = ((words[at] >> 16) as usize, words[at] & 0xffff);
        if length == 0 || at + length > words.len() {
            return Err("a truncated SPIR-V module".into());
        }
        tables.instruction(opcode, &words[at + 1..at + length]);
        at += length;
    }
    Ok(tables)
}

impl Tables {
    /// Opcodes by their numbers in the SPIR-V specification, section 3.42.
    fn instruction(&mut self, opcode: u32, w: &[u32]) {
        match (opcode, w) {
            (5, [id, rest @ ..]) => drop(self.names.insert(*id, text(rest))),
            (6, [id, member, rest @ ..]) => drop(self.member_names.insert((*id, *member), text(rest))),
            // OpExecutionMode LocalSize
            (16, [_, 17, x, y, z]) => self.local_size = [*x, *y, *z],
            // OpCapability GroupNonUniform and what builds on it
            (17, [61..=68]) => self.subgroups = true,
            // OpTypeInt, OpTypeFloat
            (21 | 22, [id, bits, ..]) => drop(self.types.insert(*id, Type::Scalar(bits / 8))),
            (23, [id, element, count]) => drop(self.types.insert(*id, Type::Vector(*element, *count))),
            (24, [id, ..]) => drop(self.types.insert(*id, Type::Matrix)),
            (28, [id, element, count]) => drop(self.types.insert(*id, Type::Array(*element, *count))),
            (29, [id, element]) => drop(self.types.insert(*id, Type::RuntimeArray(*element))),
            (30, [id, members @ ..]) => drop(self.types.insert(*id, Type::Struct(members.to_vec()))),
            (32, [id, _, pointee]) => drop(self.types.insert(*id, Type::Pointer(*pointee))),
            // OpConstant, OpSpecConstant
            (43 | 50, [_, id, value, ..]) => drop(self.constants.insert(*id, *value)),
            (59, [pointer, id, class, ..]) => self.variables.push((*pointer, *id, *class)),
            // OpSpecConstantComposite
            (51, [_, id, parts @ ..]) => drop(self.composites.insert(*id, parts.to_vec())),
            // OpDecorate: SpecId 1, ArrayStride 6, BuiltIn 11 WorkgroupSize 25, Binding 33
            (71, [id, 1, number]) => drop(self.specialised.insert(*id, *number)),
            (71, [id, 11, 25]) => self.workgroup_size = Some(*id),
            (71, [id, 6, stride]) => drop(self.strides.insert(*id, *stride)),
            (71, [id, 33, slot]) => drop(self.slots.insert(*id, *slot)),
            // OpMemberDecorate: NonWritable 24, Offset 35
            (72, [id, member, 24]) => drop(self.member_readonly.insert((*id, *member), true)),
            (72, [id, member, 35, offset]) => drop(self.offsets.insert((*id, *member), *offset)),
            _ => {}
        }
    }

    /// Numbers and names of the specialisation constants. `local_size_x_id` makes one without a name, which counts as
    /// `LOCAL_SIZE_X` unless another of its number has one.
    fn specialised(&self) -> Result<Vec<(u32, String)>, String> {
        let mut found = std::collections::BTreeMap::new();
        for (id, number) in &self.specialised {
            if let Some(name) = self.names.get(id).filter(|name| !name.is_empty())
                && found.insert(*number, name.clone()).is_some_and(|other| other != *name)
            {
                return Err(format!("two specialisation constants have the number {number}"));
            }
        }
        let sides = self.workgroup_size.and_then(|id| self.composites.get(&id)).map_or(&[][..], Vec::as_slice);
        for (side, name) in sides.iter().zip(["LOCAL_SIZE_X", "LOCAL_SIZE_Y", "LOCAL_SIZE_Z"]) {
            if let Some(number) = self.specialised.get(side) {
                found.entry(*number).or_insert_with(|| name.to_owned());
            }
        }
        Ok(found.into_iter().collect())
    }

    fn layout(&self, id: u32) -> Result<Layout, String> {
        let Some(Type::Struct(members)) = self.types.get(&id) else { return Err("a block that is no struct".into()) };
        let mut layout = Layout { name: self.names.get(&id).cloned().unwrap_or_default(), ..Layout::default() };
        for (index, member) in members.iter().enumerate() {
            let key = (id, index as u32);
            let offset = *self.offsets.get(&key).ok_or("a member without an offset")?;
            let size = self.size(*member)?;
            layout.size = layout.size.max(offset + size);
            layout.members.push(Member {
                name: self.member_names.get(&key).cloned().unwrap_or_default(),
                offset,
                size,
            });
        }
        Ok(layout)
    }

    fn size(&self, id: u32) -> Result<u32, String> {
        Ok(match self.types.get(&id) {
            Some(Type::Scalar(bytes)) => *bytes,
            Some(Type::Vector(element, count)) => self.size(*element)? * count,
            Some(Type::Matrix) => return Err("matrices in blocks are not supported; declare their columns".into()),
            Some(Type::Array(element, count)) => {
                let count = self.constants.get(count).ok_or("an array length that is no constant")?;
                self.strides.get(&id).copied().map_or_else(|| self.size(*element), Ok)? * count
            }
            Some(Type::Struct(_)) => self.layout(id)?.size,
            _ => return Err("a member type that reflection does not know".into()),
        })
    }
}

/// A SPIR-V string literal: UTF-8, four bytes a word, NUL at the end.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
