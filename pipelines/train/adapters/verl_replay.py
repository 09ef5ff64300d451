"""DA-GRPO's replay in verl: a stored success for a group whose rewards are all 0.

`configs/train/verl.yaml` names it (`trainer.v1.sampler.custom_sampler`). In verl, a replay buffer
is the place from which its v1 trainer takes finished groups; this class changes a group when it is
taken. It overrides a private method of verl 0.9.
"""

from collections import defaultdict
from typing import Any

from hijack_data import extras
from hijack_data.errors import ParameterError

from ..replay import ReplayBuffer
from ..rollouts import RolloutRequest
from ..sampler import Draw
from ..split import check_split
from .driven_episode import TokenRollout

transfer_queue: Any = extras.load("transfer_queue", "HijackReplay", "verl")
_module = extras.load("verl.trainer.ppo.v1.replay_buffer", "HijackReplay", "verl")
VerlBuffer: Any = _module.ReplayBuffer

TRAINING = "train"  # verl's name of the partition
_TAG_KEYS = ("status", "prompt_len", "response_len", "seq_len")
# The columns about the place of a row; all others belong to the rollout.
_IDENTITY_COLUMNS = ("uid", "session_id", "global_steps", "index")


class HijackReplay(VerlBuffer):
    """Verl's buffer, with our replay buffer behind it.

    `trainer.v1.sampler.sampler_kwargs` may have `capacity`, `when`, `slot` and `seed`, as
    `pipelines.train.replay.ReplayBuffer`, and `osworld_split`, as `check_split`. It is empty at
    the start of a resumed run.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        options = dict(self.sampler_kwargs or {})
        self.osworld_split = str(options.pop("osworld_split", "osworld"))
        unknown = sorted(options.keys() - {"capacity", "when", "slot", "seed"})
        if unknown:
            raise ParameterError(f"sampler_kwargs: unknown {', '.join(unknown)}")
        self.stored = ReplayBuffer(**options)

    def _materialize_batch(self, partition_id: str, *args: Any) -> Any:
        """Return the batch with stored successes inserted into groups that have none."""
        batch = super()._materialize_batch(partition_id, *args)
        if partition_id == TRAINING and batch.keys:
            self._replay(batch)
        return batch

    def _replay(self, batch: Any) -> None:
        rows = transfer_queue.kv_batch_get(keys=batch.keys, partition_id=TRAINING)
        groups: dict[str, list[int]] = defaultdict(list)
        for index, key in enumerate(batch.keys):
            groups[key.split("_")[0]].append(index)
        rollouts = [
            _rollout(rows[index], key, batch.tags[index]) for index, key in enumerate(batch.keys)
        ]
        check_split(
            (rollout.request.group for rollout in rollouts),
            source="the rows of data.train_files",
            osworld_split=self.osworld_split,
        )
        for indices in groups.values():
            group = [rollouts[index] for index in indices]
            rewards = [float(rows[index]["rm_scores"].sum()) for index in indices]
            filled = self.stored.fill(group, rewards, group[0].request.step)
            for index, old, new in zip(indices, group, filled, strict=True):
                if new is not old:
                    self._replace_rollout(batch, index, rows[index], new)
            for rollout in group:
                self.stored.add(rollout)

    def _replace_rollout(self, batch: Any, index: int, row: Any, stored: Any) -> None:
        """Replace the rollout at `index` by a stored one, keeping its group and number."""
        fields, tag = stored.tokens
        row_fields = fields.clone(recurse=False)
        for name in _IDENTITY_COLUMNS:
            if name in row.keys():  # noqa: SIM118  (of a TensorDict)
                row_fields[name] = row[name]
        batch.tags[index] = {**batch.tags[index], **tag}
        transfer_queue.kv_batch_put(
            keys=[batch.keys[index]],
            fields=row_fields.unsqueeze(0),
            tags=[batch.tags[index]],
            partition_id=TRAINING,
        )


def _rollout(row: Any, key: str, tag: Any) -> TokenRollout:
    about = row["extra_fields"]
    about = getattr(about, "data", about)
    facts = about["reward_extra_info"]
    request = RolloutRequest(
        step=int(tag["global_steps"]),
        group=str(facts["task"]),
        slot=int(key.split("_")[1]),
        seed=0,
        draw=Draw(label=str(facts["corruption"]), planner=None, key=key),
    )
    return TokenRollout(
        request=request,
        success=float(facts["success"]),
        is_well_formed=bool(facts["well_formed"]),
        tokens=(row, {name: tag[name] for name in _TAG_KEYS if name in tag}),
    )
