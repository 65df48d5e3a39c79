//! No panic crosses the border to C: it becomes a failure like others.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::status::{Failure, linpred_status};

/// Does `body`, or says what it panicked with.
pub(crate) fn guard<R>(body: impl FnOnce() -> Result<R, Failure>) -> Result<R, Failure> {
    // what `body` changes is settings, set whole or not at all, and a run, which is given up
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| Err(failure(panic.as_ref())))
}

fn failure(panic: &(dyn Any + Send)) -> Failure {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    Failure::new(
        linpred_status::LINPRED_ERROR_INTERNAL,
        format!(
            "a fault of the library itself: {}",
            text.unwrap_or("it does not say which")
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_code_with_its_words() {
        let words: [fn() -> u8; 3] = [
            || panic!("as it is"),
            || panic!("made of {}", 2),
            || std::panic::panic_any(7),
        ];
        let told = ["as it is", "made of 2", "it does not say which"];
        for (body, told) in words.into_iter().zip(told) {
            let failure = guard(|| Ok(body())).unwrap_err();
            assert_eq!(failure.status, linpred_status::LINPRED_ERROR_INTERNAL);
            assert!(failure.message.ends_with(told), "{}", failure.message);
        }
        assert_eq!(guard(|| Ok(3)), Ok(3));
    }
}
