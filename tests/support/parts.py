"""The parts of the test suite: the core, which `make test` runs, and six parts of the rest.

The core has every test function that is not in `TAIL`, but of a function with many cases only
`CASES`, drawn by a seed that the summary prints; functions in `WHOLE` keep all. All other cases are
the tail. CI runs the core and one part of the tail, which the commit chooses, so six landings run
everything.
"""

import random
import subprocess
import zlib
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest

TAIL_PARTS = 6
PARTS = ("all", "core", *(f"tail-{number}" for number in range(1, TAIL_PARTS + 1)))
CASES = 1  # of each test function, in the core: another in each landing

# Files of `tests/live` that take longest, the longest first: each is played by one process, and one
# that began last would go on alone.
LONG_FILES = (
    "live/test_gnome_live.py",
    "live/test_bench_osworld_machine.py",
    "live/test_env_live.py",
    "live/test_bench_live.py",
    "live/test_recording_live.py",
    "live/test_late_changes.py",
    "live/test_kit_browser.py",
    "live/test_browser.py",
    "live/test_osworld_bridge.py",
    "live/test_osworld_embedded.py",
)

# Test functions of which the core has every case.
WHOLE = frozenset(
    {
        # all nine corruptions on a real desktop, each proved and undone
        "live/test_env_live.py::test_what_an_agent_saw_is_made_again_offline",
        "live/test_env_live.py::test_each_effect_is_proved_tells_nothing_and_is_undone",
        # a task of each domain
        "live/test_tasks_live.py::test_the_oracle_does_what_nobody_did_before",
    }
)

