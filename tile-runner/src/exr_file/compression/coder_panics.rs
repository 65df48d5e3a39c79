//! Panics of the `exr` crate's coders become errors: a chunk that its author did not think of ends a run in a sentence like any other damage.
//!
//! What a coder was given is dropped with it, and it keeps no state of its own, so nothing half-changed is left behind. The panic hook has run by the time
//! that a panic is caught. The hook belongs to the process and not to a library, so a program says with [`tell_caught_ones_to`] what is to become of
//! panics that end in an error (the command line logs them where it is verbose). With `panic = "abort"` nothing is caught, and the process ends.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};

use exr::error::{Error, Result};

thread_local! {
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Has panics that become an error told to `quiet` instead of the panic hook that is installed now, which is told of all others.
pub fn tell_caught_ones_to(quiet: impl Fn(&PanicHookInfo<'_>) + Send + Sync + 'static) {
    let loud = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| match are_caught() {
        true => quiet(panic),
        false => loud(panic),
    }));
}

/// Whether a panic of this thread would come to nothing but an error.
fn are_caught() -> bool {
    CAUGHT.get()
}

/// Runs a coder. [`Error::Invalid`] with the panic's message if it panics.
pub(crate) fn into_error<T>(coder: impl FnOnce() -> Result<T>) -> Result<T> {
    let before = CAUGHT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(coder));
    CAUGHT.set(before);
    result.unwrap_or_else(|panic| {
        let message = (panic.downcast_ref::<&str>().copied())
            .or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        Err(Error::Invalid(
            format!(
                "the coder of the exr crate panicked on it: {}",
                message.unwrap_or("it does not say why")
            )
            .into(),
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_that_says_what_it_said() {
        let number = 7;
        let panics: [&dyn Fn() -> Result<()>; 3] = [
            &|| panic!("lost at sea"),
            &|| panic!("lost at sea with {number} others"),
            &|| std::panic::panic_any(number),
        ];
        for (panic, said) in panics
            .into_iter()
            .zip(["lost at sea", "7 others", "not say"])
        {
            let message = into_error(panic).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
            assert!(!are_caught());
        }
    }

    #[test]
    fn what_does_not_panic_is_left_alone() {
        assert!(into_error(|| Ok(are_caught())).unwrap());
        let error = into_error::<()>(|| Err(Error::Invalid("bent".into())));
        assert_eq!(
            error.unwrap_err().to_string(),
            Error::Invalid("bent".into()).to_string()
        );
    }

    thread_local! {
        static TOLD: Cell<[u32; 2]> = const { Cell::new([0; 2]) };
    }

    #[test]
    fn a_panic_is_told_unless_an_error_will_tell() {
        fn count(which: usize) {
            let mut told = TOLD.get();
            told[which] += 1;
            TOLD.set(told);
        }
        let others = std::panic::take_hook();
        std::panic::set_hook(Box::new(|_| count(0)));
        tell_caught_ones_to(|_| count(1));
        let caught = into_error::<()>(|| panic!("in a coder"));
        let quiet = TOLD.get();
        let other = catch_unwind(|| panic!("elsewhere"));
        std::panic::set_hook(others);
        assert!(caught.is_err() && other.is_err());
        assert_eq!((quiet, TOLD.get()), ([0, 1], [1, 1]));
    }
}
