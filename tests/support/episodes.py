"""Episodes of `CorruptedEnv` on a desktop that is none."""

from online_env.environment import CorruptedEnv

from support.live import AT_ONCE, FakeStage

CLICK = "pyautogui.click(10, 20)"


def make(stage=None, **options):
    """An environment, and its stage."""
    stage = stage or FakeStage()
    return CorruptedEnv(stage, settle=AT_ONCE, **options), stage


def play(env, *actions, seed=0, **options):
    """An episode of these actions; returns what each step gave."""
    env.reset(seed=seed, options=options)
    return [env.step(action) for action in actions]
