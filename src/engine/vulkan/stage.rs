//! Stages: what the host declares of a compute shader, checked against the compiled SPIR-V while the crate compiles.

use super::buffer::Buffer;

/// A member of a struct that host and device share. Offset and size in bytes.
pub struct Member {
    /// Its name, the same in GLSL and Rust.
    pub name: &'static str,
    /// Byte offset.
    pub offset: usize,
    /// Size in bytes.
    pub size: usize,
}

/// A struct that host and device share.
pub struct Layout {
    /// Its name, the same in GLSL and Rust.
    pub name: &'static str,
    /// Size of one element in an array, in bytes.
    pub size: usize,
    /// Its members in order.
    pub members: &'static [Member],
}

/// Reflection data of a compiled shader.
pub struct Reflected {
    /// Threads per workgroup.
    pub local_size: [u32; 3],
    /// Whether it has operations of subgroups.
    pub subgroups: bool,
    /// Slot, name and whether the shader may write, of each storage buffer.
    pub bindings: &'static [(u32, &'static str, bool)],
    /// The push-constant block.
    pub push: Layout,
    /// The structs that the buffers hold.
    pub structs: &'static [Layout],
    /// Number and name of each specialisation constant.
    pub constants: &'static [(u32, &'static str)],
}

/// How a stage uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    Read,
    /// Written, and perhaps read.
    Write,
}

/// A compute shader as the host knows it; one name for its label, timestamp, crash marker and bench row.
pub struct Shader {
    /// The name, with a trailing NUL so that Vulkan can point at it.
    pub label: &'static std::ffi::CStr,
    /// The same name.
    pub name: &'static str,
    /// SPIR-V.
    pub code: &'static [u8],
    /// Threads per workgroup.
    pub local_size: [u32; 3],
    /// Whether it has operations of subgroups.
    pub subgroups: bool,
    /// Name and access of each buffer, by slot.
    pub buffers: &'static [(&'static str, Access)],
    /// Size of the push constants in bytes.
    pub push_size: u32,
    /// Number of each specialisation constant, and its place in [`Constants::words`].
    pub constants: &'static [(u32, usize)],
}

/// A compute stage: a struct with the stage's buffers by name; made by [`stage!`](crate::stage).
pub trait Stage<'a> {
    /// Its push constants.
    type Push: bytemuck::Pod;
    /// Its specialisation constants.
    type Constants: Constants;
    /// Its shader.
    const SHADER: &'static Shader;
    /// The buffers, in slot order.
    fn in_order(self) -> Vec<&'a Buffer>;
}

/// Specialisation constants by name; made by [`specialisation!`](crate::specialisation).
pub trait Constants {
    /// Their names.
    const NAMES: &'static [&'static str];
    /// Their values, in the same order.
    fn words(&self) -> Vec<u32>;
}

impl Constants for () {
    const NAMES: &'static [&'static str] = &[];
    fn words(&self) -> Vec<u32> {
        Vec::new()
    }
}

/// A struct with a layout that shaders are checked against; made by [`gpu_struct!`](crate::gpu_struct).
pub trait HostLayout {
    /// The layout that Rust gives it.
    const LAYOUT: Layout;
}

impl HostLayout for () {
    const LAYOUT: Layout = Layout { name: "", size: 0, members: &[] };
}

/// Declares a `#[repr(C)]` struct that host and device share.
#[macro_export]
macro_rules! gpu_struct {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        $vis struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $crate::engine::vulkan::stage::HostLayout for $name {
            const LAYOUT: $crate::engine::vulkan::stage::Layout = $crate::engine::vulkan::stage::Layout {
                name: stringify!($name),
                size: size_of::<$name>(),
                members: &[$($crate::engine::vulkan::stage::Member {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    size: size_of::<$kind>(),
                },)*],
            };
        }
    };
}

/// Declares the specialisation constants of one or several shaders, named as in GLSL but in lower case: integers,
/// booleans or enumerations. `local_size_x` sets `local_size_x_id`.
#[macro_export]
macro_rules! specialisation {
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$field_meta:meta])* $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy)]
        $vis struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $crate::engine::vulkan::stage::Constants for $name {
            const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];
            fn words(&self) -> Vec<u32> {
                vec![$(self.$field as u32),*]
            }
        }
    };
}

