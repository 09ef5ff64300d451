"""The shape of the public interface: names, signatures, and what importing costs."""

import ast
import importlib
import inspect
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import hijack_data as hj
import online_env
import pipelines

SIGNATURES = {
    "make_corruption": "(name: str, **values: Any) -> Corruption",
    "corruption_names": "(of: str = 'all') -> list[str]",
    "apply": (
        "(plan: Plan | Sequence[Plan] | PreparedPlans, image: Any, *, inplace: bool = False) -> Any"
    ),
}


@pytest.mark.parametrize("name", SIGNATURES)
def test_signatures(name):
    text = str(inspect.signature(getattr(hj, name))).replace("hijack_data.", "")
    for module in ("corruption.", "plan.", "prepared_plans.", "typing.", "collections.abc."):
        text = text.replace(module, "")
    assert text == SIGNATURES[name]


def test_plan_arguments_are_those_of_the_design():
    parameters = inspect.signature(hj.Marks().plan).parameters
    assert list(parameters) == ["scene", "seed", "sample", "step", "epoch"]
    assert parameters["seed"].kind is inspect.Parameter.KEYWORD_ONLY


def test_augmentation_arguments_are_those_of_the_design():
    parameters = inspect.signature(hj.OneOf([hj.Marks()]).__call__).parameters
    assert list(parameters) == [
        "batch",
        "ids",
        "boxes",
        "targets",
        "ends",
        "seed",
        "epoch",
        "steps",
    ]


def test_all_names_exist_and_are_documented():
    for name in hj.__all__:
        value = getattr(hj, name)
        assert inspect.getdoc(value), f"{name} has no docstring"


@pytest.mark.parametrize("package", [hj, pipelines])
def test_type_checkers_see_the_names_that_are_loaded(package):
    tree = ast.parse(Path(package.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    entries: dict[str, tuple[str, ...]] = {}
    homes = block.body
    if package is hj:
        plugin, *homes = homes
        assert ast.unparse(plugin) == "from . import plugin as plugin"
    for node in homes:
        entries[node.module] = entries.get(node.module, ()) + tuple(
            item.asname for item in node.names
        )
    prefix = f"{package.__name__}."
    assert entries == {home.removeprefix(prefix): names for home, names in package._HOMES.items()}
    assert all(getattr(package, name).__name__ == name for name in package.__all__)


def test_the_function_and_the_package_survive_pickling():
    import cloudpickle

    assert pickle.loads(pickle.dumps(hj.apply)) is hj.apply
    code = cloudpickle.dumps(lambda: hj.apply)  # as Ray sends a task: by the names of modules
    assert pickle.loads(code)() is hj.apply
    assert pickle.loads(cloudpickle.dumps(hj)) is hj


def test_importing_loads_nothing_heavy():
    heavy = (
        "torch",
        "jax",
        "cv2",
        "datasets",
        "numba",
        "rich",
        "click",
        "scipy",
        "pandas",
        "numpy",
    )
    code = f"import sys, hijack_data, pipelines; print([m for m in {heavy} if m in sys.modules])"
    stdout = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert stdout.strip() == "[]"


def python(code):
    """What `code` prints in a fresh interpreter."""
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()


def test_what_needs_only_errors_does_not_wait_for_numpy():
    assert python("import sys, hijack_data.errors; print('numpy' in sys.modules)") == "False"
    assert (
        python("import sys, hijack_data; hijack_data.Marks; print('numpy' in sys.modules)")
        == "True"
    )


@pytest.mark.parametrize(
    "first", ["import hijack_data._apply", "from hijack_data._apply import apply", "pass"]
)
def test_apply_is_the_function_whatever_was_imported_before(first):
    code = (
        f"{first}\nimport hijack_data as hj\nprint(hj.apply.__module__, callable(hj.apply), 'Marks'"
        " in dir(hj))"
    )
    assert python(code) == "hijack_data._apply True True"


@pytest.mark.parametrize(
    "first", ["hijack_data.corruption", "hijack_data.corruptions.verification"]
)
def test_the_nine_are_known_whatever_is_imported_first(first):
    code = (
        f"import {first}\nfrom hijack_data.corruption import corruption_names,"
        " make_corruption\nmake_corruption('marks-v1')\nprint(*corruption_names()[:2])"
    )
    assert python(code) == "pop_ups resolution"


def test_no_public_name_is_a_module_of_the_standard_library():
    assert not sys.stdlib_module_names & {*hj.__all__, *pipelines.__all__, *online_env._HOMES}


def test_dir_shows_what_is_ours():
    importlib.import_module("hijack_data.elements")
    names = {name for name in dir(hj) if not name.startswith("__")}
    assert set(hj.__all__) <= names
    assert "elements" in names
    assert {"importlib", "sys", "ModuleType", "TYPE_CHECKING"} & names == set()
    ours = "hijack_data"
    assert all(getattr(getattr(hj, name), "__module__", ours).startswith(ours) for name in names)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"no attribute 'Nonsense'$"):
        hj.Nonsense  # noqa: B018
    with pytest.raises(AttributeError, match=r"'Paste'; import it from hijack_data\.plugin"):
        getattr(hj, "Paste")  # noqa: B009


def test_no_public_name_hides_a_module_of_the_standard_library():
    from hijack_data import plugin

    assert not {*hj.__all__, *plugin.__all__} & set(sys.stdlib_module_names)
    assert not set(hj.__all__) & {"get", "names"}


def test_authors_of_plug_ins_have_what_users_have():
    """A name means the same at the top and in `hijack_data.plugin`, and all are documented."""
    for name in hj.plugin.__all__:
        value = getattr(hj.plugin, name)
        assert inspect.getdoc(value), f"{name} has no docstring"
        assert name not in hj.__all__ or getattr(hj, name) is value
    assert set(hj.plugin.__all__) - set(hj.__all__) == hj._FOR_AUTHORS


def test_errors_descend_from_the_builtin_they_refine():
    from hijack_data import errors

    pairs = {
        errors.UnknownNameError: KeyError,
        errors.ParameterError: ValueError,
        errors.ParameterTypeError: TypeError,
        errors.ImageError: ValueError,
        errors.ImageTypeError: TypeError,
        errors.PlanError: ValueError,
        errors.ActionError: ValueError,
        errors.ConfigError: ValueError,
        errors.MissingDependencyError: ImportError,
    }
    for ours, builtin in pairs.items():
        assert issubclass(ours, builtin)
        assert issubclass(ours, hj.HijackError)
    assert str(errors.UnknownNameError("plain text")) == "plain text"
