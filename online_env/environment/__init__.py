"""The live environment: a desktop with a task, under a corruption, as a gymnasium environment.

env = CorruptedEnv(SmallTasks(desktop), corruption="subtitle")
obs, _ = env.reset(seed=0, options={"task": "write_note"})
obs, reward, terminated, truncated, _ = env.step("pyautogui.click(100, 200)")
env.record                       # after the end: what really happened; not for the agent
"""

from .. import extra

try:
    from .core import CorruptedEnv
    from .registration import EMBEDDED_ID, register_envs
    from .settings import EvalSettings
    from .settle import Settle
    from .stage import OsworldStage, Setting, SmallTasks, Stage
except ModuleNotFoundError as error:
    raise extra.import_error(error, "the live environment") from None

__all__ = [
    "EMBEDDED_ID",
    "CorruptedEnv",
    "EvalSettings",
    "OsworldStage",
    "Setting",
    "Settle",
    "SmallTasks",
    "Stage",
    "register_envs",
]
