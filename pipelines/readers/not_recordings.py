"""Files that are published beside recordings and are none, for the error that refuses them."""

from .file_head import FileHead

_NO_PICTURES = "holds no screenshots"
# The keys of a record, and what its file is. Nothing is read or left out because of this table.
_FILES: tuple[tuple[frozenset[str], str], ...] = tuple(
    (frozenset(keys.split()), text)
    for keys, text in (
        (
            "instruction evaluator config",
            "a task of OSWorld, not a run of it: give the results folder, with traj.jsonl",
        ),
        (
            "annotation_id confirmed_task website",
            f"Mind2Web's text, which {_NO_PICTURES}: take Multimodal-Mind2Web, in Parquet",
        ),
        ("task_name step_list", f"a result of Mind2Web-Live, which {_NO_PICTURES}"),
        ("demo_name turn_index doc", f"WebLINX's candidates for ranking, which {_NO_PICTURES}"),
        (
            "uid image_id pred",
            "a model's predictions for GUIAct: give the set's own *_data.json, with actions_label",
        ),
        (
            "images problem solution",
            "questions with solutions (GUI-Critic): judgements of actions, not a recording of them",
        ),
        (
            "episode_id image description",
            "UGround's queries for a grounding model, which hold no action",
        ),
        (
            "episode_id image reason action",
            "UGround's plans, whose actions name elements in words and no place on the picture",
        ),
        (
            "bbox image scale description",
            "UGround's copy of ScreenSpot, whose `scale` is not explained: take ScreenSpot itself",
        ),
        (
            "image abs_position rel_position text",
            "the grounding set of AgentCPM-GUI: write image as image_path and rel_position as bbox,"
            " a list of four numbers, and read it with --boxes xyxy --coordinates fractions",
        ),
        (
            "task image box gpt_output",
            "UGround's plans for OmniACT, whose actions name elements in words",
        ),
        (
            "type browserName wallTime options",
            "a trace of Playwright: its screencast leaves pictures out (at most one in 200 ms), so"
            " none is known to be what an action was taken on; save page.screenshot() before each"
            " action, and write trajectories.jsonl (docs/input_format.md)",
        ),
        ("task screenshots", "a task with screenshots (UI-Venus), which holds no action"),
    )
)


def explanation(head: FileHead) -> str:
    """Return what a file is that no reader takes, and what to do; `""` if that is not known."""
    for keys, text in _FILES:
        if any(keys <= present for present in head.keys):
            return text
    return ""
