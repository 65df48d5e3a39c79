//! What a panic says on standard error.

use std::panic::PanicHookInfo;

use linpred::exr_file::compression::coder_panics;

/// Keeps panics quiet that end in an error of their own; `--verbose` shows where they were.
pub(crate) fn keep_caught_ones_quiet() {
    let loud = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| tell(panic, &*loud)));
}

fn tell(panic: &PanicHookInfo, loud: &dyn Fn(&PanicHookInfo)) {
    match coder_panics::are_caught() {
        true => tracing::debug!("{panic}"),
        false => loud(panic),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    thread_local! {
        static TOLD: Cell<u32> = const { Cell::new(0) };
    }

    #[test]
    fn a_panic_is_told_unless_an_error_will_tell() {
        let others = std::panic::take_hook();
        std::panic::set_hook(Box::new(|_| TOLD.set(TOLD.get() + 1)));
        keep_caught_ones_quiet();
        let caught = coder_panics::into_error::<()>(|| panic!("in a coder"));
        let quiet = TOLD.get();
        let other = std::panic::catch_unwind(|| panic!("elsewhere"));
        std::panic::set_hook(others);
        assert!(caught.is_err() && other.is_err());
        assert_eq!((quiet, TOLD.get()), (0, 1));
    }
}
