"""Configurations: what loads, from where, plain scalars, Python mappings, lists of names."""

from typing import Any

import pytest

import hijack_data as hj
from hijack_data import config_files
from hijack_data.config import OPTIONS, available, load_config, specs_from
from hijack_data.errors import ConfigError, ParameterError, ParameterTypeError, UnknownNameError

from support.config import load, structure

# What loads


def test_every_form_of_an_entry(tmp_path):
    config = load(
        tmp_path,
        """\
corruptions:
  - marks: {number: 100, color: blue}
  - pop_ups
  - subtitle: {severity: 4, position: top}
  - marks: {as: few, number: 5}
  - resolution:
      scale: 1e-1
  - one_of: {options: [marks, subtitle: {position: top}], p_clean: 0.2, weights: [2, 1]}
  - sequence: [subtitle, network_error]
  - sequence: {as: again, parts: [marks, marks: {number: 1}]}
  - app_minimization: {step: {every: 3}}
  - accidental_touch: {step: [9, 2]}
  - verification:
seed: 7
""",
    )
    assert {label: structure(p) for label, p in config.corruptions.items()} == {
        "marks": hj.Marks(number=100, color="blue"),
        "pop_ups": hj.PopUps(),
        "subtitle": hj.Subtitle.at(4, position="top"),
        "few": hj.Marks(number=5),
        "resolution": hj.Resolution(scale=0.1),
        "one_of": ("one_of", [hj.Marks(), hj.Subtitle(position="top")], 0.2, [2, 3]),
        "sequence": ("sequence", [hj.Subtitle(), hj.NetworkError()]),
        "again": ("sequence", [hj.Marks(), hj.Marks(number=1)]),
        "app_minimization": hj.AppMinimization(step=hj.plugin.Every(3)),
        "accidental_touch": hj.AccidentalTouch(step=(2, 9)),
        "verification": hj.Verification(),
    }
    assert list(config.corruptions)[3] == "few"
    assert config.options == {"seed": 7}
    assert config.source == str(tmp_path / "c.yaml")


def test_mapping_instead_of_list(tmp_path):
    text = "corruptions:\n  marks: {number: 3}\n  pop_ups:\n  sequence: [marks, subtitle]\n"
    corruptions = load(tmp_path, text).corruptions
    assert list(corruptions) == ["marks", "pop_ups", "sequence"]
    assert corruptions["marks"] == hj.Marks(number=3)


def test_versioned_name_is_labelled_by_the_name(tmp_path):
    assert load(tmp_path, "corruptions: [marks-v1]").corruptions == {"marks": hj.Marks()}


def test_aliases_and_byte_order_mark(tmp_path):
    text = (
        "\ufeffcorruptions:\r\n  - marks: &m {number: 3}\r\n  - sequence: [marks: *m, subtitle]\r\n"
    )
    sequence = load(tmp_path, text).corruptions["sequence"]
    assert structure(sequence) == ("sequence", [hj.Marks(number=3), hj.Subtitle()])


def test_all_options(tmp_path):
    text = (
        "corruptions: [marks]\nseed: 18446744073709551615\nclean: false\nlabel_policy:"
        " avoid\noutput: lazy\n"
    )
    options = load(tmp_path, text + "splits: {train: 0.9, test: .1}\npaper_compat: false\n").options
    assert options == {
        "seed": 2**64 - 1,
        "clean": False,
        "label_policy": "avoid",
        "output": "lazy",
        "splits": {"train": 0.9, "test": 0.1},
    }
    assert set(options) == set(OPTIONS)
    assert all(option.doc for option in OPTIONS.values())


def test_python_mapping():
    config = load_config(
        {"corruptions": ["marks", {"accidental_touch": {"step": (6, 3)}}], "seed": 1}
    )
    assert config.corruptions == {
        "marks": hj.Marks(),
        "accidental_touch": hj.AccidentalTouch(step=(3, 6)),
    }
    assert (config.options, config.source) == ({"seed": 1}, "<mapping>")


def test_python_mapping_problems():
    with pytest.raises(ConfigError) as caught:
        load_config(
            {"corruptions": [{"marks": {"number": -1, "colr": "red"}}, {1: 2}], "seed": None}
        )
    assert [p.partition(": ")[0] for p in caught.value.problems] == [
        "<mapping>.corruptions[1]",  # the key 1
        "<mapping>.seed",
        "<mapping>.corruptions[0].marks.number",
        "<mapping>.corruptions[0].marks.colr",
        "<mapping>.corruptions[1]",  # an entry without a name
    ]


