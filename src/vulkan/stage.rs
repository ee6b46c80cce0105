//! Stages: what the host declares of a compute shader, held against the compiled SPIR-V while the crate compiles.

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

/// What a compiled shader says of itself.
pub struct Reflected {
    /// Threads per workgroup.
    pub local_size: [u32; 3],
    /// Slot, name and whether the shader may write, of each storage buffer.
    pub bindings: &'static [(u32, &'static str, bool)],
    /// The push-constant block.
    pub push: Layout,
    /// The structs that the buffers hold.
    pub structs: &'static [Layout],
}

/// How a stage uses a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    Read,
    /// Written, and perhaps read.
    Write,
}

/// A compute stage: one shader, one name for its label, timestamp, crash marker and bench row.
pub struct Stage {
    /// The name, with a trailing NUL so that Vulkan can point at it.
    pub label: &'static std::ffi::CStr,
    /// The same name.
    pub name: &'static str,
    /// SPIR-V.
    pub code: &'static [u8],
    /// Threads per workgroup.
    pub local_size: [u32; 3],
    /// Access of each buffer, by slot.
    pub bindings: &'static [Access],
    /// Size of the push constants in bytes.
    pub push_size: u32,
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
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $kind:ty,)* }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $crate::vulkan::stage::HostLayout for $name {
            const LAYOUT: $crate::vulkan::stage::Layout = $crate::vulkan::stage::Layout {
                name: stringify!($name),
                size: size_of::<$name>(),
                members: &[$($crate::vulkan::stage::Member {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    size: size_of::<$kind>(),
                },)*],
            };
        }
    };
}

/// Declares a stage: `stage!(pub SCAN_BLOCKS = scan_blocks(ScanPush) { read values, write sums } with [Splat]);`
/// names the shader file, the push constants, the buffers in slot order and the structs that they hold.
#[macro_export]
macro_rules! stage {
    ($(#[$meta:meta])* pub $name:ident = $shader:ident($push:ty) { $($access:ident $buffer:ident),* $(,)? }
     $(with [$($shared:ty),*])?) => {
        $(#[$meta])*
        pub static $name: $crate::vulkan::stage::Stage = {
            use $crate::vulkan::stage::HostLayout as _;
            const BUFFERS: &[(&str, $crate::vulkan::stage::Access)] =
                &[$((stringify!($buffer), $crate::stage!(@access $access))),*];
            const REFLECTED: $crate::vulkan::stage::Reflected = $crate::vulkan::shaders::$shader::REFLECTED;
            $crate::vulkan::stage::check_buffers(&REFLECTED, BUFFERS);
            $crate::vulkan::stage::check_layout(&REFLECTED.push, &<$push>::LAYOUT);
            assert!(size_of::<$push>() <= 128, "push constants are 128 bytes at most");
            $crate::vulkan::stage::check_structs(&REFLECTED, &[$($(&<$shared>::LAYOUT),*)?]);
            $crate::vulkan::stage::Stage {
                label: match std::ffi::CStr::from_bytes_with_nul(concat!(stringify!($shader), "\0").as_bytes()) {
                    Ok(label) => label,
                    // The name is an identifier, and a static is evaluated by the compiler: no panic at run time.
                    Err(_) => panic!("a stage's name holds no NUL"),
                },
                name: stringify!($shader),
                code: $crate::vulkan::shaders::$shader::CODE,
                local_size: REFLECTED.local_size,
                bindings: &[$($crate::stage!(@access $access)),*],
                push_size: size_of::<$push>() as u32,
            }
        };
    };
    (@access read) => { $crate::vulkan::stage::Access::Read };
    (@access write) => { $crate::vulkan::stage::Access::Write };
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
