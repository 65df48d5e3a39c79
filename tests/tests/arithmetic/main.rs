//! The arithmetic of one cell, each part against its definition.

mod bare_metal_prints_the_hosts_bits;
mod blocks_agree_with_their_definitions;
mod cells_predict_every_open_pixel;
mod even_layers_stay_even;
mod finishing_agrees_with_its_definition;
mod frames_agree_with_their_definition;
mod lanes_change_no_bit;
mod model_agrees_with_its_definition;
mod model_is_equivariant;
mod models_go_where_they_are_wanted;
mod models_see_their_set_of_features;
mod normal_equations_equal_rls;
mod p_stays_symmetric_and_positive;
mod pixels_are_the_means_of_their_predictions;
mod rls_equals_batch_least_squares;
mod trouble_in_a_cell;
mod truncated_svd_of_windows;
mod validation_equals_refits;
mod weighted_local_regression_is_its_definition;
