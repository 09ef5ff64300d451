import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hijack_data.errors import HijackError, ParameterError, UnknownNameError
from pipelines.errors import SourceError
from pipelines.readers import (
    FileReader,
    Rejected,
    detect_format,
    get_reader,
    names,
    register,
    safe_files,
)

PLAIN = '{"trajectory_id": "a", "step": 0}'
AGENTNET = '{"task_id": "a", "traj": []}'
BOTH = '{"trajectory_id": "a", "step": 0, "traj": []}'


@pytest.mark.parametrize(
    ("files", "path", "expected"),
    [
        ({"trajectories.jsonl": PLAIN}, "", "jsonl"),
        ({"trajectories.jsonl": "rubbish"}, "", "jsonl"),
        ({"trajectories.jsonl": AGENTNET}, "", "jsonl"),
        ({"steps.jsonl": "\n\xff\n" + PLAIN}, "steps.jsonl", "jsonl"),
        ({"any.jsonl": "rubbish\n" + AGENTNET}, "", "agentnet"),
        ({"any.jsonl": AGENTNET}, "any.jsonl", "agentnet"),
        ({"any.ndjson": PLAIN}, "", "jsonl"),
        ({"lines.json": PLAIN + "\n" + PLAIN}, "", "jsonl"),
        ({"b.json": '{"task_id": "a", "steps": []}', "a.json": "["}, "", "agentnet"),
        ({"b.json": '{"task_id": "a", "steps": []}'}, "b.json", "agentnet"),
    ],
)
def test_the_format_is_found(
    files: dict[str, str], path: str, expected: str, tmp_path: Path
) -> None:
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="latin-1")
    assert detect_format(tmp_path / path) == expected


@pytest.mark.parametrize(
    ("files", "path", "reason"),
    [
        ({}, "", "is empty"),
        ({"a.jsonl": ""}, "a.jsonl", "is empty"),
        ({}, "none", "no such file"),
        ({}, "a\0b", "no such file"),
        ({"a.txt": "x"}, "", "not a recording"),
        ({"a.jsonl": '{"foo": 1}'}, "", "not a recording"),
        ({"a.json": "{"}, "a.json", "not a recording"),
        ({"any.jsonl": BOTH}, "", "agentnet or jsonl"),
    ],
)
def test_a_source_that_cannot_be_told(
    files: dict[str, str], path: str, reason: str, tmp_path: Path
) -> None:
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(SourceError, match=reason) as caught:
        detect_format(tmp_path / path)
    assert "agentnet" in str(caught.value)
    assert "jsonl" in str(caught.value)
    assert isinstance(caught.value, HijackError)
    assert isinstance(caught.value, ValueError)


def test_the_real_folders(shared_data: Path) -> None:
    assert detect_format(shared_data / "trajectories" / "agentnet_raw") == "agentnet"
    assert detect_format(shared_data / "trajectories" / "agentnetbench") == "agentnet"
    assert detect_format(shared_data / "trajectories" / "webvoyager") == "webvoyager"
    assert detect_format(shared_data / "trajectories" / "screenagent") == "screenagent"
    assert detect_format(shared_data / "screenshots") == "images"


def test_an_unknown_reader() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'agentnet'"):
        get_reader("agentnett")


def test_a_reader_cannot_take_a_name_that_is_taken() -> None:
    class Impostor(type(get_reader("jsonl"))):
        name = "jsonl"

    with pytest.raises(ParameterError, match=r"'jsonl' is taken by pipelines\.readers\.jsonl"):
        register(Impostor)


def test_what_is_no_reader_is_refused_with_what_is_missing() -> None:
    class Half:
        name = "half"

        def detect(self, path: Path) -> bool:
            return False

    with pytest.raises(ParameterError, match=r"cannot register .*Half: it has no read\(source\)"):
        register(Half)  # type: ignore[type-var]
    with pytest.raises(ParameterError, match="name is not set"):
        register(type("Nameless", (Half,), {"name": "", "read": Half.detect}))


