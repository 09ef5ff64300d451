"""`corrupt`: any environment of BrowserGym under a corruption, with its own tasks and judges."""

import ast
from dataclasses import replace
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from hijack_data import apply
from hijack_data.coords import CoordMap
from hijack_data.errors import ActionError, ParameterError
from hijack_data.plan import Plan
from hijack_data.planner import Planner
from hijack_data.runs.run_planners import get_label
from hijack_data.types import BoxArray, Size, UInt8Array, as_boxes

from ..effects.base import PASSWORD, EffectError
from ..environment.live_effects import EpisodeEffects
from ..environment.script import BEFORE, Script, find_planner
from ..errors import MissingCapabilityError
from .playwright_browser import PlaywrightBrowser

APPS = ("chrome",)
MAX_STEPS = 30  # steps for which a corruption is checked before an episode
# Of the functions of actions with places in the picture: their parameters, points and distances.
_POINTS: dict[str, tuple[tuple[str, str], ...]] = {
    "mouse_move": (("x", "y"),),
    "mouse_up": (("x", "y"),),
    "mouse_down": (("x", "y"),),
    "mouse_click": (("x", "y"),),
    "mouse_dblclick": (("x", "y"),),
    "mouse_upload_file": (("x", "y"),),
    "mouse_drag_and_drop": (("from_x", "from_y"), ("to_x", "to_y")),
    "scroll_at": (("x", "y"), ("dx", "dy")),
    "scroll": (("delta_x", "delta_y"),),
}
_DISTANCES = {("dx", "dy"), ("delta_x", "delta_y")}
# Functions without places.
_OTHERS = frozenset(
    {
        *("check", "clear", "click", "dblclick", "drag_and_drop", "fill", "focus", "go_back"),
        *("go_forward", "goto", "hover", "keyboard_down", "keyboard_insert_text"),
        *("keyboard_press", "keyboard_type", "keyboard_up", "new_tab", "noop", "press"),
        *("report_infeasible", "select_option", "send_msg_to_user", "tab_close", "tab_focus"),
        *("uncheck", "upload_file"),
    }
)
# Whether the pages of a task are the same after they were loaded again. MiniWoB++ is not: its
# episode is started by BrowserGym, with a script in the page.
_SURVIVES_RELOAD = {
    "browsergym.miniwob": False,
    "browsergym.webarena": True,
    "browsergym.visualwebarena": True,
    "browsergym.workarena": True,
    "browsergym.assistantbench": True,
}


def corrupt(
    env: "gymnasium.Env[Any, Any]",
    corruption: str | Planner | None,
    seed: int = 0,
    *,
    password: str = PASSWORD,
    survives_reload: bool | None = None,
) -> "CorruptedBrowserGym":
    """Return an environment of BrowserGym under a corruption.

    Args:
        env: Made by BrowserGym, such as `gymnasium.make("browsergym/miniwob.click-test")`.
        corruption: A name, a `Corruption` or another planner; `None` for none.
        seed: Of all draws of the corruption; the seed of `reset` is the task's.
        password: What ends the sign-in page of `verification`.
        survives_reload: Whether pages of the tasks may be loaded again; known of BrowserGym's own
            benchmarks.

    Raises:
        MissingCapabilityError: A browser cannot have this corruption.
        ParameterError: `env` is none of BrowserGym's or has wrappers of its own, or the corruption
            changes the agent's input.
        UnknownNameError: There is no such corruption.
    """
    return CorruptedBrowserGym(
        env, find_planner(corruption), seed, password=password, survives_reload=survives_reload
    )


