"""Settings of Xfce, read from the files of its store."""

import pytest

from online_env.errors import DesktopError
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import desktop_settings
from online_env.tasks.machine import Machine

CHANNEL = """<?xml version="1.0" encoding="UTF-8"?>
<channel name="xfwm4" version="1.0">
  <property name="general" type="empty">
    <property name="workspace_count" type="int" value="4"/>
    <property name="workspace_names" type="array">
      <value type="string" value="One"/>
      <value type="string" value="Two"/>
    </property>
  </property>
</channel>
"""
FILE = ".config/xfce4/xfconf/xfce-perchannel-xml/xfwm4.xml"


@pytest.fixture
def machine(tmp_path):
    return Machine(FolderDesktop(tmp_path))


def test_values_and_lists_are_read(machine):
    machine.write(FILE, CHANNEL)
    assert desktop_settings.setting(machine, "xfwm4", "general/workspace_count") == "4"
    assert desktop_settings.setting(machine, "xfwm4", "general/workspace_names") == ["One", "Two"]


@pytest.mark.parametrize("name", ["general/theme", "other/theme", "general"])
def test_what_is_not_set_has_no_value(machine, name):
    machine.write(FILE, CHANNEL)
    assert desktop_settings.setting(machine, "xfwm4", name) is None


def test_a_channel_without_a_file_has_no_values(machine):
    assert desktop_settings.setting(machine, "xfwm4", "general/theme") is None


def test_a_broken_file_is_an_error(machine):
    machine.write(FILE, CHANNEL[:90])
    with pytest.raises(DesktopError, match=r"xfwm4\.xml on the desktop is no XML"):
        desktop_settings.setting(machine, "xfwm4", "general/theme")


def test_what_is_stored_is_read_and_the_rest_stays(machine):
    machine.write(FILE, CHANNEL)
    desktop_settings.store(machine, "xfwm4", "general/workspace_names", ["Three"])
    desktop_settings.store(machine, "xfwm4", "general/theme", "Daloa")
    expected = {
        "general/workspace_names": ["Three"],
        "general/theme": "Daloa",
        "general/workspace_count": "4",
    }
    assert list(desktop_settings.setting_problems(machine, "xfwm4", expected)) == []


def test_a_setting_that_differs_is_named(machine):
    machine.write(FILE, CHANNEL)
    expected = {"general/workspace_count": "5"}
    items = list(desktop_settings.setting_problems(machine, "xfwm4", expected))
    assert items == ["xfwm4 general/workspace_count is '4', not '5'"]


def test_numbers_are_the_same_however_they_are_written(machine):
    desktop_settings.store(machine, "xfce4-desktop", "size", "10.000000")
    assert list(desktop_settings.setting_problems(machine, "xfce4-desktop", {"size": "10"})) == []
    assert list(desktop_settings.setting_problems(machine, "xfce4-desktop", {"size": "11"})) != []


@pytest.mark.parametrize(
    ("stored", "wanted", "is_right"),
    [
        (["One", "Two"], ["One", "Two"], True),
        (["Two", "One"], ["One", "Two"], False),
        (["One"], "One", False),
        ("", "0", False),
        ("1e1", "10", True),
        ("nan", "0", False),
        ("true", "1", False),
    ],
)
def test_lists_texts_and_numbers_are_told_apart(machine, stored, wanted, is_right):
    desktop_settings.store(machine, "xfwm4", "general/name", stored)
    items = list(desktop_settings.setting_problems(machine, "xfwm4", {"general/name": wanted}))
    assert items == ([] if is_right else [f"xfwm4 general/name is {stored!r}, not {wanted!r}"])


def test_a_list_of_settings_becomes_another_one(machine):
    desktop_settings.store(machine, "xfwm4", "names", ["One", "Two"])
    desktop_settings.store(machine, "xfwm4", "names", ["Three"])
    assert desktop_settings.setting(machine, "xfwm4", "names") == ["Three"]
    desktop_settings.store(machine, "xfwm4", "names", "Four")
    assert desktop_settings.setting(machine, "xfwm4", "names") == "Four"
