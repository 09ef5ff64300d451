"""`BuildOptions`: one home of every option, whoever fills it."""

import dataclasses
import inspect
import typing
from pathlib import Path
from typing import Any

import pytest

from pipelines import build, open_dataset
from pipelines.building import item_buffer
from pipelines.building.build_options import DEFAULTS, BuildKeywords, BuildOptions
from pipelines.errors import BuildError
from pipelines.readers.jsonl import Jsonl

OPTIONS = {option.name: option for option in dataclasses.fields(BuildOptions)}


def test_keywords_are_the_options() -> None:
    assert typing.get_type_hints(BuildKeywords) == typing.get_type_hints(BuildOptions)


def test_the_signature_shows_every_option_with_its_default() -> None:
    parameters = list(inspect.signature(build).parameters.values())
    assert [parameter.name for parameter in parameters] == ["source", "out", "options", *OPTIONS]
    for parameter in parameters[3:]:
        assert parameter.kind is inspect.Parameter.KEYWORD_ONLY
        assert parameter.default == OPTIONS[parameter.name].default


def test_every_option_is_described() -> None:
    described = (BuildOptions.__doc__ or "").partition("Args:")[2]
    assert [name for name in OPTIONS if f"\n        {name}: " not in described] == []


def test_options_of_a_configuration_are_options_of_a_build() -> None:
    from hijack_data.config.options import OPTIONS as CONFIGURED

    assert set(DEFAULTS) == {"corruptions", *CONFIGURED}
    assert set(DEFAULTS) <= set(OPTIONS)


def test_an_object_and_keywords(recording: Any, tmp_path: Path) -> None:
    options = BuildOptions(corruptions="clean", seed=3, limit=1)
    build(recording(), tmp_path / "one", options)
    build(tmp_path / "source", tmp_path / "two", options, limit=2)
    dataset, two = open_dataset(tmp_path / "one"), open_dataset(tmp_path / "two")
    assert (len(dataset), len(two)) == (3, 6)
    assert {row["seed"] for row in dataset} == {3}


def test_resolved_options_come_from_the_caller_then_the_configuration() -> None:
    config = {"corruptions": ["marks"], "seed": 5, "clean": False, "output": "lazy"}
    result = BuildOptions(config=config, seed=7).resolved()
    assert (result.seed, result.clean, result.output, result.label_policy) == (
        7,
        False,
        "lazy",
        "keep",
    )
    assert BuildOptions(config=config, corruptions="clean").resolved().clean is True
    with pytest.raises(BuildError, match="--no-clean"):
        BuildOptions(corruptions="clean", clean=False).resolved()


def test_unknown_keywords_are_refused(recording: Any, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="seeds"):
        build(recording(), tmp_path / "out", seeds=1)  # type: ignore[call-arg]


@pytest.mark.parametrize(("kept_steps", "times"), [(6, 1), (5, 2)])
def test_progress_reads_a_small_source_once(
    kept_steps: int, times: int, recording: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Jsonl.read
    opened_paths: list[Any] = []

    def counted(self: Any, source: Any) -> Any:
        opened_paths.append(source)
        return real(self, source)

    monkeypatch.setattr(Jsonl, "read", counted)
    monkeypatch.setattr(item_buffer, "MAX_BUFFERED_STEPS", kept_steps)
    calls: list[tuple[int, int]] = []
    build(
        recording(),
        tmp_path / "out",
        corruptions="clean",
        progress=lambda item, total, _: calls.append((item, total)),
    )
    assert len(opened_paths) == times
    assert calls == [(item, 6) for item in range(1, 7)]
    opened_paths.clear()
    build(tmp_path / "source", tmp_path / "quiet", corruptions="clean")
    assert len(opened_paths) == 1