class CorruptedBrowserGym(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment of BrowserGym under a corruption; make one by `corrupt`.

    Screenshot, DOM, accessibility tree, element properties and focus are those of one page: the one
    that the agent sees. Coordinates are those of the screenshot that it sees.
    """

    def __init__(
        self,
        env: "gymnasium.Env[Any, Any]",
        planner: Planner | None,
        seed: int,
        *,
        password: str,
        survives_reload: bool | None,
    ) -> None:
        super().__init__(env)
        base: Any = env.unwrapped
        if not hasattr(base, "action_mapping") or not hasattr(base, "post_step"):
            raise ParameterError(f"{type(base).__name__} is no environment of BrowserGym")
        if base.use_raw_page_output:
            raise ParameterError("use_raw_page_output gives the agent the page, not observations")
        _check_wrappers(env)
        if planner is not None:
            _check(planner)
        self._base = base
        self._planner = planner
        self._seed = seed
        self._password = password
        self._survives_reload = survives_reload
        self._map_action = base.action_mapping
        base.action_mapping = self._map_code
        self._browser: PlaywrightBrowser | None = None
        self._effects: EpisodeEffects | None = None
        self._script: Script | None = None
        self._coords: CoordMap | None = None
        self._step = 0
        self._is_running = False  # whether steps are of an episode with all that was planned
        self._digests: list[str] = []

    @property
    def record(self) -> dict[str, Any]:
        """What was done to the episode, as JSON data; not for the agent."""
        return {
            "corruption": get_label(self._planner),
            "seed": self._seed,
            "step": self._step,
            "plan_digests": list(self._digests),
            "effects": [] if self._effects is None else self._effects.records,
        }

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode.

        Raises:
            EffectError: The corruption has no meaning on this task; the message has the reason.
            ParameterError: The screen is too small for it.
        """
        self._is_running = False
        self._end()
        self._step = 0
        self._digests = []
        observation, info = self.env.reset(seed=seed, options=options)
        size = _picture_size(observation)
        base = self._base
        self._coords = CoordMap.identity(size)
        self._browser = PlaywrightBrowser(
            base.context,
            size,
            float(getattr(base.page, "_bgym_scale_factor", 1.0)),
            lambda: base.page,
            base._activate_page_from_js,
        )
        self._guard_validator()
        self._browser.task_is_over = lambda: bool(base._task_validate()[1])
        sample = f"{_task_name(base.task)}-{seed}"
        script = Script(self._planner, self._seed, sample, APPS, size)
        script.check(MAX_STEPS, self._browser)
        self._script = script
        self._effects = EpisodeEffects(self._browser, self._password)
        before = self._inject(script.plan(BEFORE), BEFORE)
        observation = self._observe(observation, is_old=before)
        self._is_running = True
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take an action, in pixels of the screenshot that the agent sees.

        Raises:
            ResetNeeded: There was no `reset`, it or an earlier step has failed, or the episode is
                over.
            EffectError: An effect does not hold; the episode is over.
        """
        if not self._is_running or self._browser is None:
            raise ResetNeeded(
                "the corrupted episode has not begun, has failed or is over: call reset"
            )
        self._is_running = False  # in case of an error
        self._browser.acted = True
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._step += 1
        self._resize(observation)
        is_over = terminated or truncated
        observation = self._corrupt(observation) if is_over else self._observe(observation)
        self._is_running = not is_over
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Undo what was done, and close the environment."""
        self._end()
        self._base.action_mapping = self._map_action
        super().close()

    # Inside

    def _end(self) -> None:
        browser, self._browser, self._script = self._browser, None, None
        if self._effects is not None and browser is not None:
            self._effects.undo()
            browser.close()

    def _resize(self, observation: dict[str, Any]) -> None:
        """Follow the size of the pictures: BrowserGym enlarges those of some pages only."""
        size = _picture_size(observation)
        if self._browser is not None and self._script is not None and size != self._script.size:
            scale = float(getattr(self._base.page, "_bgym_scale_factor", 1.0))
            self._browser.resize(size, scale)
            self._script = replace(self._script, size=size)

    def _inject(self, plan: Plan, step: int) -> bool:
        """Apply the effects of a plan; return whether there were any.

        Raises:
            EffectError: One has no meaning here, or does not hold.
        """
        if self._effects is None or self._script is None:
            return False
        if not plan.effects and not self._effects.has_due():
            return False
        kinds = {effect.kind for effect in plan.effects}
        if "lock" in kinds and not self._pages_survive():
            raise EffectError(
                "verification loads the page again, and the pages of this task lose their state"
                " then; if they do not, say survives_reload=True"
            )
        problem = self._effects.inject(plan.effects, self._script, step)
        if problem:
            raise EffectError(problem)
        return True

    def _pages_survive(self) -> bool:
        """Return whether the pages of the task may be loaded again.

        Raises:
            ParameterError: That is not known.
        """
        if self._survives_reload is not None:
            return self._survives_reload
        module = type(self._base.task).__module__
        for package, survives in _SURVIVES_RELOAD.items():
            if module == package or module.startswith(f"{package}."):
                return survives
        raise ParameterError(
            f"whether the pages of {module} may be loaded again is not known: give corrupt"
            " survives_reload=True or False"
        )

    def _observe(self, observation: dict[str, Any], *, is_old: bool = False) -> dict[str, Any]:
        """Apply the effects that are due now, and return the observation of what is there then.

        Raises:
            EffectError: One does not hold.
        """
        script = self._script
        if script is None or self._effects is None:
            return observation
        if self._effects.end_due(self._step) or is_old:
            observation = self._look()
        self._effects.refresh()
        if self._inject(script.plan(self._step, _element_boxes(observation)), self._step):
            observation = self._look()
        problem = self._effects.confirm()
        if problem:
            raise EffectError(problem)
        return self._corrupt(observation)

    def _look(self) -> dict[str, Any]:
        """Return a new observation, without asking the task's validator."""
        observation = self._base.post_step({}, validate=False)[0]
        self._resize(observation)
        return observation

    def _corrupt(self, observation: dict[str, Any]) -> dict[str, Any]:
        """Return the observation with the corrupted picture, and boxes in its pixels."""
        script = self._script
        if script is None:
            return observation
        plan = script.plan(self._step, _element_boxes(observation))
        self._digests.append(plan.to_data()["digest"])
        self._coords = plan.coords
        if not plan.ops:
            return observation
        properties = observation["extra_element_properties"]
        return {
            **observation,
            "screenshot": apply(plan, observation["screenshot"]),
            "extra_element_properties": {
                bid: {**element, "bbox": _map_box(element["bbox"], plan.coords)}
                for bid, element in properties.items()
            },
        }

    def _map_code(self, action: Any) -> str:
        """Return the code of an action, in pixels of the screen; BrowserGym reports errors of it.

        Raises:
            ActionError: A place in it cannot be mapped.
        """
        code = action if self._map_action is None else self._map_action(action)
        if self._coords is None or self._coords.is_identity:
            return code
        return map_code(code, self._coords)

    def _guard_validator(self) -> None:
        """Show the validator the task's own page while a page of ours is in front of it.

        A page of ours is no tab that the agent has opened, and some validators end the episode
        when the page in front is not the task's. What they cannot judge, such as an error page, is
        not done.
        """
        from playwright.sync_api import Error  # pyright: ignore[reportMissingImports]

        task, browser = self._base.task, cast("PlaywrightBrowser", self._browser)
        validate = task.validate

        def guarded(page: Any, messages: Any) -> tuple[float, bool, str, dict[str, Any]]:
            browser.tidy()
            behind = [open_page for open_page in browser.pages if not open_page.is_cover]
            if browser.front.is_cover and behind:
                page = cast("Any", behind[-1]).page
            try:
                return validate(page, messages)
            except Error as error:
                if self._effects is None or not self._effects.active:
                    raise
                return 0.0, False, "", {"error": f"the task cannot judge this page: {error}"}

        task.validate = guarded


def map_code(code: str, coords: CoordMap) -> str:
    """Return the Python code of a BrowserGym action with its places mapped to the screen.

    Args:
        code: What an action mapping returns: definitions of functions, and calls of them.
        coords: From the picture that the agent sees to the screen.

    Raises:
        ActionError: A call has places that are not known, or are no numbers.
    """
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError):
        return code  # BrowserGym reports it
    for statement in tree.body:
        # Definitions do nothing, and neither do settings that call nothing.
        if isinstance(statement, ast.FunctionDef) or not any(
            isinstance(node, ast.Call) for node in ast.walk(statement)
        ):
            continue
        call = statement.value if isinstance(statement, ast.Expr) else None
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
            raise ActionError(
                f"the places in {ast.unparse(statement)[:80]!r} cannot be mapped to the screen:"
                " under this corruption, actions are calls of BrowserGym's functions"
            )
        _map_call(call, coords)
    return ast.unparse(tree)


