"""Rows that tests of the suite hold, each with the tests that pytest runs for it."""

from __future__ import annotations

from proof.stability.row import tested

AMONG_GLASS = "integrators/path/test_glass.py::TestGlass::test_"
BALANCE = "integrators/photons/test_ppm.py::TestBalance::test_"
CAMERA = "sensor/test_camera.py::test_"
CAUSTICS = "integrators/photons/test_caustics.py::test_"
EDGES = "intersection/test_sharp_edges.py::test_"
EXTREMES = "integrators/test_light_at_extremes.py::test_"
FRESNEL = "shading/test_fresnel.py::test_"
FURNACE = "integrators/path/test_furnace.py::TestFurnace::test_"
EVERY_KIND = "intersection/test_every_kind.py::test_"
HITS = "intersection/test_certified.py::test_"
LIGHT_FOUND = "integrators/test_light_found.py::test_"
MATERIALS = "materials/test_materials.py::test_"
NURBS = "../meshing/test_nurbs.py::test_"
PLACES = "intersection/test_instances.py::test_"
POLES = "intersection/test_patch_poles.py::test_"
PPM = "integrators/photons/test_ppm.py::test_"
RATIONAL = "intersection/test_rational.py::test_"
RINGS = "lights/test_trimmed.py::test_"
REFUSALS = "primitives/test_refusals.py::test_"
SEAMS = "intersection/test_trims_across_seams.py::test_"
ROUGH_GLASS = "integrators/test_rough_surfaces.py::TestGlass::test_"
SETTINGS = "rendering/test_settings.py::test_"
SPOT = "lights/test_spot.py::test_"
STORE = "rendering/test_store.py::test_"
TESSELLATION = "../meshing/test_tessellation_of_known_surfaces.py::test_"
THIN = "integrators/photons/test_covered_discs.py::test_"
TEXTURES = "textures/test_textures.py::test_"
WHITTED = "integrators/whitted/test_whitted.py::test_"

