//! Panics of the `exr` crate's coders become errors: a block that its author did not think of ends a run in a sentence like any other damage.
//!
//! What a coder was given is dropped with it, and it keeps no state of its own, so nothing half-changed is left behind. The panic hook has run by the time
//! that a panic is caught. It belongs to the process and not to a library: a program that installs one asks [`are_caught`] whether the
//! user will be told anyway (the command line does). With `panic = "abort"` nothing is caught, and the process ends.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::error::{Error, Result};

thread_local! {
    static CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic of this thread would come to nothing but an error. For panic hooks.
pub fn are_caught() -> bool {
    CAUGHT.get()
}

/// Runs a coder. [`Error::Invalid`] with the panic's message if it panics.
pub fn into_error<T>(coder: impl FnOnce() -> Result<T>) -> Result<T> {
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
}
