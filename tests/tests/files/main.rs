//! EXR files: what is found in them, and what is written.

mod bands_make_the_frame;
mod compressions_of_later_versions;
mod damaged_files;
mod deep_parts_are_copied;
mod file_layout_changes_no_bit;
mod kept_as_they_are;
mod roles_by_renderer;
mod rows_find_their_channels;
mod threads_change_no_bit;