# Id, title, truth, and tests by file and name.
ROWS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("A07", "degree 0 in one direction", "refusal", (f"{REFUSALS}refused_with_a_name",)),
    ("A09", "patch collapsed to a curve or a point", "refusal", (
        f"{REFUSALS}refused_with_a_name",
    )),
    ("A16", "control points that are no numbers", "refusal", (f"{REFUSALS}refused_with_a_name",)),
    ("A27", "rational patches with weights that are none", "refusal", (
        "../meshing/test_rational.py::test_bad_weights_are_refused_by_name",
        "../meshing/test_rational.py::test_negative_weights_are_refused",
        f"{NURBS}bad_arguments_are_refused_by_name",
    )),
    ("A28", "rational patches with weights 1e-6 to 1", "closed form; exact crossings", (
        f"{RATIONAL}the_pace_of_the_parameters_changes_no_hit",
        f"{RATIONAL}quadrics_by_their_closed_form",
        f"{RATIONAL}hard_rays_by_exact_crossings",
    )),
    ("A31", "NURBS with breaks and spans of nothing", "the basis functions; exact crossings", (
        f"{NURBS}points_are_those_of_scipy",
        f"{NURBS}one_patch_for_each_span_and_shared_borders_to_the_bit",
        f"{NURBS}a_break_leaves_two_sheets",
        f"{RATIONAL}hard_rays_by_exact_crossings",
    )),
    ("A32", "nets of wrong shape or type, mixed degrees", "refusal; exact arithmetic", (
        f"{REFUSALS}refused_with_a_name",
        "core/test_extremes.py::test_lists_and_integers_are_taken",
        "../proof_tests/judges/test_hits.py::test_certified_hits_are_right",
    )),
    ("A36", "normals beside collapsed edges", "closed form", (
        f"{POLES}normals_beside_a_collapsed_edge_have_all_digits",
        f"{POLES}hits_beside_the_pole_of_a_sphere",
    )),
    ("D03", "directions that are no unit vectors", "identity", (
        f"{EVERY_KIND}powers_of_two_change_no_bit",
    )),
    ("F05", "rays that leave a sphere which passes near 0", "closed form", (
        "intersection/test_departures.py::test_spheres_that_pass_near_zero_are_not_met_again",
    )),
    ("F06", "by way of Embree and without, random surfaces", "identity", (
        "../proof_tests/judges/test_hits.py::test_hits_at_singular_sets_are_the_same_without_a_coarse_stage",
        "../proof_tests/judges/test_hits.py::test_hits_are_the_same_without_a_coarse_stage",
        "../proof_tests/stability/test_fuzz.py::test_hits_on_surfaces_of_one_class",
    )),
    ("A33", "NURBS far from 0, given and moved", "de Boor's algorithm in fractions", (
        "intersection/test_bounds_of_what_was_given.py::test_nurbs",
    )),
    ("A34", "knots that nearly make a break, loops over themselves", "refusal; exact knots", (
        f"{NURBS}knots_of_a_break_that_are_nearly_equal_are_refused",
        f"{NURBS}double_knots_of_a_loop_that_are_nearly_equal_keep_it_whole",
        "intersection/test_bounds_of_what_was_given.py::test_knots_that_are_nearly_equal",
        f"{SEAMS}loops_that_overlap_themselves_after_a_turn_are_refused",
    )),
    ("A26", "t_max just before and behind the hit", "the hit itself", (
        "intersection/test_limits.py::test_what_the_bound_leaves_open_says_so",
    )),
    ("B06", "ray equal to the axis", "closed form", (
        "intersection/test_turned_singular.py::test_rays_along_the_axis_meet_it_on_every_side",
        "intersection/test_truths.py::test_ray_along_the_axis_meets_the_pole",
    )),
    ("B12", "closed profile", "parity; the quartic", (
        "intersection/test_crossings.py::test_closed_bodies_are_left_as_often_as_entered",
        "intersection/test_crossings.py::test_a_shared_edge_counts_once",
        "intersection/test_crossings.py::test_all_crossings_of_a_turned_torus_are_the_exact_ones",
    )),
    ("B19", "axes of any length but zero", "refusal; closed form", (
        f"{REFUSALS}refused_with_a_name",
        "intersection/test_truths.py::test_axes_of_any_length_are_scaled_to_one",
    )),
    ("B08", "profile that crosses the axis", "refusal", (f"{REFUSALS}refused_with_a_name",)),
    ("C04", "radius 0", "refusal", (f"{REFUSALS}refused_with_a_name",)),
    ("C05", "negative radius", "refusal", (f"{REFUSALS}refused_with_a_name",)),
    ("C06", "radius nan or inf, sizes at the ends of the range", "refusals; closed form", (
        f"{REFUSALS}refused_with_a_name",
        "core/test_checks.py::test_scaling_beyond_all_scenes_is_refused_for_its_size",
        "../proof_tests/cases/test_catalogue.py::test_sizes_at_the_ends_of_the_range",
    )),
    ("C07", "origin on the sphere", "closed form", (
        "intersection/test_truths.py::test_origin_on_a_sphere_finds_the_other_side",
        "intersection/test_departures.py::test_spheres_that_pass_near_zero_are_not_met_again",
    )),
    ("C08", "origin inside", "closed form; exact roots", (
        "../proof_tests/cases/test_campaign.py::test_no_promise_is_broken",
        "intersection/test_truths.py::test_the_exit_is_seen_from_behind",
    )),
    ("C11", "coincident surfaces", "the lower object is hit", (
        f"{EVERY_KIND}equal_surfaces_tie",
        "intersection/test_truths.py::test_coincident_spheres_squares_and_patches_tie",
    )),
    ("C13", "many spheres", "each sphere by itself; counts of work", (
        "intersection/test_members.py::test_same_bits_as_each_by_itself",
        "intersection/test_mixed_sizes.py::test_a_large_or_far_thing_of_the_same_class_adds_few_nodes",
        "intersection/test_instances.py::test_work_grows_as_the_logarithm",
    )),
    ("D01", "direction of length zero", "refusal", (f"{HITS}bad_rays_are_refused",)),
    ("D04", "batches of any size", "identity", (
        f"{EVERY_KIND}slices_threads_order_and_pickling_change_no_bit",
        f"{HITS}inputs_of_any_form",
    )),
    ("D07", "view along up; fields of view of 0 and 180", "refusals; unit directions between", (
        f"{CAMERA}impossible_cameras_are_refused_by_name",
        f"{CAMERA}directions_are_unit_vectors_in_all_fields_of_view",
    )),
    ("D11", "indices of 0, below 0, not a number", "refusals", (
        f"{MATERIALS}impossible_materials_are_refused",
        "materials/test_rough_conductor.py::test_impossible_metals_are_refused",
    )),
    ("D12", "the critical angle", "Fresnel's equations in many digits", (
        f"{FRESNEL}reflectance_around_the_critical_angle",
        f"{WHITTED}total_reflection_sends_everything_back",
    )),
    ("D13", "grazing incidence", "Fresnel's equations in many digits", (
        f"{FRESNEL}reflectance_is_that_of_fresnels_equations",
        f"{FRESNEL}grazing_light_is_all_reflected",
    )),
    ("D17", "albedo above one or below 0", "refusals", (
        f"{MATERIALS}impossible_materials_are_refused",
    )),
    ("D20", "lamp enclosed by glass", "closed form: Fresnel's equations about one centre", (
        "integrators/test_hard_cases.py::test_d20_lamp_enclosed_by_glass",
        "integrators/photons/test_branching.py::test_lamp_in_a_plate_of_glass",
        f"{CAUSTICS}lamp_within_glass_lights_the_floor",
    )),
    ("D22", "all photons in one point", "closed form; memory as when spread", (
        f"{PPM}a_million_photons_in_one_point_need_little_memory",
    )),
    ("D23", "discs of radius 0, or larger than the scene", "refusals", (
        f"{PPM}impossible_options_are_refused",
        f"{PPM}radii_far_from_the_scenes_size_are_refused",
    )),
    ("D25", "alpha of 0, 1, below and above", "refusals, a warning; sequence of radii; slope", (
        f"{PPM}impossible_options_are_refused",
        f"{PPM}alpha_one_warns_of_its_blur",
        f"{PPM}radius_sequence_of_knaus_and_zwicker",
        f"{CAUSTICS}error_falls_as_the_third_root_of_the_passes",
    )),
    ("D26", "textures with values that are no colours", "refusals", (
        f"{TEXTURES}impossible_textures_are_refused",
        f"{MATERIALS}impossible_materials_are_refused",
        "scene/test_scene.py::test_impossible_lights_are_refused",
    )),
    ("D27", "textures of one texel, none, 16 bits, with alpha", "closed forms; refusals", (
        f"{TEXTURES}one_pixel_is_a_constant",
        f"{TEXTURES}eight_and_sixteen_bits_grey_and_alpha",
        "scene/test_scene.py::test_picture_files_are_refused_in_the_name_of_their_class",
        f"{TEXTURES}impossible_textures_are_refused",
    )),
    ("D28", "texture coordinates 1, below 0 and 1e9", "closed form of the checker; whole periods", (
        f"{TEXTURES}uv_checker_counts_squares",
        f"{TEXTURES}repeating_images_have_period_one",
    )),
    ("D30", "lenses of diameter 0, planes of focus at 0", "the pinhole's picture; refusals", (
        f"{CAMERA}aperture_zero_is_exactly_the_pinhole",
        f"{CAMERA}impossible_cameras_are_refused_by_name",
        f"{WHITTED}lens_blurs_and_the_closed_lens_is_the_pinhole",
    )),
    ("D31", "stop and continue, another number of threads", "the render in one go", (
        f"{STORE}a_render_in_parts_has_the_bits_of_one_in_one_go",
    )),
    ("D32", "no passes, no photons, no time", "refusals", (
        f"{SETTINGS}what_is_out_of_range_is_refused",
        f"{PPM}impossible_options_are_refused",
    )),
    ("E01", "coarse stage reports wrong hits", "identity", (
        f"{HITS}wrong_coarse_hits_change_nothing",
    )),
    ("E02", "coarse stage misses", "identity", (f"{HITS}wrong_coarse_hits_change_nothing",)),
    ("E04", "no coarse mesh", "run with the packages made unimportable", (
        f"{HITS}no_curved_surface_no_embree",
        "rendering/test_render.py::test_scene_of_closed_forms_imports_no_mesh_library",
    )),
    ("E06", "rays in random order", "identity", (
        f"{EVERY_KIND}slices_threads_order_and_pickling_change_no_bit",
    )),
    ("E07", "tolerance 0", "refusal", (f"{TESSELLATION}tolerance_must_be_positive",)),
    ("E08", "tessellation that memory does not hold", "refusal", (
        f"{TESSELLATION}too_many_triangles_are_refused_before_they_are_made",
    )),
    ("E10", "killed while its sums are written", "the render in one go", (
        f"{STORE}killed_at_any_moment",
    )),
    ("C14", "surfaces in many places, mirrored, 1e6 from 0", "the given matrices, in fractions", (
        f"{PLACES}rows_hold_for_the_exact_image",
        f"{PLACES}hits_are_those_of_transformed_copies",
        f"{PLACES}ties_go_to_the_lower_object_then_the_lower_place",
        f"{PLACES}a_point_that_is_left_is_left_out_on_touching_places_too",
    )),
    ("E11", "a bit of a store flips", "the sums that were saved", (
        f"{STORE}every_bit_of_sums_counts",
        f"{STORE}a_bit_of_the_identity_does_not_lose_the_sums",
        f"{STORE}a_flipped_bit_costs_a_save_at_most",
    )),
    ("F09", "lamp in a matt plane, or touching it", "closed form: form factor of a rectangle", (
        "scene/lint/test_lamps_in_surfaces.py::test_all_integrators_agree_on_lamps_at_the_floor",
    )),
    ("F10", "direction of length 1e-310; t beyond the largest double", "closed form; refusal", (
        f"{HITS}bad_rays_are_refused",
        f"{HITS}what_lies_beyond_the_largest_number_is_a_miss",
        f"{HITS}spheres_so_far_away_that_they_are_lost_have_finite_points",
    )),
    ("F11", "point light by way of a mirror or glass", "closed form of the image; named if left out", (
        f"{LIGHT_FOUND}light_is_found_as_declared",
        f"{LIGHT_FOUND}what_is_left_out_is_named_once_with_the_shortest_paths",
        "integrators/probes/test_unfound_light.py::test_it_is_that_of_the_lamps_image",
    )),
    ("D08", "pictures of one pixel, of one row, of none", "closed form; refusals", (
        f"{EXTREMES}in_even_light_every_pixel_of_the_smallest_pictures_shows_it",
        f"{EXTREMES}pictures_of_no_pixel_are_refused",
    )),
    ("D19", "lights of no area, without power, none at all", "black; refusals", (
        f"{EXTREMES}lamps_without_power_light_nothing",
        f"{EXTREMES}a_dark_lamp_beside_a_bright_one_changes_no_bit",
        f"{EXTREMES}lamps_of_no_area_are_refused",
        "scene/test_scene.py::test_impossible_lights_are_refused",
    )),
    ("D33", "radiance 2^99, 2^-99, 1e30 and 1e-30", "identity: light is linear", (
        f"{EXTREMES}light_is_linear",
    )),
    ("D34", "scenes with nothing in them", "the background", (
        f"{EXTREMES}of_nothing_the_background_is_seen",
    )),
    ("L04", "lamps of 1e-6 to 1e6 of the scene", "closed forms of the irradiance", (
        f"{EXTREMES}irradiance_of_balls",
        "lights/test_rectangle.py::test_irradiance_is_lamberts",
    )),
    ("L05", "lamps that touch surfaces, or nearly", "closed forms of the irradiance", (
        f"{EXTREMES}irradiance_of_balls",
        "lights/test_rectangle.py::test_asking_running_into_and_both_see_the_same",
        "scene/lint/test_lamps_in_surfaces.py::test_all_integrators_agree_on_lamps_at_the_floor",
    )),
    ("L08", "radiance from 1e-30 to 1e30", "identity: light is linear", (
        f"{EXTREMES}light_is_linear",
    )),
    ("F12", "light that few camera paths meet", "closed forms: held by the interval, or a warning", (
        "integrators/probes/test_cross_check.py::test_interval_holds_rare_light_or_a_warning_says_so",
    )),
    ("F13", "both crossings of grazing rays, far from 0", "exact distances from the axis", (
        "intersection/test_grazing_pairs.py::test_no_crossing_of_a_grazing_pair_is_left_out",
    )),
    ("F14", "limits of t within a bound of the root", "the root itself", (
        "intersection/test_limits.py::test_what_the_bound_leaves_open_says_so",
    )),
    ("F15", "aspheres whose terms cancel", "fractions", (
        "intersection/test_asphere.py::test_terms_that_cancel_are_traced_within_their_bounds",
    )),
    ("H01", "leaving a face beside a sharp edge", "exact arithmetic", (
        f"{EDGES}rays_that_leave_a_face_beside_a_sharp_edge_meet_the_other_one",
    )),
    ("H02", "skew and flattened faces", "exact arithmetic", (
        f"{EDGES}points_lie_on_their_rays_and_bounds_are_tight",
    )),
    ("H03", "images of closed forms and meshes, far from 0", "the given surface, in fractions", (
        "intersection/test_images_exactly.py::test_rows_hold_for_the_exact_image",
    )),
    ("L14", "what each integrator declares to find", "closed forms of direct light", (
        f"{LIGHT_FOUND}light_is_found_as_declared",
        f"{WHITTED}matt_floor_under_a_point_light",
        f"{WHITTED}matt_floor_under_an_open_sky",
        "lights/test_rectangle.py::test_irradiance_is_lamberts",
        "lights/test_spot.py::test_irradiance_on_a_plane",
        "lights/test_surface.py::test_irradiance_is_lamberts",
    )),
    ("D06", "camera in glass or on its surface", "closed form: radiance n^2 in even light", (
        f"{AMONG_GLASS}camera_within_nested_bodies",
        f"{AMONG_GLASS}camera_within_the_lower_of_two_cubes",
        "integrators/test_camera_across_glass.py::test_lens_that_reaches_out_of_a_ball",
        f"{WHITTED}camera_within_glass_sees_through_what_absorbs",
    )),
    ("D09", "index 1 and 1 + 1e-9", "identity: the picture without the body", (
        f"{FRESNEL}index_one_reflects_nothing",
        f"{WHITTED}glass_of_index_one_is_not_seen",
        f"{ROUGH_GLASS}of_the_same_index_it_only_tints_and_absorbs",
    )),
    ("D10", "indices 1000 and 1e-3", "even light: never above the light there is", (
        f"{WHITTED}extreme_indices_stay_finite_and_within_the_light_there_is",
        f"{FURNACE}every_material",
    )),
    ("D14", "bodies within bodies, overlapping bodies", "closed form: stacks of plates", (
        f"{AMONG_GLASS}body_within_a_body",
        f"{AMONG_GLASS}overlapping_bodies_by_priority",
        f"{AMONG_GLASS}shells_in_an_even_light_are_not_seen",
    )),
    ("D15", "clear bodies that touch", "closed form: stacks of plates without air between", (
        f"{AMONG_GLASS}cube_of_glass_on_cube_of_glass",
        f"{AMONG_GLASS}water_that_fills_a_glass",
    )),
    ("D16", "closed white room", "white furnace: a geometric series, and what is lost is said", (
        f"{FURNACE}white_room_ends_and_says_what_is_lost",
        f"{FURNACE}what_is_lost_in_glass_is_what_is_missing",
    )),
    ("D18", "two parallel mirrors", "nothing is seen, and what is lost is said", (
        f"{WHITTED}two_facing_mirrors_end_at_max_depth_and_say_so",
        f"{FURNACE}what_is_lost_counts_by_what_emissive_surfaces_send",
    )),
    ("D24", "gathering across a thin wall", "the dark side is exactly black", (
        f"{PPM}dark_side_of_a_wall_stays_dark",
    )),
    ("D21", "points that no photon reaches", "0, and counted", (
        "rendering/test_render.py::TestLimit::test_discs_that_no_photon_lies_in_are_said_and_reach_no_target",
    )),
    ("L01", "indices from 1e-3 to 1000", "closed form: light through a plate; Fresnel's equations", (
        f"{FRESNEL}reflectance_is_that_of_fresnels_equations",
        f"{AMONG_GLASS}absorbing_slab",
        f"{WHITTED}absorbing_slab_of_glass_with_all_its_reflections",
        f"{WHITTED}extreme_indices_stay_finite_and_within_the_light_there_is",
    )),
    ("L02", "albedo up to 1", "white furnace: 1 / (1 - albedo); a geometric series", (
        f"{FURNACE}closed_shining_room",
        f"{FURNACE}white_room_ends_and_says_what_is_lost",
        f"{BALANCE}closed_box_stores_a_geometric_series",
    )),
    ("L03", "parallel mirrors of reflectance up to 1", "geometric series with what is lost", (
        f"{WHITTED}two_facing_mirrors_end_at_max_depth_and_say_so",
        f"{FURNACE}what_is_lost_counts_by_what_emissive_surfaces_send",
        f"{THIN}thin_things_are_as_bright_as_wide_ones",
    )),
    ("L07", "gather radii from 1e-12 of the scene to the scene", "closed forms: a pipe, caustics", (
        f"{PPM}radii_far_from_the_scenes_size_are_refused",
        f"{CAUSTICS}sphere_throws_the_light_that_geometric_optics_says",
        "integrators/photons/test_caustics.py::TestBlur::test_estimate_is_the_blur_there_is",
        "integrators/photons/test_blur_of_mean.py::test_discs_wider_than_the_floor_lose_nothing",
        "integrators/photons/test_small_views.py::test_discs_are_no_wider_than_a_quarter_of_their_surface",
    )),
    ("L12", "work where nothing ends a path", "what is lost is said; accounts of photons", (
        f"{FURNACE}white_room_ends_and_says_what_is_lost",
        f"{AMONG_GLASS}shells_in_an_even_light_are_not_seen",
        f"{BALANCE}shining_surfaces_and_sky_send_out_what_they_should",
        f"{PPM}a_million_photons_in_one_point_need_little_memory",
    )),
    ("L16", "nets and perforated sheets in one mesh", "closed form of the mean", (
        f"{THIN}thin_things_are_as_bright_as_wide_ones",
    )),
    ("L06", "photons into a spot of 1e-3 degrees", "what a cone sends out; memory as when spread", (
        f"{SPOT}photons_follow_the_profile_and_carry_equal_power",
        f"{PPM}a_million_photons_in_one_point_need_little_memory",
    )),
    ("L09", "rough metal, roughness 0.01 to 1", "energy of facets that are seen once; refusals", (
        "shading/test_rough.py::TestConductor::test_energy_is_that_of_facets_seen_once",
        "materials/test_rough_conductor.py::test_impossible_metals_are_refused",
    )),
    ("L10", "rough glass, roughness 0.01 to 1", "energy of facets that are seen once; refusals", (
        "shading/test_rough.py::TestGlass::test_energy_is_that_of_facets_seen_once",
        f"{ROUGH_GLASS}in_radiance_one_light_is_lost_only_between_facets",
        f"{MATERIALS}impossible_materials_are_refused",
    )),
    ("L11", "spots of 0.001 to 180 degrees", "closed forms: across the edge, and all that is sent out", (
        f"{SPOT}irradiance_on_a_plane",
        f"{SPOT}power_is_the_integral_of_the_profile",
        f"{SPOT}photons_follow_the_profile_and_carry_equal_power",
        f"{SPOT}bad_settings_are_refused",
    )),
    ("L13", "light under a ball of glass, and behind a pane", "a light tracer that shares no code", (
        f"{CAUSTICS}picture_agrees_with_a_light_tracer_of_its_own",
    )),
    ("L15", "rings cut out of lamps, of all widths", "closed form of the irradiance", (
        f"{RINGS}irradiance_of_a_ring",
        f"{RINGS}narrow_and_tiny_parts_shine",
        f"{RINGS}pictures_show_it",
    )),
    ("E03", "arguments are used twice", "identity", (
        "intersection/test_crossings.py::test_repeated_calls_say_the_same",
        f"{HITS}layouts_change_no_bit_and_arguments_are_left_as_they_are",
    )),
    ("E05", "one worker, many; other processes", "identity", (
        f"{EVERY_KIND}slices_threads_order_and_pickling_change_no_bit",
        "rendering/test_cluster.py::test_workers_killed_and_added_change_no_bit",
    )),
    ("E09", "arrays of any layout", "identity", (
        f"{HITS}layouts_change_no_bit_and_arguments_are_left_as_they_are",
    )),
)  # fmt: skip

for row_id, title, truth, tests in ROWS:
    tested(row_id, title, truth, *tests)
