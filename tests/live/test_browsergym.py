"""`corrupt` on environments of BrowserGym: MiniWoB++ with its own validators."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support import needs
from support.endpoints import serving

pytest.importorskip("browsergym.miniwob", reason=needs.BROWSERGYM)
pytest.importorskip("miniwob", reason=needs.BROWSER)

import gymnasium
import miniwob
from browsergym.core.action.highlevel import HighLevelActionSet
from gymnasium.error import ResetNeeded
from playwright.sync_api import BrowserType

from hijack_data import Subtitle
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, HijackError, ParameterError
from online_env.browser.browsergym import corrupt, map_code
from online_env.browser.chromium import find_program
from online_env.browser.site import FolderSite
from online_env.effects.base import EffectError
from online_env.errors import MissingCapabilityError

PAGES = Path(miniwob.__file__).parent / "html"


@pytest.fixture(scope="module", autouse=True)
def chromium_of_the_system() -> Iterator[None]:
    """BrowserGym's chat starts a browser without its options: give both the system's Chromium."""
    needs.chromium()
    launch = BrowserType.launch
    program = find_program()

    def launch_here(self: Any, **options: Any) -> Any:
        arguments = [*(options.pop("args", None) or []), "--no-sandbox"]
        return launch(self, **{"executable_path": program, "args": arguments, **options})

    BrowserType.launch = launch_here
    yield
    BrowserType.launch = launch


@pytest.fixture(scope="module")
def pages() -> Iterator[str]:
    """The pages of MiniWoB++, served on this machine."""
    site = FolderSite("miniwob.test", PAGES)
    yield f"http://127.0.0.1:{site.port}/miniwob/"
    site.close()


@pytest.fixture
def make(pages: str) -> Iterator[Any]:
    items: list[Any] = []

    def make(corruption: Any, task: str = "click-button", **options: Any) -> Any:
        settings = {"base_url": options.pop("base_url", pages)}
        viewport = {"width": 640, "height": 480}
        env = gymnasium.make(
            f"browsergym/miniwob.{task}",
            task_kwargs=settings,
            viewport=viewport,
            slow_mo=0,
            pre_observation_delay=0.1,
            action_mapping=HighLevelActionSet(
                subsets=["bid", "coord", "tab", "infeas"], multiaction=True
            ).to_python_code,
            disable_env_checker=True,
        )
        items.append(corrupt(env, corruption, **options))
        return items[-1]

    yield make
    for env in items:
        env.close()


def read(node: dict[str, Any], key: str) -> Any:
    return node.get(key, {}).get("value")


def box_of(observation: dict[str, Any], name: str) -> tuple[str, list[float]]:
    """The bid and the box of the button with a name, from the accessibility tree."""
    for node in observation["axtree_object"]["nodes"]:
        bid = node.get("browsergym_id")
        if bid and (read(node, "role"), read(node, "name")) == ("button", name):
            return bid, observation["extra_element_properties"][bid]["bbox"]
    raise AssertionError(f"no button {name!r}")


def goal_name(observation: dict[str, Any]) -> str:
    return observation["goal"].split('"')[1]


def pixels_differ(first: dict[str, Any], second: dict[str, Any]) -> int:
    return int((first["screenshot"] != second["screenshot"]).any(axis=2).sum())


@pytest.mark.parametrize(
    "corruption", [None, "pop_ups", "marks", Subtitle(fit="shrink"), "resolution"]
)
def test_a_picture_corruption_leaves_a_task_that_a_click_by_pixels_solves(
    corruption: Any, make: Any
) -> None:
    clean, _ = make(None).reset(seed=3)
    env = make(corruption)
    observation, info = env.reset(seed=3)
    if corruption == "resolution":
        assert observation["screenshot"].shape < clean["screenshot"].shape
    elif corruption is not None:
        assert pixels_differ(observation, clean) > 100
    _, (x, y, width, height) = box_of(observation, goal_name(observation))
    assert "agenthijack" not in str(info)
    action = f"mouse_click({x + width / 2}, {y + height / 2})"
    _, reward, terminated, _, _ = env.step(action)
    assert (reward, terminated) == (1.0, True), env.unwrapped.last_action_error
    assert env.record["corruption"] in (corruption, "clean", "subtitle")


@pytest.mark.parametrize("corruption", ["multi_apps", "app_minimization"])
def test_a_page_in_front_is_in_every_part_of_the_observation_and_goes_away(
    corruption: str, make: Any
) -> None:
    clean, _ = make(None).reset(seed=3)
    name = goal_name(clean)
    env = make(corruption)
    observation, _ = env.reset(seed=3)
    while not env.record["effects"]:  # it comes at a step of its own
        observation, _, terminated, _, _ = env.step("noop(10)")
        assert not terminated
    names = {read(node, "name") for node in observation["axtree_object"]["nodes"]}
    assert name not in names
    assert pixels_differ(observation, clean) > 10_000
    assert not any(string == name for string in observation["dom_object"]["strings"]), (
        "the DOM is that of the page behind"
    )
    observation, reward, terminated, _, _ = env.step("noop(10)")  # the validator does not end it
    assert (reward, terminated) == (0, False)
    title = next(
        node["browsergym_id"]
        for node in observation["axtree_object"]["nodes"]
        if node.get("browsergym_id") and read(node, "role") == "button"
    )
    observation, *_ = env.step(f'click("{title}")')
    bid, _ = box_of(observation, name)
    _, reward, terminated, _, _ = env.step(f'click("{bid}")')
    assert (reward, terminated) == (1.0, True)


def test_the_network_is_gone_until_the_end_and_the_validator_does_not_crash(
    make: Any, pages: str
) -> None:
    env = make("network_error")
    observation, _ = env.reset(seed=3)
    texts = " ".join(observation["dom_object"]["strings"])
    assert "ERR_INTERNET_DISCONNECTED" in texts
    assert observation["url"].startswith((pages, "chrome-error:"))
    _, reward, terminated, _, info = env.step("noop(10)")
    assert (reward, terminated) == (0.0, False) or "invalid url" in str(info)
    if not terminated:
        env.step('report_infeasible("no network")')
    env.close()
    [effect] = env.record["effects"]
    assert effect["record"]["undone"][0]["ok"]


def test_an_accidental_touch_clicks_an_element_of_the_page(make: Any) -> None:
    env = make("accidental_touch", task="click-checkboxes")
    env.reset(seed=3)
    for _ in range(6):
        if env.record["effects"]:
            break
        env.step("noop(10)")
    [effect] = env.record["effects"]
    assert effect["record"]["probes"][0]["ok"]


def test_what_has_no_meaning_is_refused_with_its_reason(make: Any) -> None:
    with pytest.raises(EffectError, match="lose their state"):
        make("verification").reset(seed=0)
    with pytest.raises(ParameterError, match="BrowserGym sends that"):
        make("missed_input")
    with pytest.raises(MissingCapabilityError, match="the effect slow_link"):
        make("slow_network")
    local = make("network_error", base_url=f"file://{PAGES}/miniwob/")
    with pytest.raises(EffectError, match="of no site"):
        local.reset(seed=0)
    with pytest.raises(ResetNeeded):  # it would go on without the corruption
        local.step("noop()")
    with pytest.raises(ParameterError, match="no environment of BrowserGym"):
        corrupt(gymnasium.make("CartPole-v1"), None)
    with pytest.raises(HijackError):
        make("no_such_corruption")


class Halved(gymnasium.ObservationWrapper[Any, Any, Any]):
    """The picture at half its size."""

    def observation(self, observation: dict[str, Any]) -> dict[str, Any]:
        return {**observation, "screenshot": observation["screenshot"][::2, ::2]}


def test_wrappers_go_around_the_corruption_and_nothing_is_played_after_the_end(make: Any) -> None:
    env = make("multi_apps")
    with pytest.raises(ParameterError, match=r"Halved\(corrupt\(env, ...\)\)"):
        corrupt(Halved(env.env), "multi_apps")
    halved = Halved(env)
    observation, _ = halved.reset(seed=3, options={})
    assert observation["screenshot"].shape == (360, 480, 3)  # half of 1.5 times the window
    env.step('report_infeasible("no")')
    with pytest.raises(ResetNeeded, match="is over"):
        env.step("noop()")


def test_places_are_mapped_and_what_cannot_be_is_refused() -> None:
    coords = CoordMap((50, 100), (100, 200))
    code = "def mouse_click(x, y, button='left'):\n    page.mouse.click(x, y)\n\n"
    mapped = map_code(f"{code}mouse_click(10, y=20, button='right')\nscroll(-3, 5)", coords)
    assert mapped.endswith("mouse_click(20, y=40, button='right')\nscroll(-6, 10)")
    assert map_code("click('a51')", coords) == "click('a51')"
    for text in ("page.mouse.click(3, 4)", "mouse_click(a, 4)", "mouse_click(3)", "my_click(3, 4)"):
        with pytest.raises(ActionError):
            map_code(text, coords)


def click_first_button(body: dict[str, Any]) -> str:
    """Answer as a model would that clicks the first button of the tree that it is shown."""
    prompt = json.dumps(body["messages"]).replace("\\\\", "").replace('\\"', "'")
    tree = prompt[prompt.rindex("AXTree:") :]
    match = re.search(r"\[(\w+)\] button '", tree)
    return f"<action>\nclick('{match[1]}')\n</action>" if match else "<action>\nnoop()\n</action>"


@pytest.mark.filterwarnings("ignore")  # of the many packages that AgentLab imports
@pytest.mark.parametrize(("corruption", "steps"), [("pop_ups", 1), ("multi_apps", 2)])
def test_agentlab_plays_its_generic_agent_in_it(
    corruption: str, steps: int, pages: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """AgentLab's own loop, a model of its own at an endpoint here; one line makes it corrupted."""
    monkeypatch.setenv("LITELLM_LOCAL_MODEL_COST_MAP", "True")  # asks no host for prices
    pytest.importorskip("agentlab", reason=needs.AGENTLAB)
    from agentlab.agents.generic_agent.agent_configs import FLAGS_GPT_4o
    from agentlab.agents.generic_agent.generic_agent import GenericAgentArgs
    from agentlab.experiments.loop import ExpArgs, get_exp_result
    from agentlab.llm.chat_api import OpenAIModelArgs

    from support.corrupted_env_args import CorruptedEnvArgs

    monkeypatch.setenv("MINIWOB_URL", pages)
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    model = OpenAIModelArgs(
        model_name="gpt-4o-mini",
        max_total_tokens=20_000,
        max_input_tokens=16_000,
        max_new_tokens=500,
    )
    experiment = ExpArgs(
        agent_args=GenericAgentArgs(chat_model_args=model, flags=FLAGS_GPT_4o),
        env_args=CorruptedEnvArgs("miniwob.click-test", 0, max_steps=5, corruption=corruption),
    )
    with serving(click_first_button) as endpoint:
        monkeypatch.setenv("OPENAI_BASE_URL", endpoint.url)
        experiment.prepare(tmp_path)
        experiment.run()
    record = get_exp_result(experiment.exp_dir).get_exp_record()
    assert (record["cum_reward"], record["n_steps"], record["err_msg"]) == (1.0, steps, None)
