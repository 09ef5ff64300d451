"""Looking things up by name: what all kinds share."""

import os
import sys

import pytest

from hijack_data import loading
from hijack_data.errors import ParameterError, PluginError, UnknownNameError
from hijack_data.registry import KINDS, Lazy, Registry, find_registry, registries, undone_on_failure


class Tool:
    """A thing with a name of its own."""

    name = "saw"

    def cut(self):
        """What makes it a tool."""


def shaped(thing, _):
    if not hasattr(thing, "cut"):
        yield "it has no cut()"


@pytest.fixture
def tools(monkeypatch, tmp_path):
    """A registry that is forgotten after the test, as are the files that are loaded."""
    monkeypatch.setattr("hijack_data.entries._tables", list(registries()))
    monkeypatch.setenv(loading.VARIABLE, "")
    monkeypatch.setattr(loading, "_files", {})
    monkeypatch.chdir(tmp_path)
    builtin = {"path": "pathlib:Path"}
    return Registry("tool", "tools", builtin=builtin, own_name="name", problems=shaped)


def write(text, name="mine.py"):
    with open(name, "w") as file:
        file.write(text)
    return os.path.realpath(name)


MINE = "class Axe:\n    name = 'axe'\n    def cut(self):\n        pass\n"


def test_names_and_the_closest_one(tools):
    assert tools.add(Tool) == "saw"
    assert list(tools) == tools.names() == ["path", "saw"]
    assert len(tools) == 2
    assert tools["saw"] is tools.get("saw") is Tool
    assert "saw" in tools
    assert "axe" not in tools
    assert tools.keys() - {"saw"} == {"path"}
    with pytest.raises(UnknownNameError, match=r"unknown tool 'sav'; did you mean 'saw'\?"):
        tools.get("sav")


def test_ours_are_imported_when_they_are_asked_for(tools):
    assert isinstance(tools.entries["path"], Lazy)
    from pathlib import Path

    assert tools["path"] is Path


def test_a_thing_without_a_name_gets_one_from_its_decorator(tools):
    plain = Registry("maker", "makers")

    @plain.register("knife")
    def make():
        """Makes knives."""

    assert plain["knife"] is make
    with pytest.raises(ParameterError, match=r"cannot register .*make: it has no cut\(\)"):
        tools.register("knife")(make)
    assert "knife" not in tools


def test_the_same_thing_again_is_fine_and_another_names_both(tools):
    tools.add(Tool)
    tools.add(Tool)
    second = type("Other", (Tool,), {"__module__": "elsewhere"})
    with pytest.raises(ParameterError) as caught:
        tools.add(second)
    output = str(caught.value)
    assert output.startswith("cannot register Other of elsewhere: 'saw' is taken by ")
    assert __file__ in output


def test_a_class_of_a_users_file(tools):
    path = write(MINE)
    assert tools.find("mine.py:Axe") == "axe"
    axe = tools["axe"]
    assert loading.find_source(axe)["path"] == path
    assert tools.find("./mine.py:Axe") == "axe"
    assert tools.find(f"{path}:Axe") == "axe"
    assert os.environ[loading.VARIABLE] == ""  # nobody else needs it


def test_the_home_of_the_user_is_found(tools, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    write(MINE)
    assert tools.find("~/mine.py:Axe") == "axe"


def test_a_class_of_a_module(tools, monkeypatch, tmp_path):
    write(MINE, "tool_module_of_mine.py")
    monkeypatch.syspath_prepend(tmp_path)
    assert tools.find("tool_module_of_mine:Axe") == "axe"
    sys.modules.pop("tool_module_of_mine")


@pytest.mark.parametrize(
    ("text", "asked", "error", "words"),
    [
        (MINE, "mine.py:Ax", UnknownNameError, r"mine.py: has no 'Ax'; did you mean 'Axe'\?"),
        (MINE, "mine.py", PluginError, "'mine.py' names no class; .* such as mine.py:MyClass"),
        (MINE, "mine.py:", PluginError, "'mine.py:' names no class"),
        (MINE, "gone.py:Axe", PluginError, "gone.py: not a Python file that can be read"),
        ("x = 1\n1 / 0\n", "mine.py:Axe", PluginError, r"mine.py: .*\(line 2\): ZeroDivisionError"),
        ("def\n", "mine.py:Axe", PluginError, "mine.py: cannot be imported: SyntaxError"),
        ("import sys; sys.exit()\n", "mine.py:Axe", PluginError, r"\(line 1\): SystemExit"),
        ("class Axe: pass\n", "mine.py:Axe", ParameterError, r"register Axe: it has no cut\(\)"),
        ("", "no_such_module:Axe", PluginError, "there is no module 'no_such_module'; a file is"),
    ],
)
def test_what_is_wrong_with_a_reference(tools, text, asked, error, words):
    write(text)
    with pytest.raises(error, match=words):
        tools.find(asked)


def test_a_file_with_a_name_that_is_taken(tools):
    tools.add(Tool)
    path = write(MINE.replace("'axe'", "'saw'"))
    with pytest.raises(ParameterError) as caught:
        tools.find("mine.py:Axe")
    assert f"cannot register Axe of {path}: 'saw' is taken by {__file__}" in str(caught.value)


def test_what_failed_leaves_nothing_behind(tools):
    def fails():
        with undone_on_failure():
            tools.add(Tool)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert "saw" not in tools.entries


@pytest.mark.parametrize("kinds", KINDS)
def test_each_kind_has_its_registry(kinds):
    pytest.importorskip("pyarrow")
    pytest.importorskip("gymnasium")
    registry = find_registry(kinds)
    assert registry.group == f"agenthijack.{kinds}"
    for name in registry.names():
        assert registry.get(name) is not None


def test_another_kind_is_unknown():
    with pytest.raises(UnknownNameError, match="did you mean 'agents'"):
        find_registry("agent")