def _map_call(call: ast.Call, coords: CoordMap) -> None:
    """Map the places of a call.

    Raises:
        ActionError: The function is not known, or a place is no number.
    """
    name = cast("ast.Name", call.func).id
    if name in _OTHERS:
        return
    if name not in _POINTS:
        raise ActionError(f"the places of {name} cannot be mapped to the screen")
    names = [part for pair in _POINTS[name] for part in pair]
    nodes: dict[str, ast.expr] = dict(zip(names, call.args, strict=False))
    nodes |= {word.arg: word.value for word in call.keywords if word.arg in names}
    for pair in _POINTS[name]:
        try:
            x, y = (float(ast.literal_eval(nodes[part])) for part in pair)
        except (KeyError, ValueError, TypeError):
            raise ActionError(f"{name} takes numbers: {ast.unparse(call)[:80]}") from None
        is_distance = pair in _DISTANCES
        mapped = coords.vector_to_screen(x, y) if is_distance else coords.to_screen((x, y))
        for part, value in zip(pair, mapped, strict=True):
            nodes[part] = ast.Constant(value)
    order = [nodes.pop(part) for part in names[: len(call.args)]]
    call.args = [*order, *call.args[len(order) :]]
    call.keywords = [
        ast.keyword(word.arg, nodes.get(word.arg or "", word.value)) for word in call.keywords
    ]


