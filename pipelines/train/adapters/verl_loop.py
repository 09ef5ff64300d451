"""Our environments as an agent loop of verl, which plays one episode.

`configs/train/verl_agent.yaml` registers it with verl (`rollout.agent.agent_loop_config_path`), and
rows of `verl_rows.write_rows` name it. Written for verl 0.9 with its v1 trainer.
"""

import asyncio
import atexit
import inspect
from collections.abc import Mapping, Sequence
from typing import Any
from uuid import uuid4

from hijack_data import extras
from hijack_data.compose import OneOf
from hijack_data.config import load_config
from hijack_data.errors import ParameterError, suggest
from hijack_data.loading import load_reference
from hijack_data.plan import CLEAN
from hijack_data.planner import Planner
from hijack_data.rng import Stream

from ..rollouts import AgentObservation, RolloutRequest
from ..sampler import CorruptionSampler, Draw
from .driven_episode import DrivenEpisode, TokenRollout, screenshot_image

_agents = extras.load("verl.experimental.agent_loop.agent_loop", "HijackLoop", "verl")
AgentLoopBase: Any = _agents.AgentLoopBase
simple_timer: Any = extras.load("verl.utils.profiler", "HijackLoop", "verl").simple_timer
OmegaConf: Any = extras.load("omegaconf", "HijackLoop", "verl").OmegaConf

_idle: dict[str, list[DrivenEpisode]] = {}  # idle environments by their maker, for later episodes


