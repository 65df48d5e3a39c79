//! The functions of the header, called as C calls them.
#![allow(missing_docs, reason = "nothing is public")]

mod bad_use_is_told;
mod files;
mod host;
mod images_are_read_as_they_lie;
mod maps_of_files;
mod maps_of_samples;
mod one_call_at_a_time;
mod outputs_may_take_the_place_of_images;
mod rows_have_the_bits_of_frames;