# Files and test functions (`file::function`) that only the tail has. Another test of the core shows
# the same promise for fewer inputs or on one path. Each takes 5 s or more, or loads a framework
# that no other test of the core loads.
TAIL = frozenset(
    {
        "conformance/test_bad_plugins.py",
        "conformance/test_mutants.py",
        "conformance/test_optimised.py",
        "hijack_data/test_cli.py::test_build_and_verify",
        "hijack_data/test_cli.py::test_check_finds_a_bad_plugin",
        "hijack_data/test_cli.py::test_one_pixel_and_a_hundred_million",
        "hijack_data/test_cli.py::test_state_corruptions_are_shown_by_recorded_pictures",
        "hijack_data/test_device.py::test_a_mixed_batch_is_its_pictures_one_by_one",
        "hijack_data/test_device.py::test_any_resize_gives_the_bytes_of_the_cpu",
        "hijack_data/test_device.py::test_the_kernels_compile_for_ampere_hopper_and_blackwell",
        "hijack_data/test_elements_ocr.py",
        "hijack_data/test_files.py::test_smallest_and_largest",
        "hijack_data/test_gallery_browser.py",
        "hijack_data/test_grain.py::test_the_number_of_compilations_does_not_grow",
        "hijack_data/test_jax_plans.py::test_a_thousand_random_batches_compile_a_few_programs",
        "hijack_data/test_jax_plans.py::test_any_sequence_gives_the_bytes_of_apply",
        "hijack_data/test_labels_closed_world.py::test_forked_workers_that_are_new_in_each_epoch_notice_the_second",
        "hijack_data/test_labels_closed_world.py::test_torch_compile_applies_each_plan_that_it_is_given",
        "hijack_data/test_loading.py::test_a_path_may_be_relative",
        "hijack_data/test_loading.py::test_doctor_lists_it",
        "hijack_data/test_loading.py::test_every_command_knows_it",
        "hijack_data/test_new.py",
        "hijack_data/test_resize.py::test_a_cold_start_warns_of_nothing_and_fills_the_cache",
        "hijack_data/test_transforms_workers.py::test_spawned_workers",
        "live/test_bench_live.py::test_a_gate_that_fails_is_an_exit_code_and_a_failure",
        "live/test_bench_live.py::test_ctrl_c_keeps_what_is_done_and_leaves_no_desktop",
        "live/test_bench_live.py::test_it_is_whole_and_signed",
        "live/test_bench_osworld_live.py",
        "live/test_bench_osworld_machine.py",
        "live/test_bench_ray_live.py",
        "live/test_browser.py::test_a_killed_client_leaves_no_browser",
        "live/test_browser_layer.py::test_a_run_has_the_same_plans_on_both_layers_is_verified_and_built",
        "live/test_check_effects.py::test_the_command_on_a_real_desktop",
        "live/test_corrupt_cli.py",
        "live/test_devtools_agent.py",
        "live/test_docs_live.py",
        "live/test_doors_live.py",
        "live/test_effects_faults.py",
        "live/test_effects_hostile.py",
        "live/test_effects_state.py::test_lock_with_a_password_that_is_not_known_is_forced_open",
        "live/test_effects_touch.py::test_on_a_bare_desktop_a_touch_reaches_what_launches_nothing",
        "live/test_effects_touch.py::test_touch_draws_from_the_stream_alike_and_leaves_launchers_out",
        "live/test_effects_touch.py::test_touch_may_take_launchers",
        "live/test_effects_touch.py::test_touch_notices_an_element_that_moves",
        "live/test_effects_windows.py::test_launch_takes_the_next_when_one_hangs_or_is_not_installed",
        "live/test_embedded_cli.py",
        "live/test_embedded_desktop.py::test_a_dead_spare_is_replaced",
        "live/test_embedded_desktop.py::test_standby_makes_reset_quick",
        "live/test_embedded_faults.py::test_a_fork_of_the_controller_does_not_keep_its_desktops",
        "live/test_embedded_faults.py::test_a_guest_server_that_hangs_ends_its_desktop",
        "live/test_embedded_faults.py::test_a_guest_server_without_descriptors_is_started_again",
        "live/test_embedded_faults.py::test_a_killed_keeper_leaves_an_orphan_that_the_next_start_removes",
        "live/test_embedded_faults.py::test_an_aimed_kill_of_the_keeper_is_told_and_reset_mends_it",
        "live/test_embedded_faults.py::test_cycles_leave_nothing",
        "live/test_embedded_faults.py::test_death_of_display_or_bus_is_told_and_reset_mends_it",
        "live/test_embedded_faults.py::test_two_controllers_at_once",
        "live/test_embedded_hostile.py",
        "live/test_embedded_parts.py::test_pictures_are_the_same_every_time",
        "live/test_embedded_rootless.py::test_everything_of_it_ends",
        "live/test_embedded_tree.py",
        "live/test_env_live.py::test_a_visual_and_a_state_corruption_compose",
        "live/test_env_live.py::test_gymnasium_finds_nothing_to_complain_of",
        "live/test_env_live.py::test_repair_and_reset_on_request",
        "live/test_env_osworld.py::test_a_task_that_could_be_done_is_not_done_by_giving_up",
        "live/test_env_osworld.py::test_an_infeasible_task_is_judged_by_the_agents_last_action",
        "live/test_gnome_live.py",
        "live/test_hub_dataset_live.py",
        "live/test_inspect_live.py",
        "live/test_kit_browser.py",
        "live/test_kit_gui.py",
        "live/test_kit_panel.py",
        "live/test_late_changes.py",
        "live/test_mcp_live.py::test_a_desktop_task_to_its_score",
        "live/test_mcp_live.py::test_over_http_one_client_with_the_token_plays_and_is_told_its_score",
        "live/test_mcp_live.py::test_the_browser_of_a_client_that_vanishes_ends_within_5_seconds",
        "live/test_notebook_live.py",
        "live/test_osworld_desktop.py",
        "live/test_osworld_embedded.py::test_a_task_that_is_done_already_or_by_waiting_is_excluded",
        "live/test_osworld_embedded.py::test_an_evaluator_that_raises_is_an_error_on_record",
        "live/test_pixel_live.py",
        "live/test_pytest_plugin_live.py",
        "live/test_recording_live.py",
        "live/test_same_screens.py::test_first_starts_show_no_dialog",
        "live/test_same_screens.py::test_screens_of_one_seed_are_equal_and_seeds_differ_in_the_clock",
        "live/test_showcase.py",
        "live/test_tasks_live.py::test_a_careful_user_does_the_task_all_the_same",
        "online_env/test_agents_check.py::test_an_agent_that_hangs_or_dies_gets_a_verdict",
        "online_env/test_agents_check.py::test_what_each_check_finds",
        "online_env/test_bench_estimates.py::test_a_dry_run_says_what_it_rests_on",
        "online_env/test_bench_folder.py::test_a_report_says_what_is_missing",
        "online_env/test_bench_folder.py::test_a_run_without_an_episode_is_verified_and_not_reported",
        "online_env/test_bench_folder.py::test_what_an_environment_logged_by_itself_is_reported_too",
        "online_env/test_bench_ray.py",
        "online_env/test_bench_runs.py::test_a_dry_run_says_what_is_left_in_its_folder",
        "online_env/test_bench_runs.py::test_report_as_json_and_as_a_table",
        "online_env/test_bench_runs.py::test_report_names_what_is_invalid_failed_or_damaged",
        "online_env/test_bench_runs.py::test_report_tells_infeasible_tasks_apart",
        "online_env/test_bench_workers.py::test_who_ends_its_process_each_time_counts_as_a_failure",
        "online_env/test_careful.py::test_a_page_has_time_to_load_before_an_escape_would_stop_it",
        "online_env/test_desktop_parts.py::test_groups_that_are_busy_are_left_after_a_while",
        "online_env/test_env_text_boxes.py::test_a_pop_up_keeps_the_line_free",
        "online_env/test_image_container.py::test_engines_find_what_they_check",
        "online_env/test_image_container.py::test_the_code_in_it_is_all_that_is_needed",
        "online_env/test_image_container.py::test_the_layers_are_the_system_and_what_a_desktop_needs",
        "online_env/test_image_container.py::test_the_same_image_is_the_same_file",
        "online_env/test_inspect.py::test_a_model_that_raises_leaves_no_desktop",
        "online_env/test_inspect.py::test_inspect_finds_the_tasks_in_an_installed_package",
        "online_env/test_inspect.py::test_models_get_their_native_computer_use",
        "online_env/test_inspect.py::test_samples_wait_for_a_free_desktop",
        "online_env/test_inspect.py::test_the_answer_fail_is_passed_on_and_a_limit_cuts_off",
        "online_env/test_inspect.py::test_without_inspect_the_extra_is_named",
        "online_env/test_osworld_family.py::test_a_run_of_a_task_of_ours_loads_nothing_of_osworld",
        "online_env/test_osworld_family.py::test_missing_files_are_named_before_a_run",
        "online_env/test_osworld_family.py::test_missing_packages_are_named_before_a_run",
        "online_env/test_osworld_machines.py::test_a_machine_that_does_not_start_is_named",
        "online_env/test_osworld_machines.py::test_a_run_without_a_machine_left_says_why",
        "online_env/test_osworld_machines.py::test_an_episode_goes_on_elsewhere_when_its_machine_dies",
        "online_env/test_osworld_machines.py::test_another_screen_than_the_benchmarks_is_refused",
        "online_env/test_osworld_machines.py::test_tasks_that_cannot_be_played_are_listed_and_counted",
        "online_env/test_pixel.py",
        "online_env/test_report_certificate.py::test_a_bound_that_needs_more_tasks_than_there_are_is_said_before_the_run",
        "online_env/test_report_certificate.py::test_verify_proves_a_run_that_ended_early_and_finds_one_that_did_not_have_to",
        "online_env/test_score_my_agent.py::test_the_agent_of_a_section_does_the_task",
        "online_env/test_scoring.py::test_a_killed_run_goes_on_twice_and_no_row_is_scored_twice",
        "online_env/test_scoring.py::test_an_agent_that_misbehaves_costs_its_row_and_nothing_else",
        "online_env/test_scoring.py::test_the_command_and_the_report",
        "online_env/test_scoring_onlooker.py",
        "online_env/test_scoring_recorded.py",
        "pipelines/test_all_nine.py::test_a_table_is_built_alike_by_one_worker_and_by_two",
        "pipelines/test_all_nine.py::test_datasets_loads_it",
        "pipelines/test_build_choices.py::test_splits_in_a_configuration_make_the_same_dataset_again",
        "pipelines/test_build_options.py::test_workers_leave_the_other_processors_alone",
        "pipelines/test_contradictions.py::test_the_run_as_it_was_recorded_is_whole",
        "pipelines/test_edits_real.py",
        "pipelines/test_edits_shapes.py::test_every_edit_is_made_at_any_size_or_says_why_not",
        "pipelines/test_engine_ray.py::test_a_cluster_that_runs_already",
        "pipelines/test_engine_ray.py::test_a_node_that_dies",
        "pipelines/test_engine_ray.py::test_a_node_that_does_not_share_the_output",
        "pipelines/test_engine_ray.py::test_a_shard_that_kills_every_worker_is_given_up",
        "pipelines/test_engine_ray.py::test_a_worker_that_is_killed_in_the_middle_of_a_shard",
        "pipelines/test_engine_ray.py::test_ctrl_c_and_kill_end_the_cluster_that_was_started",
        "pipelines/test_engine_ray.py::test_the_same_bytes_as_a_local_build",
        "pipelines/test_howto_osworld.py",
        "pipelines/test_lazy.py::test_the_real_recordings",
        "pipelines/test_loaded.py",
        "pipelines/test_readers_formats.py::test_no_value_stops_a_reader",
        "pipelines/test_resume.py::test_kill_and_resume_and_kill_and_resume",
        "pipelines/test_resume.py::test_killed_after_every_shard_of_two_workers",
        "pipelines/test_resume.py::test_killed_at_random_instants",
        "pipelines/test_resume.py::test_killed_before_and_after_every_file_is_put_in_place",
        "pipelines/test_resume.py::test_workers_end_with_a_build_that_is_killed",
        "pipelines/test_trust.py::test_a_folder_that_may_not_be_written_to",
        "pipelines/test_trust.py::test_ctrl_c",
        "pipelines/test_trust.py::test_files_that_may_not_grow",
        "pipelines/train/test_sft.py",
        "pipelines/train/test_toy.py::test_the_start_learns_from_the_expert",
        "pipelines/train/test_trl.py",
        "pipelines/viewer/test_viewer_browser.py",
        "test_broken_package.py::test_a_name_of_ours_cannot_be_taken",
        "test_broken_package.py::test_datasets_are_built",
        "test_broken_package.py::test_doctor_lists_them",
        "test_broken_package.py::test_list_shows_all_others",
        "test_broken_package.py::test_pictures_are_made",
        "test_broken_package.py::test_so_it_is_under_the_name_that_it_registered",
        "test_broken_package.py::test_the_benchmark_is_listed",
        "test_examples_training.py",
        "test_ext_package.py::test_a_configuration_may_name_them",
        "test_ext_package.py::test_a_file_with_all_of_a_corruption_of_the_machine",
        "test_ext_package.py::test_a_users_agent_and_task",
        "test_ext_package.py::test_a_users_reader_and_writer",
        "test_ext_package.py::test_check_passes_on_its_file",
        "test_ext_package.py::test_doctor_lists_each_kind",
        "test_ext_package.py::test_its_agent_solves_its_task_on_its_desktop_under_its_corruption",
        "test_ext_package.py::test_the_plugins_are_listed_after_the_nine",
        "test_extras.py::test_a_command_without_online",
        "test_extras.py::test_code_with_the_core_alone",
        "test_extras.py::test_code_without_online",
        "test_extras.py::test_doctor_has_a_row_for_every_extra_and_one_for_the_desktop",
        "test_grounding_proof.py",
        "test_notebooks.py",
        "test_optimised.py",
        "test_other_systems.py",
        "test_package.py::test_the_sdist_holds_what_the_wheel_is_made_of",
        "test_package.py::test_the_wheel_holds_every_file_of_the_packages_and_no_other",
        "test_published.py::test_a_page_without_a_place_for_its_table_stays_as_it_is",
        "test_site.py::test_code_of_the_pages_runs",
        "test_site.py::test_every_name_of_the_reference_is_documented",
        "test_site.py::test_every_page_has_its_place",
    }
)


