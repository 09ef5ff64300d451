"""The environment that OSWorld runs in: when it is made, when it is found, and what is said where
it can't be."""

import json
from pathlib import Path

import pytest

from hijack_data.errors import ParameterError
from online_env.osworld import venv
from online_env.osworld.errors import OsworldError

# Stands for Python and for pip: it notes how it was called, and fails where it is told to.
PROGRAM = """#!/bin/sh
echo "$@" >> "$(dirname "$0")/../calls"
case "$*" in *"$FAIL_ON"*) echo "no such thing" >&2; exit 3;; esac
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose interpreter only takes notes."""
    monkeypatch.setenv("FAIL_ON", "nothing-fails")
    program = tmp_path / "venv/bin/python"
    program.parent.mkdir(parents=True)
    program.write_text(PROGRAM)
    program.chmod(0o755)
    return tmp_path / "venv"


def calls(folder: Path) -> list[str]:
    return (folder / "calls").read_text().splitlines()


def test_it_is_made_once_and_made_again_for_another_tier(folder: Path) -> None:
    assert venv.installed_tier(folder) is None
    result = venv.make(folder, "tiny")
    assert (result.tier, result.fresh, venv.installed_tier(folder)) == ("tiny", True, "tiny")
    pinned, listed = calls(folder)
    assert pinned.endswith("--no-deps desktop-env==1.0.2")
    assert listed.endswith("requirements-tiny.txt")
    assert venv.make(folder, "tiny").fresh is False
    assert len(calls(folder)) == 2
    assert venv.make(folder, "lean").fresh is True
    assert venv.installed_tier(folder) == "lean"
    assert venv.find_python(folder) == folder / "bin/python"


def test_a_checkout_is_not_replaced_by_the_release_when_packages_are_added(folder: Path) -> None:
    checkout = folder.parent / "OSWorld"
    venv.make(folder, "tiny", osworld=checkout)
    venv.make(folder, "lean", providers=("docker",))
    assert calls(folder)[-1].endswith(f"--no-deps --force-reinstall {checkout}")
    assert venv.make(folder, "lean").fresh is False


def test_an_interrupted_install_counts_as_none(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    venv.make(folder, "tiny")
    monkeypatch.setenv("FAIL_ON", "requirements-lean")
    with pytest.raises(
        OsworldError, match=r"requirements-lean.txt` failed with exit code 3: no such thing"
    ):
        venv.make(folder, "lean")
    assert venv.installed_tier(folder) is None
    with pytest.raises(OsworldError, match="hijack osworld setup"):
        venv.find_python(folder)


def test_other_requirements_make_it_anew(folder: Path) -> None:
    venv.make(folder, "tiny")
    stamp = folder / venv.STAMP
    stamp.write_text(json.dumps({"tier": "tiny", "requirements": "requests==1"}))
    assert venv.installed_tier(folder) is None
    assert venv.make(folder, "tiny").fresh is True
    for damaged in ("", "[]", "{", '{"tier": "huge", "requirements": ""}'):
        stamp.write_text(damaged)
        assert venv.installed_tier(folder) is None


def test_wrong_tiers_and_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no tier 'tine'; did you mean 'tiny'"):
        venv.make(tmp_path, "tine")
    (tmp_path / "file").write_text("")
    with pytest.raises(OsworldError, match="can't be made there"):
        venv.make(tmp_path / "file", "tiny")
    with pytest.raises(OsworldError, match="exit code 1"):
        venv.make(tmp_path / "new", "tiny", python="/usr/bin/false")


def test_the_larger_tiers_hold_the_smaller_ones() -> None:
    texts = {tier: venv._requirements(tier).splitlines() for tier in venv.TIERS}
    packages = {
        tier: {line for line in lines if line and line[0] not in "#-"}
        for tier, lines in texts.items()
    }
    assert packages["tiny"] < packages["lean"] < packages["mid"]
    assert "pymupdf<2  # 2 brings onnxruntime (68 MB)" in packages["lean"]
