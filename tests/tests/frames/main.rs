//! Whole frames in memory through the moving band of rows.

mod cuts_change_no_bit;
mod estimated_error_is_the_error;
mod exact_where_it_can_be;
mod finishing_keeps_its_promises;
mod fireflies_go_and_lamps_stay;
mod frames_help_each_other;
mod frames_in_memory_are_read_as_they_lie;
mod layers_add_up_to_the_colour;
mod light_follows_any_feature;
mod light_stays;
mod maps_go_where_errors_are;
mod overlap_changes_nothing;
mod rows_can_be_given_step_by_step;
mod trouble_stays_where_it_is;
mod units_change_the_unit_alone;