def _check_wrappers(env: "gymnasium.Env[Any, Any]") -> None:
    """Refuse wrappers below the corruption, which asks BrowserGym for observations past them.

    Raises:
        ParameterError: There is one other than those of `gymnasium.make`.
    """
    while isinstance(env, gymnasium.Wrapper):
        if not isinstance(env, (OrderEnforcing, PassiveEnvChecker, TimeLimit)):
            name = type(cast("object", env)).__name__
            raise ParameterError(
                f"{name} wraps the environment, and observations after an effect would not pass"
                f" through it: put it around the corrupted environment, {name}(corrupt(env, ...))"
            )
        env = cast("gymnasium.Env[Any, Any]", env.env)


def _check(planner: Planner) -> None:
    """Refuse a corruption that does nothing in BrowserGym.

    Raises:
        MissingCapabilityError: It has effects that a browser does not have.
        ParameterError: It changes the agent's input.
    """
    if planner.inputs:
        raise ParameterError(
            f"{get_label(planner)} changes the agent's input, and BrowserGym sends that by its own"
            " functions: play it by hijack bench"
        )
    unknown = sorted(set(planner.effects) - PlaywrightBrowser.effects.keys())
    if unknown:
        raise MissingCapabilityError(
            f"{get_label(planner)} needs the effect {', '.join(unknown)}, which a browser does not"
            " have: play it by hijack bench on a desktop"
        )


def _picture_size(observation: dict[str, Any]) -> Size:
    """Return (height, width) of an observation's screenshot."""
    picture: UInt8Array = observation["screenshot"]
    return picture.shape[0], picture.shape[1]


def _element_boxes(observation: dict[str, Any]) -> BoxArray:
    """Return the boxes of the clickable elements in the picture, int32 `[N, 4]` `xyxy`."""
    height, width = observation["screenshot"].shape[:2]
    boxes: list[list[int]] = []
    for element in observation["extra_element_properties"].values():
        if not element["bbox"] or not element["clickable"]:
            continue
        x, y, w, h = element["bbox"]
        left, top = max(int(x), 0), max(int(y), 0)
        right, bottom = min(int(np.ceil(x + w)), width), min(int(np.ceil(y + h)), height)
        if left < right and top < bottom:
            boxes.append([left, top, right, bottom])
    return as_boxes(boxes)


def _map_box(box: list[float] | None, coords: CoordMap) -> list[float] | None:
    """Return a box `x, y, width, height` in pixels of the picture that the agent sees."""
    if not box:
        return box
    down, across = (
        picture_side / screen_side
        for picture_side, screen_side in zip(coords.observation, coords.screen, strict=True)
    )
    x, y, width, height = box
    return [x * across, y * down, width * across, height * down]


def _task_name(task: Any) -> str:
    """Return the name of a task in BrowserGym."""
    try:
        return str(task.get_task_id())
    except NotImplementedError:
        return type(task).__name__
