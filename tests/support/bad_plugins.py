"""Every way to write a bad corruption that we know of, by the check that must find it.

A kind is `(words of the problem, slots)`, see `support.plugins`, or slots alone where all kinds of
a check are told in the same words. `load` means that the class is refused when it is registered.
"""

from support.bad_declarations import LEVELS, PARAMETERS, REFUSED, REGISTERED

EFFECT = 'Draft(effects=(Effect("lock", {}),))'
DECLARED = 'effects: ClassVar[tuple[str, ...]] = ("lock", "touch", "x")'
STATE = {"scope": f'scope: ClassVar[str] = "state"\n{DECLARED}', "draft": EFFECT}
TRANSITION = {"scope": f'scope: ClassVar[str] = "transition"\n{DECLARED}'}
AT = "Draft(ops=(Paste(recipe, {}),))"
HALF = 'half: int = param(9, "Radius", low=1, high=99)'
RECIPE = 'RECIPE = {"draw": "mark", "shape": "circle", "size": 9, "color": "red"}'
LOOK = {"font": "DejaVuSans", "size": 20, "color": "red", "edge_color": "red", "edge": 0}
ONCE = """
@functools.lru_cache
def once(name):
    return STREAM[0].integer(0, 99)
STREAM = []
"""
NEEDS = "@property\ndef needs_elements(self): return True"

RANDOM = {
    "Python's generator": {"code": "x = random.randint(0, 9)"},
    "Python's generator, shuffled": {"code": "p = [1, 2, 3, 4, 5]; random.shuffle(p); x = p[0]"},
    "NumPy's legacy generator": {"code": "x = int(np.random.randint(99))"},
    "Python's generator, seeded": {"code": "random.seed(5); x = random.randint(0, 9)"},
    "NumPy's legacy generator, seeded": {
        "code": "np.random.seed(5); x = int(np.random.randint(99))"
    },
    "a fresh NumPy generator": {"code": "x = int(np.random.default_rng().integers(999))"},
    "a fresh Python generator": {"code": "x = random.Random().randint(0, 999)"},
    "the system's generator": {"code": "x = random.SystemRandom().randint(0, 999)"},
    "urandom": {"code": "x = int.from_bytes(os.urandom(2), 'big')"},
    "secrets": {"code": "x = secrets.randbelow(999)"},
    "a uuid": {"code": "x = uuid.uuid4().int % 999"},
    "the clock": {"code": "x = time.time_ns() % 997"},
    "a stopwatch": {"code": "x = time.perf_counter_ns() % 997"},
    "the processor's time": {"code": "x = time.process_time_ns() % 997"},
    "a counter": {"top": "COUNT = itertools.count()", "code": "x = next(COUNT)"},
    "a counter in the class": {
        "about": "made: ClassVar[list] = []",
        "code": "self.made.append(1); x = len(self.made)",
    },
    "a counter in itself": {
        "code": "object.__setattr__(self, 'seen', getattr(self, 'seen', 0) + 1); x = self.seen"
    },
    "the last place": {"top": "LAST = [0]", "code": "x, LAST[0] = LAST[0], x"},
    "what it saw before": {"top": "SEEN = set()", "code": "SEEN.add(x); x = len(SEEN)"},
    "a temporary name": {"code": "x = len(tempfile.mktemp()) + sum(map(ord, tempfile.mktemp()))"},
    "the order of epochs": {
        "top": "LATEST = [0]",
        "methods": (
            "def plan(self, scene, *, epoch=0, **key):\n"
            "    LATEST[0] = max(LATEST[0], epoch)\n"
            "    return super().plan(scene, epoch=LATEST[0], **key)"
        ),
    },
    "how many of it there are": {
        "top": "MADE = []",
        "methods": (
            "def __post_init__(self):\n"
            "    super().__post_init__()\n"
            "    MADE.append(1)\n"
            "    object.__setattr__(self, 'number', len(MADE))"
        ),
        "code": "x = self.number",
    },
}

