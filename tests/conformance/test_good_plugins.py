"""Good plug-ins of all kinds pass every check, without a note where none is due."""

import pytest

from hijack_data import conformance
from hijack_data.conformance import fresh_processes

from support.bad_declarations import LEVELS

NEEDS = "@property\ndef needs_elements(self): return True"
HALF = 'half: int = hj.param(9, "Radius", low=1)'
LOCKS = 'effects: ClassVar[tuple[str, ...]] = ("lock",)'
LOCK = 'hj.Draft(effects=(hj.Effect("lock", {}),))'
GOOD = {
    "a disc": {},
    "a disc that speaks at import": {"top": "print('hello', file=sys.stderr)\nprint('hello')"},
    "five severities": {"about": LEVELS.format(third="{}", fifth="{'half': 99}")},
    "a disc that is never drawn by chance": {"chance": "x = y = 5"},
    "a fixed disc": {"code": "", "draft": "hj.Draft((hj.Paste(recipe, ((5, 5),)),))"},
    "a generator of its own, seeded by the stream": {
        "code": "x = int(np.random.default_rng(stream.word()).integers(900))"
    },
    "a sorted set": {"code": "x = len(sorted({'red', 'yellow', 'blue'})[stream.integer(0, 2)])"},
    "a memo of what never changes": {
        "top": "@functools.lru_cache\ndef half_of(size):\n    return size[0] // 2",
        "code": "y = half_of(scene.size)",
    },
    "something worked out once": {
        "methods": "@functools.cached_property\ndef double(self): return 2 * self.half",
        "code": "size = self.double",
    },
    "pixels of its own": {
        "recipe": "hj.png_recipe(np.full((9, 9, 4), (0, 255, 0, 200), np.uint8))"
    },
    "a smaller screen": {
        "draft": "hj.Draft((hj.Resample((max(1, height // 2), max(1, width // 2))),))",
        "code": "x = 0",
    },
    "the first box": {
        "methods": NEEDS,
        "code": "x = int(scene.boxes[0][0]) if len(scene.boxes) else 0",
    },
    "the target": {"code": "x = scene.target[0] if scene.target else 0"},
    "a copy of the boxes": {
        "methods": NEEDS,
        "code": "b = scene.boxes.copy(); b.sort(axis=0); x = int(b[0][0]) if len(b) else 0",
    },
    "nothing, and says so": {"draft": 'hj.Draft(notes=("nothing to draw",))'},
    "a state": {"scope": f'scope: ClassVar[str] = "state"\n{LOCKS}', "draft": LOCK},
    "a transition": {
        "scope": f'scope: ClassVar[str] = "transition"\n{LOCKS}',
        "fields": f'{HALF}\nstep: Any = hj.param(3, "When", kind="steps", low=0)',
        "draft": LOCK,
    },
    "a screen that is too small": {
        "code": "if width < 300:\n    raise hj.errors.ParameterError('bar needs a wider screen')",
        "top": "import hijack_data.errors",
    },
}
# A note is right here: what they draw decides nothing, as the effect has no parameters.
DRAWS_IN_VAIN = {
    "a fixed disc",
    "a smaller screen",
    "nothing, and says so",
    "a state",
    "a transition",
}


@pytest.mark.parametrize("kind", GOOD)
def test_it_passes(kind, load, monkeypatch):
    monkeypatch.setattr(conformance.cases, "SIZES", ((1080, 1920), (333, 517), (64, 48), (1, 1)))
    monkeypatch.setattr(
        fresh_processes, "PROCESS_ENVIRONMENTS", fresh_processes.PROCESS_ENVIRONMENTS[:2]
    )  # more of them catch the bad
    results = conformance.run(load(**GOOD[kind]))
    assert [result.check for result in results] == [c.__name__[6:] for c in conformance.CHECKS]
    assert {result.check: result.problem for result in results if result.problem} == {}
    noted = {result.check for result in results if result.notes}
    assert noted == ({"seed"} if kind in DRAWS_IN_VAIN else set())
