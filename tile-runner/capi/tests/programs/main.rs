//! The examples, built by a C and a C++ compiler against the installed files, as a stranger would.
#![allow(missing_docs, reason = "nothing is public")]

mod adaptive_by_the_library;
mod every_struct_has_an_initialiser;
mod frame_in_a_file;
mod installed;
mod installed_files_are_found;
mod nothing_leaks;
mod programs_print_the_bits_of_the_file;
mod the_page_shows_what_runs;