/// Declares a stage: `stage!(ScanStage = scan<ScanConstants>(ScanPush) { read values, write sums } with [CameraState]);` names the
/// shader file, the specialisation constants (if it has any), the push constants, the buffers in slot order and the structs
/// that they hold.
#[macro_export]
macro_rules! stage {
    ($(#[$meta:meta])* $vis:vis $name:ident = $shader:ident $(<$constants:ty>)? ($push:ty)
     { $($access:ident $buffer:ident),* $(,)? } $(with [$($shared:ty),*])?) => {
        $(#[$meta])*
        $vis struct $name<'a> { $(#[doc = concat!("To ", stringify!($access), ".")] pub $buffer: &'a $crate::engine::vulkan::Buffer),* }

        const _: () = {
            use $crate::engine::vulkan::stage::{Constants as _, HostLayout as _};
            type Specialised = $crate::stage!(@constants $($constants)?);
            const BUFFERS: &[(&str, $crate::engine::vulkan::stage::Access)] =
                &[$((stringify!($buffer), $crate::stage!(@access $access))),*];
            const REFLECTED: $crate::engine::vulkan::stage::Reflected = $crate::engine::vulkan::shaders::$shader::REFLECTED;
            // A static, which is checked while the crate compiles whether it is used or not.
            static SHADER: $crate::engine::vulkan::stage::Shader = {
                $crate::engine::vulkan::stage::check_buffers(&REFLECTED, BUFFERS);
                $crate::engine::vulkan::stage::check_layout(&REFLECTED.push, &<$push>::LAYOUT);
                assert!(size_of::<$push>() <= 128, "push constants are 128 bytes at most");
                $crate::engine::vulkan::stage::check_structs(&REFLECTED, &[$($(&<$shared>::LAYOUT),*)?]);
                $crate::engine::vulkan::stage::Shader {
                    label: match std::ffi::CStr::from_bytes_with_nul(concat!(stringify!($shader), "\0").as_bytes()) {
                        Ok(label) => label,
                        // The name is an identifier, and a static is evaluated by the compiler: no panic at run time.
                        Err(_) => panic!("a stage's name holds no NUL"),
                    },
                    name: stringify!($shader),
                    code: $crate::engine::vulkan::shaders::$shader::CODE,
                    local_size: REFLECTED.local_size,
                    subgroups: REFLECTED.subgroups,
                    buffers: BUFFERS,
                    push_size: size_of::<$push>() as u32,
                    constants: &$crate::engine::vulkan::stage::places::<{ REFLECTED.constants.len() }>(
                        REFLECTED.constants,
                        Specialised::NAMES,
                    ),
                }
            };
            impl<'a> $crate::engine::vulkan::stage::Stage<'a> for $name<'a> {
                type Push = $push;
                type Constants = Specialised;
                const SHADER: &'static $crate::engine::vulkan::stage::Shader = &SHADER;
                fn in_order(self) -> Vec<&'a $crate::engine::vulkan::Buffer> {
                    vec![$(self.$buffer),*]
                }
            }
        };
    };
    (@access read) => { $crate::engine::vulkan::stage::Access::Read };
    (@access write) => { $crate::engine::vulkan::stage::Access::Write };
    (@constants) => { () };
    (@constants $constants:ty) => { $constants };
}

specialisation! {
    /// The workgroup's size alone.
    pub struct GroupConstants {
        /// Threads per workgroup.
        local_size_x: u32,
    }
}

// The checks below run in constant evaluation: their panics are compile errors.

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Compile-time check: every specialisation constant of a shader is one that the host names. Their numbers, and places
/// among the host's names.
pub const fn places<const N: usize>(reflected: &[(u32, &str)], names: &[&str]) -> [(u32, usize); N] {
    let mut places = [(0, 0); N];
    let mut i = 0;
    while i < N {
        let (number, name) = reflected[i];
        let mut place = 0;
        while place < names.len() && !name.eq_ignore_ascii_case(names[place]) {
            place += 1;
        }
        assert!(place < names.len(), "a shader has a specialisation constant that the host does not name");
        places[i] = (number, place);
        i += 1;
    }
    places
}

/// Compile-time check: slots, names and access of every buffer.
pub const fn check_buffers(reflected: &Reflected, declared: &[(&str, Access)]) {
    assert!(reflected.bindings.len() == declared.len(), "shader and host disagree on the number of buffers");
    let mut i = 0;
    while i < declared.len() {
        let (slot, name, writable) = reflected.bindings[i];
        assert!(slot as usize == i, "a shader's bindings are numbered from 0 without gaps");
        assert!(same(name, declared[i].0), "shader and host disagree on a buffer's name");
        assert!(
            writable == matches!(declared[i].1, Access::Write),
            "shader and host disagree on whether a buffer is written (is `readonly` missing?)"
        );
        i += 1;
    }
}

/// Compile-time check: names, offsets and sizes of a struct's members.
pub const fn check_layout(reflected: &Layout, host: &Layout) {
    assert!(reflected.members.len() == host.members.len(), "shader and host disagree on a struct's members");
    assert!(reflected.size == host.size, "shader and host disagree on a struct's size");
    assert!(host.size <= 4096, "a shared struct is unreasonably large");
    let mut i = 0;
    while i < host.members.len() {
        assert!(same(reflected.members[i].name, host.members[i].name), "shader and host disagree on a member's name");
        assert!(reflected.members[i].offset == host.members[i].offset, "shader and host disagree on a member's offset");
        assert!(reflected.members[i].size == host.members[i].size, "shader and host disagree on a member's size");
        i += 1;
    }
}

/// Compile-time check: every struct in the shader's buffers is declared by the host, with the same layout.
pub const fn check_structs(reflected: &Reflected, declared: &[&Layout]) {
    let mut i = 0;
    while i < reflected.structs.len() {
        let mut found = false;
        let mut j = 0;
        while j < declared.len() {
            if same(reflected.structs[i].name, declared[j].name) {
                check_layout(&reflected.structs[i], declared[j]);
                found = true;
            }
            j += 1;
        }
        assert!(found, "a shader's buffer holds a struct that the host does not declare in `with [...]`");
        i += 1;
    }
}