class HijackLoop(AgentLoopBase):
    """Plays an episode. The whole text of an answer is read as actions; there is no tool call.

    A row brings `raw_prompt` (how to answer) and `extra_info` with `task`, and maybe `seed` and
    `corruption`: `clean`, or the name of one, in place of a draw.

    Args:
        *args: of verl.
        environment: `package.module:make` or `path/to/file.py:make`, a function that makes an
            environment with the interface of `CorruptedEnv`. The environment is made for the first
            episode that needs it, and kept for later ones.
        environment_args: arguments of `make`.
        dialect: what the model writes, see `DrivenEpisode`: `ui_tars_1.5` for UI-TARS-1.5. By
            default the text that the environment takes.
        corruptions: as the list `corruptions` of a configuration; none of them plays clean.
        per: the unit for which a corruption is drawn, see `CorruptionSampler`.
        seed: of the draws and of the environments' seeds.
        max_steps: the most answers of an episode.
        format_weight: the penalty of an answer in the wrong form.
        **kwargs: of verl.

    Raises:
        ParameterError: verl's configuration of the loop has a key that is none of these.
    """

    def __init__(
        self,
        *args: Any,
        environment: str,
        environment_args: Mapping[str, Any] | None = None,
        dialect: str | None = None,
        corruptions: Sequence[Any] = (),
        per: str = "rollout",
        seed: int = 0,
        max_steps: int = 10,
        format_weight: float = 1.0,
        **kwargs: Any,
    ) -> None:
        _check_keys(kwargs)
        super().__init__(*args, **kwargs)
        self.environment = environment
        self.environment_args = _plain(environment_args or {})
        self.dialect = dialect
        self.sampler = CorruptionSampler(make_planner(_plain(corruptions)), per=per, seed=seed)
        self.seed = seed
        self.max_steps = max_steps
        self.format_weight = format_weight

    async def run(self, sampling_params: dict[str, Any], **kwargs: Any) -> Any:
        """Play one episode; return an `AgentLoopOutput`, or `[]` to leave it out of its group.

        Raises:
            ParameterError: the row has no task, or the trainer is not v1.
            UnknownNameError: the environment does not know the task.
        """
        request = self._request(kwargs)
        key, episode = self._take_idle()
        try:
            output = await self._play(episode, request, list(kwargs["raw_prompt"]), sampling_params)
        finally:
            _idle.setdefault(key, []).append(episode)
        return [] if output is None else output

    async def _play(
        self,
        episode: DrivenEpisode,
        request: RolloutRequest,
        messages: list[dict[str, Any]],
        sampling_params: dict[str, Any],
    ) -> Any:
        metrics: dict[str, Any] = {}
        with simple_timer("tool_calls", metrics):
            observation = await self._in_thread(episode.reset, request)
        if observation is None:
            rollout = await self._in_thread(episode.finish)
            return self._report_left_out(rollout)
        messages.append(_message(observation, observation["instruction"]))
        pictures = [messages[-1]["content"][0]["image"]]
        self._assert_mm_supported(True)
        ids = await self.ct_build_initial_tokens(messages, images=pictures)
        prompt = len(ids)
        mask: list[int] = []
        logprobs: list[float] = []
        server = uuid4().hex
        for _ in range(self.max_steps):
            with simple_timer("generate_sequences", metrics):
                answer = await self.server_manager.generate(
                    request_id=server,
                    prompt_ids=ids,
                    sampling_params=sampling_params,
                    image_data=pictures,
                )
            merged, mask, new = await self.ct_merge_assistant_token(
                ids,
                answer.token_ids,
                mask,
                logprobs if answer.log_probs else None,
                assistant_logprobs=answer.log_probs,
            )
            ids = merged.token_ids
            logprobs = new or []
            text = self.tokenizer.decode(answer.token_ids, skip_special_tokens=True)
            messages.append({"role": "assistant", "content": text})
            with simple_timer("tool_calls", metrics):
                observation = await self._in_thread(episode.step, text)
            if observation is None or len(mask) >= self.rollout_config.response_length:
                break
            message = _message(observation)
            merged, longer, new = await self.ct_merge_context_msg(
                messages, [*messages, message], ids, mask, logprobs or None
            )
            # checked before the picture is kept, because verl fails if pictures and their tokens
            # disagree
            if len(longer) >= self.rollout_config.response_length:
                break
            ids = merged.token_ids
            mask = longer
            logprobs = new or []
            messages.append(message)
            pictures.append(message["content"][0]["image"])
        rollout = await self._in_thread(episode.finish)
        total = rollout.reward(self.format_weight)
        if total is None:
            return self._report_left_out(rollout)
        end = self.rollout_config.response_length  # only text is cut, since pictures were checked
        return _agents.AgentLoopOutput(
            prompt_ids=ids[:prompt],
            response_ids=ids[prompt:][:end],
            response_mask=mask[:end],
            response_logprobs=logprobs[:end] or None,
            multi_modal_data={"images": pictures},
            reward_score=total,
            num_turns=2 * rollout.answers,
            metrics=_agents.AgentLoopMetrics(**metrics),
            extra_fields={"reward_extra_info": _facts(rollout)},
        )

    def _report_left_out(self, rollout: TokenRollout) -> None:
        request = rollout.request
        print(
            f"step {request.step}: {request.group}, rollout {request.slot} is left out:"
            f" {rollout.status}, {rollout.problem}",
            flush=True,
        )

    def _request(self, row: Mapping[str, Any]) -> RolloutRequest:
        about = row.get("extra_info") or {}
        if not about.get("task"):
            raise ParameterError("a row without extra_info.task; verl_rows.write_rows writes rows")
        if "session_id" not in row or "global_steps" not in row:
            raise ParameterError(
                "verl gave neither session_id nor global_steps: set trainer.use_v1=True, since the"
                " draw of a rollout needs its place in the group and the step"
            )
        task = str(about["task"])
        step = int(row["global_steps"])
        slot = int(row["session_id"])
        stream = Stream(self.seed, "environment_seed-v1", task, step)
        seed = about.get("seed")
        draw = self.sampler.draw(step=step, group=task, slot=slot)
        fixed = about.get("corruption")
        if fixed:
            planner = None if fixed == CLEAN else make_planner([fixed])
            draw = Draw(label=str(fixed), planner=planner, key="row")
        return RolloutRequest(
            step=step,
            group=task,
            slot=slot,
            seed=stream.integer(0, 2**32 - 1) if seed is None else int(seed),
            draw=draw,
        )

    def _take_idle(self) -> tuple[str, DrivenEpisode]:
        """Return an idle environment, and the key for giving it back."""
        key = f"{self.environment} {sorted(self.environment_args.items())} {self.dialect}"
        idle = _idle.setdefault(key, [])
        if idle:
            return key, idle.pop()
        make = load_reference(self.environment)
        arguments = self.environment_args
        return key, DrivenEpisode(lambda: make(**arguments), self.dialect)

    async def _in_thread(self, function: Any, *args: Any) -> Any:
        """Call a blocking function in a thread, so that the worker's other episodes continue."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(None, function, *args)


def _check_keys(kwargs: Mapping[str, Any]) -> None:
    """Check that no key of the loop's configuration is left for verl's base class.

    That class would ignore it. verl itself gives its arguments, and objects; a file's are plain.

    Raises:
        ParameterError: there is such a key.
    """
    names = [name for name in inspect.signature(HijackLoop.__init__).parameters if name != "self"]
    of_verl = {"name", *inspect.signature(AgentLoopBase.__init__).parameters}
    for key in kwargs.keys() - of_verl:
        value = kwargs[key]
        if isinstance(value, bool | int | float | str | list | dict) or OmegaConf.is_config(value):
            raise ParameterError(
                f"the agent loop's configuration has the key {key!r}, which means"
                f" nothing{suggest(key, names)}"
            )


def make_planner(corruptions: Sequence[Any]) -> Planner | None:
    """Return a planner that draws one of `corruptions` with equal odds; `None` without any.

    Args:
        corruptions: as the list `corruptions` of a configuration.

    Raises:
        ConfigError: an unknown corruption or parameter.
    """
    if not corruptions:
        return None
    planners = list(load_config({"corruptions": list(corruptions)}).corruptions.values())
    return planners[0] if len(planners) == 1 else OneOf(planners)


def close_idle() -> None:
    """Close the idle environments."""
    for episodes in _idle.values():
        for episode in episodes:
            episode.close()
    _idle.clear()


def _facts(rollout: TokenRollout) -> dict[str, Any]:
    """Return the data that verl keeps with the reward; every rollout has the same keys."""
    return {
        "task": rollout.request.group,
        "corruption": rollout.request.draw.label,
        "success": rollout.success,
        "well_formed": rollout.is_well_formed,
    }


def _message(observation: AgentObservation, text: str = "") -> dict[str, Any]:
    content: list[dict[str, Any]] = [{"type": "image", "image": screenshot_image(observation)}]
    if text:
        content.append({"type": "text", "text": text})
    return {"role": "user", "content": content}


def _plain(value: Any) -> Any:
    return OmegaConf.to_container(value) if OmegaConf.is_config(value) else value


atexit.register(close_idle)
