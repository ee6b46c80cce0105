//! Structs that may grow: programs compiled against an older or newer header hand over shorter or longer ones.

use std::mem::size_of;

use crate::{Error, Result};

/// A struct of C's that begins with its size in bytes. New fields go to its end.
///
/// # Safety
/// `repr(C)`, its first field is `struct_size: usize`, and every bit pattern is a value.
pub(super) unsafe trait Versioned: Copy {
    /// In C.
    const NAME: &'static str;
    /// Of the function that initialises it.
    const INIT: &'static str;
    /// Its size when it was first released.
    const FIRST_SIZE: usize;

    /// What it is initialised to, `struct_size` aside.
    fn initial() -> Self;
}

/// Initialises the first `size` bytes at `place`: fields that this version does not know become zero.
///
/// # Safety
/// `place` is null or points at `size` bytes, aligned as `T`.
pub(super) unsafe fn init<T: Versioned>(place: *mut T, size: usize) {
    if place.is_null() || size < size_of::<usize>() {
        return;
    }
    // SAFETY: as the caller guarantees, and every byte of `T` that is copied is initialised or padding.
    unsafe { write_first(place, size, T::initial()) };
}

/// Writes the fields of `value` that the caller's version of the struct has.
///
/// # Errors
/// Where it was not initialised.
///
/// # Safety
/// As for [`read`], and `place` may be written.
pub(super) unsafe fn write<T: Versioned>(place: *mut T, value: T) -> Result<()> {
    // SAFETY: as the caller guarantees.
    let size = unsafe { size_of_given(place)? };
    // SAFETY: as the caller guarantees.
    unsafe { write_first(place, size, value) };
    Ok(())
}

/// # Safety
/// `place` points at `size` bytes, of which there are as many as a `usize` has, aligned as `T`.
unsafe fn write_first<T: Versioned>(place: *mut T, size: usize, value: T) {
    let bytes = place.cast::<u8>();
    // SAFETY: as the caller guarantees; no more than `T` has is read.
    unsafe {
        bytes.write_bytes(0, size);
        bytes.copy_from_nonoverlapping((&raw const value).cast(), size.min(size_of::<T>()));
        place.cast::<usize>().write(size);
    }
}

/// A struct of C's, whatever version of it the program was compiled with.
///
/// # Errors
/// Where it is null or was not initialised, or has fields set that this version does not know.
///
/// # Safety
/// `place` is null or points at as many bytes as its first field says, aligned as `T`.
pub(super) unsafe fn read<T: Versioned>(place: *const T) -> Result<T> {
    // SAFETY: as the caller guarantees.
    let size = unsafe { size_of_given(place)? };
    let (bytes, known) = (place.cast::<u8>(), size.min(size_of::<T>()));
    // SAFETY: as the caller guarantees.
    let unknown = unsafe { std::slice::from_raw_parts(bytes.add(known), size - known) };
    if unknown.iter().any(|byte| *byte != 0) {
        let what = format!("the {} sets something that this older library does not have; load a newer one", T::NAME);
        return Err(Error::request(what));
    }
    let mut value = T::initial();
    // SAFETY: both have so many bytes, and every bit pattern is a value.
    unsafe { (&raw mut value).cast::<u8>().copy_from_nonoverlapping(bytes, known) };
    Ok(value)
}

/// # Safety
/// As for [`read`].
unsafe fn size_of_given<T: Versioned>(place: *const T) -> Result<usize> {
    if place.is_null() {
        return Err(Error::request(format!("the {} is null", T::NAME)));
    }
    // SAFETY: as the caller guarantees, its first field.
    let size = unsafe { place.cast::<usize>().read() };
    // Far more than any version will have: such a size is a stray value.
    if !(T::FIRST_SIZE..=1 << 16).contains(&size) {
        let what = format!("a {} of {size} bytes was not initialised; call {}", T::NAME, T::INIT);
        return Err(Error::request(what));
    }
    Ok(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct First {
        struct_size: usize,
        views: u64,
    }

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Second {
        struct_size: usize,
        views: u64,
        seed: u64,
    }

    // SAFETY: integers, the size first.
    unsafe impl Versioned for First {
        const NAME: &'static str = "Request";
        const INIT: &'static str = "init";
        const FIRST_SIZE: usize = size_of::<Self>();

        fn initial() -> Self {
            Self { struct_size: 0, views: 10 }
        }
    }

    // SAFETY: as above.
    unsafe impl Versioned for Second {
        const NAME: &'static str = "Request";
        const INIT: &'static str = "init";
        const FIRST_SIZE: usize = size_of::<First>();

        fn initial() -> Self {
            Self { struct_size: 0, views: 10, seed: 7 }
        }
    }

    /// If this failed, a program would have to be compiled anew for each version of the library, or memory beside its struct would be
    /// written or taken for fields.
    #[test]
    fn programs_run_with_newer_and_older_libraries() {
        // SAFETY: each pointer is to as many bytes as are named.
        unsafe {
            // An older program: what is behind its struct stays, and the new field has its default.
            let mut old = Second { struct_size: 0, views: 0, seed: 99 };
            init::<Second>(&raw mut old, size_of::<First>());
            assert_eq!(old, Second { struct_size: size_of::<First>(), views: 10, seed: 99 });
            old.views = 3;
            let seen = read::<Second>(&raw const old).unwrap();
            assert_eq!((seen.views, seen.seed), (3, 7));
            write(&raw mut old, Second { struct_size: 0, views: 4, seed: 5 }).unwrap();
            assert_eq!(old, Second { struct_size: size_of::<First>(), views: 4, seed: 99 });
            // A newer program: its new field is zero, and must stay so.
            let mut new = Second { struct_size: 0, views: 0, seed: 99 };
            let place = (&raw mut new).cast::<First>();
            init(place, size_of::<Second>());
            assert_eq!(new, Second { struct_size: size_of::<Second>(), views: 10, seed: 0 });
            assert_eq!(read(place).unwrap().views, 10);
            new.seed = 1;
            let refusal = read((&raw const new).cast::<First>()).unwrap_err().to_string();
            assert!(refusal.contains("load a newer one"), "{refusal}");
            // Not initialised, or null.
            for size in [0, 15, usize::MAX] {
                new.struct_size = size;
                let refusal = read((&raw const new).cast::<First>()).unwrap_err().to_string();
                assert!(refusal.contains("call init"), "{refusal}");
            }
            init::<First>(std::ptr::null_mut(), 16);
            assert!(read::<First>(std::ptr::null()).is_err());
        }
    }
}
