//! Memory is asked for before it is taken: an allocation that fails would end the caller's process.

use linpred::RowLayout;
use linpred::job::MemoryPlan;

use crate::options::Settings;
use crate::status::{Failure, linpred_status};

/// Refuses an image whose run takes more than it may, or than there is.
pub(crate) fn check(layout: &RowLayout, settings: &Settings) -> Result<(), Failure> {
    let bytes = settings.options.memory(layout);
    let mut plan = MemoryPlan::default();
    let (width, threads) = (layout.size.width(), settings.options.threads);
    plan.add(
        format!("rows of {width} pixels on {threads} threads"),
        bytes,
    );
    plan.check(settings.memory_limit)?;
    let mut probe: Vec<u8> = Vec::new();
    let given = usize::try_from(bytes).is_ok_and(|bytes| probe.try_reserve_exact(bytes).is_ok());
    // or else the compiler may leave out an allocation that nobody looks at
    std::hint::black_box(&mut probe);
    match given {
        true => Ok(()),
        false => Err(Failure::new(
            linpred_status::LINPRED_ERROR_MEMORY,
            format!(
                "the system does not give {} MiB of memory",
                bytes.div_ceil(1 << 20)
            ),
        )),
    }
}