def test_a_registered_reader_is_detected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pipelines.readers import base

    monkeypatch.setattr(base.READERS, "entries", dict(base.READERS.entries))

    @register
    class Odd:
        name = "odd"

        def detect(self, path: Path) -> bool:
            return path.name == "x.odd"

        def read(self, path: Path) -> Any:
            yield Rejected(path.name, "", "", "odd")

    (tmp_path / "x.odd").write_text("1")
    assert detect_format(tmp_path / "x.odd") == "odd"
    assert "odd" in names()


def test_a_name_decides_without_a_look_into_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipelines.readers import file_head

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the file was opened to find out its format")

    monkeypatch.setattr(file_head, "first_records", refuse)
    (tmp_path / "trajectories.jsonl").write_text(PLAIN)
    assert detect_format(tmp_path) == "jsonl"


def test_the_beginning_of_a_file_is_read_once_for_all_readers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipelines.readers import file_head

    opened_paths: list[Path] = []

    def first_records(path: Path) -> list[Any]:
        opened_paths.append(path)
        return safe_files.first_records(path)

    monkeypatch.setattr(file_head, "first_records", first_records)
    (tmp_path / "any.jsonl").write_text(AGENTNET)
    assert detect_format(tmp_path) == "agentnet"
    assert opened_paths == [tmp_path / "any.jsonl"]


def test_only_readers_whose_keys_a_file_has_are_asked_about_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests: list[str] = []
    for name in names():
        cls: Any = type(get_reader(name))
        if issubclass(cls, FileReader):

            def recognizes(self: Any, head: Any, of: Any = cls.recognizes) -> bool:
                requests.append(self.name)
                return of(self, head)

            monkeypatch.setattr(cls, "recognizes", recognizes)
    (tmp_path / "any.jsonl").write_text(PLAIN)
    assert detect_format(tmp_path) == "jsonl"
    assert requests == ["jsonl"]


def test_a_registered_reader_may_be_recognized_by_the_first_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipelines.readers import base

    monkeypatch.setattr(base.READERS, "entries", dict(base.READERS.entries))

    @register
    class Keyed(FileReader):
        name = "keyed"
        file_names = ("mine.txt",)
        keys = (frozenset({"my", "keys"}),)

        def read(self, path: Path) -> Any:
            yield Rejected(path.name, "", "", "keyed")

    (tmp_path / "a.json").write_text('[{"my": 1, "keys": 2, "more": 3}]')
    (tmp_path / "mine.txt").write_text("")
    assert detect_format(tmp_path / "a.json") == detect_format(tmp_path / "mine.txt") == "keyed"
    assert get_reader("keyed").detect(tmp_path)
    (tmp_path / "b.json").write_text('{"my": 1}')
    with pytest.raises(SourceError, match="not a recording"):
        detect_format(tmp_path / "b.json")


def test_a_json_file_that_is_too_large_is_known_by_its_first_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipelines.readers import file_head

    monkeypatch.setattr(file_head, "MAX_RECORD_BYTES", 10)
    (tmp_path / "a.json").write_text('[{"messages": [], "images": ["a.png"]}, {"cut off')
    assert detect_format(tmp_path) == "chat"


def test_readers_say_what_their_coordinates_are() -> None:
    for name in names():
        assert "Coordinates:" in (type(get_reader(name)).__doc__ or "")


def test_a_rejected_record_is_json_and_reads_well() -> None:
    record = Rejected("a.jsonl", "line 3", "action.x", "must be a number")
    assert json.loads(json.dumps(record.to_data()))["where"] == "line 3"
    assert str(record) == "a.jsonl: line 3: action.x: must be a number"


def test_importing_pipelines_loads_nothing_heavy() -> None:
    code = (
        "import sys, pipelines, pipelines.readers\nprint(*[m for m in sys.argv[1:] if m in"
        " sys.modules])"
    )
    heavy = ["datasets", "torch", "jax", "pyarrow", "cv2", "pandas", "isal"]
    root = Path(__file__).resolve().parents[2]
    process = subprocess.run(
        [sys.executable, "-c", code, *heavy], cwd=root, capture_output=True, text=True, check=True
    )
    assert process.stdout.split() == []