def starting_order(item: pytest.Item) -> int:
    """Return the key that sorts tests of long files first, and leaves the others as they are."""
    file = item.nodeid.partition("::")[0].removeprefix("tests/")
    return LONG_FILES.index(file) if file in LONG_FILES else len(LONG_FILES)


def default_seed(root: Path) -> int:
    """Return the number of the commit, so that the next one draws other cases; 0 without git."""
    command = ["git", "-C", str(root), "rev-parse", "--short=8", "HEAD"]
    try:
        process = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 0
    return int(process.stdout, 16)


def is_ignored(file: str, part: str) -> bool:
    """Whether no test of a file (its path below `tests`) belongs to a part, without importing it."""
    if file not in TAIL or part == "all":
        return False
    return part != f"tail-{_tail_part(file)}"


def select(items: Iterable[pytest.Item], part: str, seed: int) -> set[str]:
    """Return the ids of the tests that belong to a part.

    Args:
        items: all tests that were collected.
        part: one of `PARTS`.
        seed: decides which cases of a function are in the core.
    """
    functions: defaultdict[str, list[str]] = defaultdict(list)
    for item in items:
        functions[item.nodeid.partition("[")[0]].append(item.nodeid)
    if part == "all":
        return {case for cases in functions.values() for case in cases}
    selected: set[str] = set()
    for function, cases in functions.items():
        core = _draw(function.removeprefix("tests/"), cases, seed)
        if part == "core":
            selected |= core
        else:
            other_cases = (case for case in cases if case not in core)
            selected |= {case for case in other_cases if part == f"tail-{_tail_part(case)}"}
    return selected


def _draw(function: str, cases: list[str], seed: int) -> set[str]:
    if function in TAIL or function.partition("::")[0] in TAIL:
        return set()
    if len(cases) <= CASES or function in WHOLE:
        return set(cases)
    return set(random.Random(f"{seed} {function}").sample(cases, CASES))


def _tail_part(case: str) -> int:
    """Return a number from 1 to `TAIL_PARTS`: the same for all tests of a file that the tail has as a whole."""
    file = case.partition("::")[0].removeprefix("tests/")
    return 1 + zlib.crc32((file if file in TAIL else case).encode()) % TAIL_PARTS
