"""OSWorld's self-test and its scripted solutions, on an environment that is none."""

import json
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from hijack_data.errors import ConfigError, ElementsError
from online_env.osworld import history
from online_env.osworld.cache_files import HISTORY_NAME
from online_env.osworld.errors import EvaluatorError, OsworldError, TaskRefusedError
from online_env.osworld.player import Player, PlayError, named_nodes
from online_env.osworld.selftest import choose, read_groups, run_all
from online_env.osworld.solutions import SOLUTIONS
from online_env.osworld.tasks import OsworldTask, Revision, TaskSet

SPACE = "https://accessibility.ubuntu.example.org/ns"


def tree(*nodes):
    """A tree of nodes `(role, name, x, y)`, each 20 x 10 pixels."""
    rows = "".join(
        f'<{role} name="{name}" cp:screencoord="({x}, {y})" cp:size="(20, 10)"/>'
        for role, name, x, y in nodes
    )
    space = f'xmlns:cp="{SPACE}/component"'
    return f'<desktop-frame {space}><application name="app">{rows}</application></desktop-frame>'


@dataclass
class Env:
    """An environment whose evaluator gives the scores of a list, one after the other."""

    scores: list = field(default_factory=list)
    trees: list = field(default_factory=list)
    log: list = field(default_factory=list)
    refuses: tuple = ()
    history: bytes | None = None

    def __post_init__(self):
        self.actions = []
        self.warnings = []
        self.resets = 0
        self.controller = SimpleNamespace(
            get_accessibility_tree=self.next_tree,
            execute_python_command=self.actions.append,
            get_file=lambda path: self.history,
        )

    def next_tree(self):
        return self.trees.pop(0) if len(self.trees) > 1 else self.trees[0]

    def reset(self, config):
        if self.refuses:
            raise TaskRefusedError(config["id"], list(self.refuses))
        self.resets += 1
        self.warnings = list(self.log)

    def step(self, action, pause=2.0):
        self.actions.append(action)

    def evaluate(self):
        score = self.scores.pop(0)
        if isinstance(score, Exception):
            raise score
        return score


def task(name="aa11", func="exact_match", **more):
    config = {"id": name, "instruction": "Do it", "evaluator": {"func": func}, **more}
    return OsworldTask(name, "os", config, None)


def tasks(*listed):
    return TaskSet(Revision("unknown", "0"), tuple(listed))


def row_of(env, one):
    """The row of the self-test of one task."""
    (row,) = run_all(env, tasks(one), {"easy": frozenset({"aa11"})}, {}).rows
    return row


# Self-test


@pytest.mark.parametrize(
    ("scores", "one", "status", "reason"),
    [
        ([0], task(func="infeasible"), "excluded", "scores 0 after its solution (FAIL)"),
        ([1.0], task(), "excluded", "scores 1 untouched"),
        ([0, 0.5], task(), "excluded", "scores 0.5 untouched"),
        ([0, 0], task(), "untried", "no scripted solution here"),
        ([EvaluatorError("it raised", "KeyError", ["WARNING x"])], task(), "error", "it raised"),
    ],
)
def test_a_task_that_cannot_be_scored_says_why(scores, one, status, reason):
    if not one.feasible:
        scores = [0, 0]
    row = row_of(Env(scores), one)
    assert (row.status, row.reason) == (status, reason)
    assert row.group == "easy"
    assert row.seconds >= 0


def test_an_infeasible_task_works_once_fail_is_answered():
    env = Env([0, 1])
    row = row_of(env, task(func="infeasible"))
    assert (row.status, row.untouched, row.solved, row.how) == ("works", 0, 1, "FAIL")
    assert env.actions == ["FAIL"]


def test_a_scripted_solution_is_played_on_a_fresh_desktop(monkeypatch):
    monkeypatch.setitem(SOLUTIONS, "aa11", SimpleNamespace(how="shell", play=lambda p: p.do("x")))
    env = Env([0, 0, 1])
    row = row_of(env, task())
    assert (row.status, row.how) == ("works", "shell")
    assert env.resets == 2
    assert env.actions == ["WAIT", "x", "WAIT"]


def test_a_solution_that_finds_nothing_is_an_error_of_its_own(monkeypatch):
    def play(player):
        player.find("Nowhere", timeout=0)

    monkeypatch.setitem(SOLUTIONS, "aa11", SimpleNamespace(how="windows", play=play))
    row = row_of(Env([0, 0], [tree()]), task())
    assert row.status == "error"
    assert (
        row.reason == "its scripted solution failed: no element 'Nowhere' on the screen within 0 s"
    )


def test_refused_tasks_and_failed_setups_are_excluded():
    refused = row_of(Env(refuses=("no metric x", "no getter y")), task())
    assert (refused.status, refused.reason) == ("excluded", "no metric x; no getter y")
    failed = row_of(Env(log=["INFO fine", "ERROR no such file"]), task())
    assert failed.reason == "its setup fails here: ERROR no such file"
    assert failed.log == ["ERROR no such file"]