PROCESS = {
    "the process": {"code": "x = os.getpid() % 997"},
    "its parent": {"code": "x = os.getppid() % 997"},
    "hash() of a text": {"code": "x = hash('abc') % 997"},
    "hash() of itself": {"code": "x = hash((self.name, self.half)) % 997"},
    "the order of a set": {"code": "x = len(list({'red', 'yellow', 'blue', 'green'})[0])"},
    "the order of a small set": {"code": "x = len(next(iter({'red', 'blue'})))"},
    "an address": {"top": "THING = object()", "code": "x = id(THING) // 16 % 997"},
    "the folder": {"code": "x = len(os.getcwd())"},
    "a file in the folder": {"code": "x = len(os.listdir('.'))"},
    "the time zone": {"code": "x = abs(time.localtime().tm_gmtoff) // 60"},
    "the date": {"code": "x = time.localtime().tm_yday"},
    "a draw at import": {"top": "START = random.random()", "code": "x = int(START * 999)"},
    "the time of import": {"top": "START = time.time_ns()", "code": "x = START % 997"},
    "the hash seed": {"code": "x = int(os.environ.get('PYTHONHASHSEED', '99'))"},
    "a memo by size": {"top": "MEMO = {}", "code": "x, y = MEMO.setdefault(scene.size, (x, y))"},
    "a memo by parameters": {
        "top": "MEMO = {}",
        "code": "x, y = MEMO.setdefault(self.half, (x % 90, y % 90))",
    },
    "a memo of the first stream": {
        "top": ONCE,
        "code": "STREAM.append(stream); x = once(self.name)",
    },
}

DATA = {
    "NumPy's integer": ("JSON", {"code": "size = np.int64(9)"}),
    "NumPy's float": ("JSON", {"code": "size = np.float32(9)"}),
    "a tuple in a recipe": ("tuples", {"recipe": "{**RECIPE, 'more': (1, 2)}"}),
    "a set": ("JSON", {"draft": 'Draft(effects=(Effect("x", {"a": {1, 2}}),))'}),
    "not a number": ("JSON", {"draft": 'Draft(effects=(Effect("x", {"a": math.nan}),))'}),
    "infinity": ("JSON", {"draft": 'Draft(effects=(Effect("x", {"a": math.inf}),))'}),
    "bytes": ("JSON", {"recipe": "{**RECIPE, 'more': b'x'}"}),
    "an object": ("JSON", {"recipe": "{**RECIPE, 'more': object()}"}),
    "a number as a key": (
        "tuples|keys must be strings",
        {"draft": 'Draft(effects=(Effect("x", {1: 2}),))'},
    ),
    "a place far away": ("pixel coordinates", {"draft": AT.format("((2**21, 0),)")}),
    "a place with a fraction": ("pixel coordinates", {"draft": AT.format("((x + 0.5, y),)")}),
    "a place of NumPy": ("JSON", {"draft": AT.format("((np.int64(x), y),)")}),
    "a place as a list": ("tuples", {"draft": AT.format("([x, y],)")}),
    "places as a list": ("tuples|must be a tuple", {"draft": AT.format("[(x, y)]")}),
    "a place of three": ("too many values|pixel coordinates", {"draft": AT.format("((x, y, 0),)")}),
    "operations as a list": (
        "tuples|must be a tuple",
        {"draft": "Draft(ops=[Paste(recipe, ((x, y),))])"},
    ),
    "operations as data": (
        "no attribute 'to_data'|must be a Paste",
        {"draft": "Draft(ops=(recipe,))"},
    ),
    "effects as a list": (
        "tuples|must be a tuple",
        {**STATE, "draft": 'Draft(effects=[Effect("lock", {})])'},
    ),
    "effects as data": (
        "no attribute 'to_data'|must be an Effect",
        {**STATE, "draft": 'Draft(effects=({"effect": "lock"},))'},
    ),
    "a note as text": ("can only concatenate tuple", {"draft": 'Draft(notes="nothing")'}),
    "a number as a note": ("tuples|must be a string", {"draft": "Draft(notes=(5,))"}),
    "a note of NumPy": ("JSON|must be a string", {"draft": "Draft(notes=(np.int64(5),))"}),
    "no plan": ("NoneType", {"draft": "None"}),
    "operations only": ("no attribute", {"draft": "(Paste(recipe, ((x, y),)),)"}),
    "an unknown drawing": ("not a known drawing", {"recipe": '{"draw": "blob"}'}),
    "half a recipe": ("cannot be drawn|has no field", {"recipe": '{"draw": "mark"}'}),
    "a sprite of no size": ("a sprite of 0x0 pixels", {"code": "size = 0"}),
    "a picture of no size": ("size must be at least", {"draft": "Draft(ops=(Resample((0, 9)),))"}),
    "a size with a fraction": ("two integers", {"draft": "Draft(ops=(Resample((9.5, 9)),))"}),
    "an exception": ("ZeroDivisionError", {"code": "1 // 0"}),
    "an assertion": ("AssertionError: no", {"code": "raise AssertionError('no')"}),
    "the end of the program": ("SystemExit", {"code": "raise SystemExit(3)"}),
    "an error at its worst": (
        "OverflowError",
        {
            "about": LEVELS.format(third="{}", fifth="{'half': 99}"),
            "code": "size > 50 and math.exp(999)",
        },
    ),
    "a screen that must be larger": ("must fit", {"code": "stream.integer(3000, width)"}),
}
for _words, _slots in DATA.values():
    _slots.setdefault("top", RECIPE)

