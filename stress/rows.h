// The rows of the catalogue, a function each, by the file that has it; catalogue.cpp tells what they try.
#pragma once

#include "stress/stress.h"

namespace hsi4d::stress {

using Row = std::vector<StressFigure>(Remedy);

Row needles, near_and_far, wild_log_scales, wild_places, antialias_factor;                // projection_ellipse
Row held_ratios, beside_the_view, units_of_length, small_gaussians, far_from_the_origin;  // projection_world
Row turning_camera, edge_on, lengths_of_quaternions;                                      // projection_turns
Row kept_transmittance, opaque_gradients, stop_rule, faint_layers, million_on_one_pixel, opaque_wall;  // transmittance
Row cap_gradient, differences_across_cuts, recomputed_alpha, conic_gradient;              // blending_gradients
Row normalized_depth, saturated_sigmoid, quick_exponential, held_color, color_direction;  // rendered_values
Row footprint, nothing_to_draw, pixel_centres;                                            // footprints
Row depth_sort, depth_keys, pair_counts;                                                  // depth_order
Row gradient_at_identity, gradient_leaves_identity, coefficients, switches, log_near_half_turn,
    inverse_jacobian;  // rotations
Row quaternion_signs, quaternion_lengths, parallel_columns, pivots, dead_branches, chains,
    views_along_up;                                                                  // rotation_forms
Row weight_sums, opposite_bones, small_offsets;                                      // body
Row bad_steps, distances_at_zero, near_neighbours, joint_ranges, turns_beyond_half;  // body_robustness
Row flat_areas, data_ranges, logarithms_of_zero, equal_numbers, long_means;          // losses
Row masks_and_borders;                                                               // losses
Row fast_math, contraction;                                                          // arithmetic
Row bad_gradients, place_of_eps, bias_corrections, fading_moments;                   // optimiser
Row sums_by_threads, sums_over_pixels, half_precision;                               // sums
Row opacities_of_copies, scales_of_copies;                                           // copies
Row products_with_vectors, rows_not_drawn, wrong_but_finite;                         // tape_faults
Row broken_ply, numbers_in_json;                                                     // files
Row unusual_sequences, two_results, transmittance_through_layers;                    // lists_and_layers
Row long_lists, rows_of_little_energy;                                               // lists_and_layers
Row steps_after_wrap, bad_evaluations, growing_norms, nearly_equal_starts;           // steps
Row matrix_without_rank, loss_that_bends_down, bad_matrix_steps;                     // matrix_steps
Row videos_as_players_show_them, resumed_elsewhere, left_ranges;                     // inputs
Row poisoned_elements, poisoned_arrays, poisoned_networks;                           // poison_autodiff
Row poisoned_splats;                                                                 // poison_splat
Row poisoned_composite, poisoned_render;                                             // poison_render
Row poisoned_skeletons, poisoned_body_nets;                                          // poison_body
Row poisoned_masks, poisoned_losses, poisoned_distances;                             // poison_losses
Row scaled_world, moved_world, turned_world, mirror_image, crop_of_render, shuffled_rows,
    gaussians_in_two;                                                                              // metamorphic
Row without_culling, numbers_of_threads, sizes_of_tiles, instruction_sets, scaled_loss, extremes;  // metamorphic
Row to_the_end, without_denormals, on_any_threads;                                                 // long_run

}  // namespace hsi4d::stress