def test_the_results_are_told_counted_and_printed():
    message = []
    env = Env([0, 0, 0, 1])
    listed = tasks(task("aa11"), task("bb22", func="infeasible"))
    results = run_all(env, listed, {}, {"tier": "tiny"}, lambda row, so_far: message.append(row.id))
    assert message == ["aa11", "bb22"]
    assert results.sound
    assert results.summary() == "2 tasks of unknown@0: 1 works, 1 untried, 0 excluded, 0 error"
    data = json.loads(json.dumps(results.as_json()))
    assert [row["id"] for row in data["tasks"]] == message
    lines = results.as_markdown().splitlines()
    assert lines[2] == "| - | os aa11 | 0 | - | - | untried: no scripted solution here |"
    assert lines[3] == "| - | os bb22 | 0 | 1 | FAIL | works |"


def test_tasks_are_chosen_by_group_id_or_beginning(tmp_path):
    path = tmp_path / "groups.json"
    path.write_text(json.dumps({"light": [["os", "aa11"], ["os", "zz99"]]}))
    groups = read_groups(path)
    listed = tasks(task("aa11"), task("bb22"), task("bb33"))
    assert [item.id for item in choose(listed, groups, ["light"])] == ["aa11"]
    assert [item.id for item in choose(listed, groups, ["bb2", "light"])] == ["aa11", "bb22"]
    assert len(choose(listed, groups, [])) == 3
    with pytest.raises(ConfigError, match=r"'ligth' is neither a group nor a task.*'light'"):
        choose(listed, groups, ["ligth"])
    path.write_text('{"light": [1]}')
    with pytest.raises(ConfigError, match=r"must hold \{group: \[\[domain, id\]"):
        read_groups(path)


# The hands of the solutions


def test_the_player_clicks_names_by_their_beginning_and_role():
    calls = tree(("label", "Save all", 0, 0), ("push-button", "Save", 100, 40))
    env = Env(trees=[calls])
    player = Player(env)
    player.click("Save", "push-button")
    player.click("Sav")
    assert env.actions == ["pyautogui.click(110, 45)", "pyautogui.click(10, 5)"]
    assert player.sees("Save")
    assert not player.sees("Open", timeout=0)


def test_the_player_waits_until_an_element_comes():
    env = Env(trees=["", tree(("entry", "Late", 0, 0))])
    assert Player(env).find("Late") == (10, 5)
    with pytest.raises(PlayError, match="no entry 'Never' on the screen"):
        Player(env).find("Never", "entry", timeout=0)


def test_the_player_clicks_in_the_row_of_a_name():
    rows = [("label", "One", 0, 10), ("label", "Two", 0, 50)]
    buttons = [("push-button", "More", 90, 12), ("push-button", "More", 90, 48)]
    env = Env(trees=[tree(*rows, *buttons)])
    Player(env).click_beside("Two", "More")
    assert env.actions == ["pyautogui.click(100, 53)"]


def test_the_player_types_an_address_again_that_was_searched_for():
    bar = ("entry", "Address and search bar", 0, 0)
    searched = tree(bar, ("frame", "chrome://settings - Lumen Search - Chromium", 0, 0))
    result = tree(bar, ("frame", "Settings - Chromium", 0, 0))
    env = Env(trees=[tree(bar), searched, searched, result])
    Player(env).visit("chrome://settings")
    assert env.actions.count("pyautogui.write('chrome://settings')") == 2


def test_the_player_types_presses_and_runs_commands():
    env = Env(trees=[tree(("entry", "Address and search bar", 0, 0))])
    player = Player(env)
    player.visit("chrome://settings")
    player.shell("ls 'a b'")
    assert env.actions[:3] == [
        "pyautogui.hotkey('ctrl', 'l')",
        "pyautogui.write('chrome://settings')",
        "pyautogui.hotkey('enter')",
    ]
    assert env.actions[3].endswith("subprocess.run(\"ls 'a b'\", shell=True)")


def test_nodes_without_a_name_or_a_place_are_left_out():
    odd = f'<r xmlns:cp="{SPACE}/component"><a name="x"><b name="no place"/></a></r>'
    assert named_nodes(odd) == []
    assert named_nodes("") == []
    heading = named_nodes(tree(("heading", "Title", 3, 4), ("link", "", 0, 0)))
    assert [(node.tag, node.name, node.box) for node in heading] == [
        ("heading", "Title", (3, 4, 23, 14))
    ]
    with pytest.raises(ElementsError):
        named_nodes("<broken")


# The empty history


def test_a_history_is_made_once_for_each_task_that_needs_one(tmp_path):
    needy = task("aa11", config=[{"type": "update_browse_history", "parameters": {}}])
    env = Env(history=b"SQLite")
    history.provide(env, tasks(needy, task("bb22")), tmp_path)
    assert (tmp_path / "aa11" / HISTORY_NAME).read_bytes() == b"SQLite"
    assert not (tmp_path / "bb22").exists()
    history.provide(env, tasks(needy), tmp_path)
    assert len(env.actions) == 1
    with pytest.raises(OsworldError, match="hijack desktop install"):
        history.provide(Env(), tasks(needy), tmp_path / "other")


def test_every_solution_says_how_it_acts():
    assert {solution.how for solution in SOLUTIONS.values()} <= {"windows", "shell"}
