//! Structs that may grow. Their first member is their size, as the caller's header has it, and zero is the default of every other: what an older struct
//! lacks is zero, and what a newer one has beyond this version's must be.

use std::mem::MaybeUninit;

use crate::status::Failure;

/// A struct of the header.
///
/// # Safety
/// It is `repr(C)`, its first member is the size as `usize`, it has no padding at its end, and zeros as well as
/// whatever C may put into its members are values of it.
pub(crate) unsafe trait Versioned: Copy {
    /// Its name in C.
    const NAME: &'static str;
}

/// Larger structs than any version will have: a size that was never set.
const LARGEST: usize = 4096;

/// Reads a struct that C hands over.
///
/// # Safety
/// `given` is NULL, or points to a struct that can be read over the size that it states.
pub(crate) unsafe fn read<T: Versioned>(given: *const T) -> Result<T, Failure> {
    // SAFETY: the caller's promise
    let size = unsafe { stated_size(given) }?;
    let mut value = MaybeUninit::<T>::zeroed();
    let bytes = given.cast::<u8>();
    // SAFETY: the source can be read over `size`, the target is a `T`, and they are apart
    unsafe { bytes.copy_to_nonoverlapping(value.as_mut_ptr().cast(), size.min(size_of::<T>())) };
    for at in size_of::<T>()..size {
        // SAFETY: within `size`
        if unsafe { bytes.add(at).read() } != 0 {
            return Err(Failure::argument(format!(
                "{} of {size} bytes sets what version {} does not know: byte {at} is not 0",
                T::NAME,
                env!("CARGO_PKG_VERSION")
            )));
        }
    }
    // SAFETY: zeros and what C wrote are values of it, as the trait demands
    Ok(unsafe { value.assume_init() })
}

/// Fills a struct of the caller's, all but its size; what lies beyond this version's becomes zero.
///
/// # Safety
/// `target` is NULL, or points to a struct that can be read and written over the size that it states.
pub(crate) unsafe fn write<T: Versioned>(target: *mut T, value: &T) -> Result<(), Failure> {
    // SAFETY: the caller's promise
    let size = unsafe { stated_size(target) }?;
    let head = size_of::<usize>();
    let known = size.min(size_of::<T>());
    let (source, target) = ((&raw const *value).cast::<u8>(), target.cast::<u8>());
    // SAFETY: both reach from `head` to `known` at least, and the one is a value of our own
    unsafe {
        source
            .add(head)
            .copy_to_nonoverlapping(target.add(head), known - head)
    };
    // SAFETY: within `size`
    unsafe { target.add(known).write_bytes(0, size - known) };
    Ok(())
}

/// # Safety
/// `given` is NULL, or points to a struct whose size can be read.
unsafe fn stated_size<T: Versioned>(given: *const T) -> Result<usize, Failure> {
    if given.is_null() {
        return Err(Failure::argument(format!("{} is NULL", T::NAME)));
    }
    // SAFETY: the size comes first; the struct may lie at any address
    let size = unsafe { given.cast::<usize>().read_unaligned() };
    if !(size_of::<usize>()..=LARGEST).contains(&size) {
        return Err(Failure::argument(format!(
            "struct_size of a {} is {size}; it is sizeof({0}) of the header that it was made with",
            T::NAME
        )));
    }
    Ok(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Now {
        struct_size: usize,
        a: u64,
        b: u64,
    }

    // SAFETY: as the trait demands
    unsafe impl Versioned for Now {
        const NAME: &'static str = "now";
    }

    #[repr(C)]
    struct Later {
        now: Now,
        c: u64,
    }

    fn later(c: u64) -> Later {
        let now = Now {
            struct_size: size_of::<Later>(),
            a: 1,
            b: 2,
        };
        Later { now, c }
    }

    #[test]
    fn an_older_struct_takes_defaults_and_nothing_beyond_it_is_read() {
        let older = [size_of::<[usize; 2]>(), 7];
        // SAFETY: it has the size that it states
        let read = unsafe { read(older.as_ptr().cast::<Now>()) }.unwrap();
        assert_eq!((read.a, read.b), (7, 0));
    }

    #[test]
    fn a_newer_struct_is_taken_if_it_asks_for_nothing_new() {
        // SAFETY: they have the sizes that they state
        let (plain, new) = unsafe {
            let (plain, new) = (later(0), later(1 << 40));
            (
                read::<Now>((&raw const plain).cast()),
                read::<Now>((&raw const new).cast()),
            )
        };
        assert_eq!(plain.map(|now| (now.a, now.b)), Ok((1, 2)));
        let message = new.unwrap_err().message;
        assert!(
            message.contains("now of 32 bytes") && message.contains("byte 29"),
            "{message}"
        );
    }

    #[test]
    fn a_size_that_was_never_set_is_told() {
        for size in [0, 7, LARGEST + 1] {
            let now = Now {
                struct_size: size,
                a: 0,
                b: 0,
            };
            // SAFETY: nothing beyond the size is read
            let message = unsafe { read(&raw const now) }.unwrap_err().message;
            assert!(message.contains("sizeof(now)"), "{message}");
        }
    }

    #[test]
    fn what_is_filled_is_what_the_caller_has_room_for() {
        let value = Now {
            struct_size: 0,
            a: 5,
            b: 6,
        };
        let mut older = [size_of::<[usize; 2]>(), 7, 8];
        let mut newer = later(9);
        // SAFETY: they have the sizes that they state
        unsafe {
            write(older.as_mut_ptr().cast::<Now>(), &value).unwrap();
            write((&raw mut newer).cast::<Now>(), &value).unwrap();
        }
        assert_eq!(older, [16, 5, 8]);
        assert_eq!(
            (newer.now.struct_size, newer.now.a, newer.now.b, newer.c),
            (32, 5, 6, 0)
        );
    }
}