def test_python_mapping_limits():
    shared: list[Any] = [1]
    for _ in range(30):
        shared = [shared, shared]
    endless: dict[str, Any] = {}
    endless["corruptions"] = endless
    for bad in ({"corruptions": shared}, endless, {"corruptions": ["marks"], "seed": 10**5000}):
        with pytest.raises(ConfigError):
            load_config(bad)


@pytest.mark.parametrize("bad", [None, 3, b"paper", ["marks"]])
def test_source_of_the_wrong_type(bad):
    with pytest.raises(ParameterTypeError, match="a path, a name or a mapping"):
        load_config(bad)


# Plain scalars: YAML 1.2, not 1.1


@pytest.mark.parametrize(
    "text", ["no", "on", "Yes", "off", "y", "1:30", "010", "2024-01-01", "0x1F", "1_000", "1e", "="]
)
def test_words_stay_texts(tmp_path, text):
    assert load(tmp_path, f"corruptions:\n  - pop_ups: {{button_string: {text}}}").corruptions == {
        "pop_ups": hj.PopUps(button_string=text)
    }


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-1", 0.1), (".5", 0.5), ("2", 2.0), ("+1.5", 1.5), ("1.", 1.0), ("0.2E+1", 2)],
)
def test_numbers(tmp_path, text, value):
    spec = load(tmp_path, f"corruptions:\n  - resolution: {{scale: {text}}}").corruptions[
        "resolution"
    ]
    assert spec == hj.Resolution(scale=value)


@pytest.mark.parametrize("text", ["~", "null", ""])
def test_null(tmp_path, text):
    assert load(tmp_path, f"corruptions:\n  network_error:\n    local_ip: {text}").corruptions == {
        "network_error": hj.NetworkError()
    }


# Files


def message(source: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        load_config(source)
    return str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    assert message(tmp_path) == f"{tmp_path}: is a folder; give the path of a YAML file"
    assert "no such file" in message(tmp_path / "none.yaml")
    (tmp_path / "dangling").symlink_to(tmp_path / "none")
    assert "cannot be read (No such file" in message(tmp_path / "dangling")
    for odd in ("a\0b", "x" * 5000, ""):
        assert "neither a file nor a packaged configuration" in message(odd)
        assert len(message(odd)) < 2000


def test_too_large_a_file_is_not_read(tmp_path):
    path = tmp_path / "big.yaml"
    with path.open("wb") as stream:
        stream.truncate(100 * 2**20)
    assert message(path) == f"{path}: larger than 1048576 bytes; is it a configuration?"


def test_unknown_name_lists_the_packaged_ones():
    assert message("papr").endswith("; did you mean 'paper'?")
    text = message("no name at all")
    assert "packaged: corruptions/paper, " in text
    assert text.endswith(f" and {len(available()) - 20} more")


def test_a_file_wins_over_a_packaged_name_and_a_folder_does_not(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper").mkdir()
    assert len(load_config("paper").corruptions) == 9
    (tmp_path / "paper").rmdir()
    (tmp_path / "paper").write_text("corruptions: [marks]")
    assert load_config("paper").corruptions == {"marks": hj.Marks()}


def test_installed_package_of_configurations_is_used(tmp_path, monkeypatch):
    for name in ("one/paper", "two/same", "three/same"):
        path = tmp_path / "packaged_for_test" / f"{name}.yaml"
        path.parent.mkdir(parents=True)
        path.write_text("corruptions: [subtitle]")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(config_files, "PACKAGE", "packaged_for_test")
    assert available() == ["one/paper", "three/same", "two/same"]
    config = load_config("paper")
    assert (config.corruptions, config.source) == ({"subtitle": hj.Subtitle()}, "one/paper")
    assert "several configurations: use three/same or two/same" in message("same")


# Lists of names


def test_specs_from():
    assert specs_from(" marks, pop_ups ") == [hj.Marks(), hj.PopUps()]
    assert specs_from("all") == [hj.make_corruption(name) for name in hj.corruption_names()]
    with pytest.raises(UnknownNameError, match="did you mean 'marks'"):
        specs_from("marks,mraks")
    for text in ("", "marks,", "marks,marks-v1"):
        with pytest.raises(ParameterError):
            specs_from(text)
    with pytest.raises(ParameterTypeError):
        specs_from(None)  # type: ignore[arg-type]
