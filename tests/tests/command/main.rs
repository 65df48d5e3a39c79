//! The command line as a user meets it.

mod bad_input_gets_a_sentence;
mod compare_agrees_with_the_definition;
mod flip_agrees_with_its_authors;
mod frames_that_help;
mod inspect_tells_what_a_run_skips;
mod memory_stays_within_the_plan;
mod memory_that_cannot_be_had;
mod passes_that_do_not_belong_together;
mod sample_is_denoised;
mod sequences;
mod stopping_and_progress;
mod what_was_typed;
mod writes_that_fail;
