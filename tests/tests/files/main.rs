//! EXR files: what is found in them, and what is written.

mod alpha_follows_the_colour;
mod bands_make_the_frame;
mod borders_of_pictures;
mod compressions_of_later_versions;
mod compressions_that_are_asked_for;
mod damaged_files;
mod deep_parts_are_copied;
mod features_by_name;
mod file_layout_changes_no_bit;
mod frames_help_whatever_their_files;
mod identifiers_are_kept;
mod kept_as_they_are;
mod maps_of_samples;
mod merged_passes_are_all_samples;
mod motion_leads_to_the_same_surface;
mod roles_by_renderer;
mod rows_find_their_channels;
mod threads_change_no_bit;
mod variances_that_are_none;
mod views_are_pictures_of_their_own;
