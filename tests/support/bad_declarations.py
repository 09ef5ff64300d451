"""Bad corruptions that are wrong by what they declare; see `support.bad_plugins`."""

LEVELS = "severities: ClassVar[Any] = ({{}}, {{}}, {third}, {{}}, {fifth})"
NAME = 'name: ClassVar[str] = "{}"'
WORDS = ("clean", "all", "one_of", "sequence", "schedule", "as", "severity", "none", "true", "on")

PARAMETERS = {
    "no ranges": ("is accepted", {"methods": "def __post_init__(self): pass"}),
    "any parameter": (
        "unknown parameter is accepted",
        {"methods": "def replace(self, **changes): return self"},
    ),
    "lossy parameters": (
        "does not give",
        {
            "about": LEVELS.format(third="{}", fifth="{'half': 7}"),
            "methods": "def params(self): return {}",
        },
    ),
    "a level out of range": (
        "bar.half must be",
        {"about": LEVELS.format(third="{}", fifth="{'half': 100}")},
    ),
    "a level of the wrong type": (
        "bar.half must be",
        {"about": LEVELS.format(third="{}", fifth="{'half': 'large'}")},
    ),
}

REGISTERED = {
    "another id": (
        "unknown corruption 'rab-v1'",
        {"methods": "@property\ndef id(self): return 'rab-v1'"},
    ),
    "no documentation of a parameter": (
        "half has no documentation",
        {"fields": 'half: int = param(9, "", low=1, high=99)'},
    ),
}

REFUSED = {
    "no docstring": ("has no docstring", {"doc": ""}),
    "no name": ("name is not set", {"name": ""}),
    "no scope": ("scope is not set", {"scope": ""}),
    "no category": ("category is not set", {"category": ""}),
    "a scope that there is not": (
        "scope 'obs' does not exist; known: action, observation, state, transition",
        {"scope": 'scope: ClassVar[str] = "obs"'},
    ),
    "a scope with a slip": (
        "did you mean 'observation'",
        {"scope": 'scope: ClassVar[str] = "observations"'},
    ),
    "a state that names no effects": (
        "effects is not set; name what its plans may hold, such as effects: ClassVar",
        {"scope": 'scope: ClassVar[str] = "state"'},
    ),
    "an observation with effects": (
        "scope 'observation' has no effects on the machine",
        {"about": 'effects: ClassVar[tuple[str, ...]] = ("lock",)'},
    ),
    "effects as one text": (
        "effects must be a tuple of kinds",
        {"scope": 'scope: ClassVar[str] = "state"\neffects: ClassVar[Any] = "lock"'},
    ),
    "a category that there is not": (
        "did you mean 'visual_disruptor'",
        {"category": 'category: ClassVar[str] = "visual_disrupter"'},
    ),
    "a name with spaces": ("must be 1 to 64", {"name": 'name: ClassVar[str] = "Bad Name+v-v2"'}),
    "a name with capitals": ("must be 1 to 64", {"name": 'name: ClassVar[str] = "Bar"'}),
    "a name with a dash": ("must be 1 to 64", {"name": 'name: ClassVar[str] = "a-v2"'}),
    "a name with a digit first": ("must be 1 to 64", {"name": 'name: ClassVar[str] = "2bar"'}),
    "a name that is too long": ("must be 1 to 64", {"name": f'name: ClassVar[str] = "{"a" * 65}"'}),
    "a number as a name": ("must be 1 to 64", {"name": "name: ClassVar[Any] = 5"}),
    **{f"the name {word}": ("means something else", {"name": NAME.format(word)}) for word in WORDS},
    "the name of another": ("'marks' is taken by hijack_data", {"name": NAME.format("marks")}),
    "a plain field": ("'more' is not declared with param", {"methods": "more: int = 3"}),
    "a plain field with a factory": (
        "'more' is not declared with param",
        {"methods": "more: list = field(default_factory=list)"},
    ),
    "a field that is not given": (
        "'more' is not declared with param",
        {"methods": "more: int = field(default=3, init=False)"},
    ),
    "a field for the start alone": (
        "'more' is not declared with param",
        {
            "methods": (
                "more: InitVar[int] = 3\n"  # two lines of the class
                "def __post_init__(self, more): super().__post_init__()"
            )
        },
    ),
    "a field in the place of a class variable": (
        "write scope: ClassVar",
        {"scope": 'scope: str = "observation"'},
    ),
    "a parameter named severity": (
        "words of the configuration",
        {"methods": 'severity: int = param(3, "How bad")'},
    ),
    "a parameter named like a method": (
        "'plan' is an attribute of every corruption",
        {"methods": 'plan: int = param(3, "How bad")'},
    ),
    "a default out of range": (
        "bar.half must be int in",
        {"fields": 'half: int = param(0, "Radius in pixels", low=1, high=99)'},
    ),
    "a default of NumPy": (
        "not JSON serializable",
        {"fields": 'half: int = param(np.int64(9), "Radius", kind="int", low=1, high=99)'},
    ),
    "a start that raises": ("ZeroDivisionError", {"methods": "def __post_init__(self): 1 // 0"}),
    "four levels": ("must hold 5 entries", {"about": "severities: ClassVar[Any] = ({},) * 4"}),
    "levels as a number": ("must be a tuple", {"about": "severities: ClassVar[Any] = 5"}),
    "a third level that is not empty": (
        "level 3 is the paper's default and must be empty",
        {"about": LEVELS.format(third="{'half': 7}", fifth="{}")},
    ),
    "a level with an unknown parameter": (
        "level 5 sets 'hafl', which is not a parameter; did you mean 'half'",
        {"about": LEVELS.format(third="{}", fifth="{'hafl': 7}")},
    ),
    "a level that is no mapping": (
        "level 5 must be a mapping",
        {"about": LEVELS.format(third="{}", fifth="7")},
    ),
    "version 0": ("version must be", {"about": "version: ClassVar[int] = 0"}),
    "a version as text": ("version must be", {"about": 'version: ClassVar[str] = "2"'}),
    "a version that is true": ("version must be", {"about": "version: ClassVar[int] = True"}),
    "no dataclass": ("must be a frozen dataclass", {"decorators": "@register"}),
    "the decorators in the wrong order": (
        "must be a frozen dataclass",
        {"decorators": "@dataclass(frozen=True)\n@register"},
    ),
}
