"""Settings of the Xfce desktop: read from the files of its store, changed in its dialogs.

The store's server, xfconfd, writes a file some seconds after a change, and at once when it ends. It
is therefore ended before a file is read or written; the next program that needs it starts it anew.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import TypeAlias

from ...errors import DesktopError
from ..hand import Hand
from ..idle import end_process
from ..machine import Machine

StoredValue: TypeAlias = str | list[str] | None
_FOLDER = ".config/xfce4/xfconf/xfce-perchannel-xml"
_FIND_SERVER = 'pgrep -o -u "$(id -u)" -x xfconfd'


def setting(machine: Machine, channel: str, name: str) -> StoredValue:
    """Return a setting as text, a list of texts if it has several values, `None` if not set.

    Args:
        machine: Where to look.
        channel: The channel, such as `xfwm4`.
        name: The path of the property, such as `general/workspace_count`.

    Raises:
        DesktopError: The channel's file is no XML.
    """
    node = _node(_tree(machine, channel), name)
    if node is None:
        return None
    if node.get("type") == "array":
        return [value.get("value", "") for value in node.findall("value")]
    return node.get("value")


def store(machine: Machine, channel: str, name: str, value: str | list[str]) -> None:
    """Write a setting into the file of its channel, as `wrong_results` and `right_result` results do."""
    root = _tree(machine, channel)
    node = root
    for part in name.split("/"):
        below = next((child for child in node if child.get("name") == part), None)
        node = ET.SubElement(node, "property", name=part, type="empty") if below is None else below
    for old in node.findall("value"):
        node.remove(old)
    if isinstance(value, str):
        node.set("type", "string")
        node.set("value", value)
    else:
        node.set("type", "array")
        for entry in value:
            ET.SubElement(node, "value", type="string", value=entry)
    machine.write(_path(channel), ET.tostring(root))


def setting_problems(
    machine: Machine, channel: str, wanted: Mapping[str, str | list[str]]
) -> Iterator[str]:
    """Yield the settings that are not as wanted.

    Args:
        machine: Where to look.
        channel: The channel.
        wanted: The values, by the path of the property.
    """
    for name, value in wanted.items():
        found = setting(machine, channel, name)
        if not _is_same(value, found):
            yield f"{channel} {name} is {found!r}, not {value!r}"


def _is_same(wanted: StoredValue, found: StoredValue) -> bool:
    """Return whether two values are the same; `10.000000` is the number `10`."""
    if found == wanted:
        return True
    try:
        return float(str(found)) == float(str(wanted))
    except ValueError:
        return False


def _path(channel: str) -> str:
    return f"{_FOLDER}/{channel}.xml"


def _tree(machine: Machine, channel: str) -> ET.Element:
    end_process(machine.desktop, _FIND_SERVER, "the server of the desktop's settings, xfconfd,")
    text = machine.text(_path(channel))
    if text is None:
        return ET.Element("channel", name=channel, version="1.0")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise DesktopError(f"{_path(channel)} on the desktop is no XML: {error}") from None


def _node(root: ET.Element, name: str) -> ET.Element | None:
    node = root
    for part in name.split("/"):
        below = next((child for child in node if child.get("name") == part), None)
        if below is None:
            return None
        node = below
    return node


# What a person does


def choose_tab(hand: Hand, name: str, app: str) -> None:
    """Show a page of a dialog."""
    hand.click_on("page-tab", name, app)
    hand.find("page-tab", name, app, "selected")


def set_number(hand: Hand, label: str | re.Pattern[str], number: int, app: str) -> None:
    """Type a number into the field to the right of a label."""
    beside = hand.find(("label", "check-box"), label, app)
    middle = beside.centre[1]

    def is_field(node) -> bool:
        if node.role != "spin-button" or node.box is None or app not in node.app:
            return False
        return node.box[1] <= middle <= node.box[3] and node.box[0] >= beside.centre[0]

    field = hand.wait(f"field of {label}", is_field)
    hand.double_click(field)
    hand.replace(str(number))
    hand.press("tab")
    hand.wait(f"{number} for {label}", lambda node: is_field(node) and node.text == str(number))