SCENES = {
    "the first box": ("without boxes", {"methods": NEEDS, "code": "x = int(scene.boxes[0][0])"}),
    "the largest box": (
        "without boxes",
        {"methods": NEEDS, "code": "x = max(scene.boxes.tolist())[0]"},
    ),
    "the last obstacle": (
        "of which only the size|without boxes",
        {"methods": NEEDS, "code": "x = int(scene.obstacles[-1][0])"},
    ),
    "the target": ("without a target", {"code": "x = scene.target[0]"}),
    "the first app": ("without apps", {"code": "x = len(scene.apps[0])"}),
    "the middle of the target on the screen": (
        "target hangs over the edge",
        {"code": "x = math.isqrt(scene.target[0]) if scene.target else 0"},
    ),
    "landscape": ("in portrait", {"code": "x = [0] * (width - height + 1); x = len(x) // len(x)"}),
    "more than a pixel": ("1x1", {"code": "x = 9 // (width - 1)"}),
    "more than a line": ("1x1", {"code": "x = 9 // (height - 1)"}),
    "a large screen": ("1x1", {"code": "np.zeros((height - 1, width - 9))"}),
}

TOUCHED = {
    "sorted boxes": ("scene.boxes", {"code": "scene.boxes.sort(axis=0)"}),
    "clipped boxes": ("scene.boxes", {"code": "np.clip(scene.boxes, 0, 9999, out=scene.boxes)"}),
    "moved boxes": ("scene.boxes", {"code": "scene.boxes[:, 0] += 1"}),
    "other boxes": ("scene.boxes", {"code": "object.__setattr__(scene, 'boxes', scene.boxes[1:])"}),
    "another target": (
        "scene.target",
        {"code": "object.__setattr__(scene, 'target', (0, 0, 9, 9))"},
    ),
    "other apps": ("scene.apps", {"code": "object.__setattr__(scene, 'apps', ('x',))"}),
    "a note on the scene": (
        "attributes of scene",
        {"code": "object.__setattr__(scene, 'seen', True)"},
    ),
    "a parameter of its own": (
        "parameters of the corruption",
        {"code": "object.__setattr__(self, 'half', 7)"},
    ),
    "its severities": (
        "severities",
        {
            "about": LEVELS.format(third="{}", fifth="{'half': 5}"),
            "code": "self.severities[4]['half'] = 6",
        },
    ),
    "the environment": ("os.environ", {"code": "os.environ['BAR_X'] = str(x)"}),
    "the working directory": ("working directory", {"code": "os.chdir('/')"}),
}

KEPT = {
    "one recipe": {"top": RECIPE, "code": "RECIPE['size'] = 1 + x % 9", "recipe": "RECIPE"},
    "one list in a recipe": {
        "top": f"LINES = ['']\nLOOK = {LOOK}",
        "code": "LINES[0] = str(x)",
        "recipe": '{"draw": "text", "lines": LINES, **LOOK}',
    },
    "a recipe that grows": {"top": RECIPE, "code": "RECIPE[str(x)] = y", "recipe": "RECIPE"},
}

READ = "x = int(scene.boxes[0][0]) if len(scene.boxes) else 0"
ELEMENTS = {
    "a box": {"code": READ},
    "an obstacle": {"code": READ.replace("boxes", "obstacles")},
    "how many boxes there are": {"code": "x = len(scene.boxes)"},
    "a box, when asked to": {
        "fields": f'{HALF}\nnear: bool = param(False, "Draw at a box")',
        "code": f"if self.near: {READ}",
    },
    "a box, in one of its modes": {
        "fields": (
            'half: int = param(9, "Radius", low=1, high=99)\n'
            'where: str = param("any", "Where", choices=("any", "box"))'
        ),
        "code": f"if self.where == 'box': {READ}",
    },
    "a box, now and then": {"code": f"if x % 2: {READ}"},
    "boxes in a note": {
        "draft": 'Draft((Paste(recipe, ((x, y),)),), (), (f"{len(scene.boxes)} boxes",))'
    },
    "boxes in an effect": {
        **STATE,
        "draft": 'Draft(effects=(Effect("touch", {"boxes": scene.boxes.tolist()}),))',
    },
}

BOTH = 'Draft((Paste(recipe, ((x, y),)),), (Effect("lock", {}),))'
SOMETIMES = 'Draft((Paste(recipe, ((x, y),)),) if {} else (), (Effect("lock", {{}}),))'
SCOPES = {
    "state that draws": {**STATE, "draft": BOTH},
    "state that only draws": {**STATE, "draft": "Draft((Paste(recipe, ((x, y),)),))"},
    "transition that draws": {**TRANSITION, "draft": BOTH},
    "state that resizes": {**STATE, "draft": "Draft((Resample((9, 9)),))"},
    "state that draws at its worst": {
        **STATE,
        "about": LEVELS.format(third="{}", fifth="{'half': 99}"),
        "draft": SOMETIMES.format("size > 50"),
    },
    "state that draws on small screens": {**STATE, "draft": SOMETIMES.format("width < 600")},
    "state that draws now and then": {**STATE, "draft": SOMETIMES.format("x % 2")},
    "state with an effect that it does not declare": {
        **STATE,
        "draft": 'Draft(effects=(Effect("mute", {}),))',
    },
    "observation with an effect": {"draft": BOTH},
    "observation with only an effect": {"draft": EFFECT},
}

FIXED = "Draft(ops=(Paste(recipe, ((-900, 0),)),))"
VISIBLE = {
    "nothing": ("no note says why", {"draft": "Draft()"}),
    "all beside the screen": ("no note says why", {"draft": FIXED}),
    "a clear sprite": ("no note says why", {"recipe": "png_recipe(np.zeros((9, 9, 4), np.uint8))"}),
    "nothing at its mildest": (
        "no note says why",
        {
            "fields": 'half: int = param(9, "Radius", low=0, high=99)',
            "about": "severities: ClassVar[Any] = ({'half': 0}, {}, {}, {}, {})",
            "draft": "Draft(ops=(Paste(recipe, ((x, y),)),) if size else ())",
        },
    ),
    "a state without an effect": ("has no effect", {**STATE, "draft": "Draft()"}),
    "a transition without an effect": ("has no effect", {**TRANSITION, "draft": "Draft()"}),
}

BACKENDS = {
    "a foreign fingerprint": (
        "draws differently",
        {"draft": 'Draft(ops=(Paste(recipe, ((x, y),), "0" * 16),))'},
    )
}


LEVELS = {
    "that nothing uses": (
        "all severities do the same",
        {
            "about": "severities: ClassVar[Any] = tuple({'half': h} if h else {} for h in"
            " (3, 6, 0, 20, 40))",
            "code": "size = 9",
        },
    )
}


def catalogue() -> dict[str, tuple[str, str, dict[str, str]]]:
    """All kinds by name: the check that finds it, words of the problem (parted by |), slots."""
    entries: dict[str, tuple[str, str, dict[str, str]]] = {}
    for check, kinds in (
        ("deterministic", {k: ("generator|order|instance", v) for k, v in RANDOM.items()}),
        ("processes", {k: ("in a fresh process", v) for k, v in PROCESS.items()}),
        ("plan_is_data", DATA),
        ("scenes", SCENES),
        ("untouched", TOUCHED),
        ("kept", {k: ("a recipe", v) for k, v in KEPT.items()}),
        ("elements", {k: ("needs_elements is false", v) for k, v in ELEMENTS.items()}),
        (
            "scope",
            {
                k: ("with operations|with effects|with the effect 'mute'", v)
                for k, v in SCOPES.items()
            },
        ),
        ("visible", VISIBLE),
        ("levels", LEVELS),
        ("backends", BACKENDS),
        ("parameters", PARAMETERS),
        ("registered", REGISTERED),
        ("load", REFUSED),
    ):
        for kind, (words, slots) in kinds.items():
            entries[f"{check}: {kind}"] = (check, words, slots)
    return entries
