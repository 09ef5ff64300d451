"""VLC: its settings, its playlists, and its windows as an oracle uses them."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from posixpath import normpath
from urllib.parse import unquote, urlsplit

from ..hand import Hand, Name
from ..machine import Machine
from ..tree_nodes import TreeNode

VLC = "vlc"
IDLE = "VLC media player"  # the title of the window while nothing is played
_RC = ".config/vlc/vlcrc"
_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")
_FILE = re.compile(r".+\.\w{3}")
_PICKER = re.compile("Select|Save|Open File")
_XSPF = "{http://xspf.org/ns/0/}"
# The settings that a task begins with. A desktop has no sound card; without `aout`, VLC complains.
_FIRST = {
    "qt": {"qt-privacy-ask": "0", "qt-updates-notif": "0"},
    "core": {"metadata-network-access": "0", "aout": "adummy"},
}
# What VLC writes, or leaves out, for each page of its preferences that was looked at.
_SAID_ANYWAY = re.compile(
    "vout=any|freetype-font=.*|sout-x264-(preset=ultrafast|tune=film)"
    "|(qt-updates-notif|metadata-network-access)="
)


def prepare(machine: Machine) -> None:
    """Give VLC the settings that a task begins with."""
    parts = [f"[{section}]\n{_lines(values)}" for section, values in _FIRST.items()]
    machine.write(_RC, "\n".join(parts))


def _lines(values: Mapping[str, str]) -> str:
    return "".join(f"{key}={value}\n" for key, value in values.items())


def settings(machine: Machine) -> dict[str, str]:
    """Return the settings that differ from VLC's own."""
    values: dict[str, str] = {}
    for line in (machine.text(_RC) or "").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith(("#", "[")):
            values[key] = value
    return values


def store(machine: Machine, values: Mapping[str, str]) -> None:
    """Write settings into VLC's file, for the results of `wrong_results`."""
    lines = (machine.text(_RC) or "").splitlines()
    lines_kept = [line for line in lines if line.partition("=")[0] not in values]
    machine.write(_RC, "\n".join(lines_kept) + f"\n[core]\n{_lines(values)}")


def setting_problems(machine: Machine, expected: Mapping[str, str]) -> Iterator[str]:
    """Yield settings that are not as they should be, and others that were changed.

    Args:
        machine: Where VLC is.
        expected: Settings that should have been made, by name.
    """
    after = settings(machine)
    before = {key: value for part in _FIRST.values() for key, value in part.items()}
    for key, value in expected.items():
        if after.get(key, "").strip().rstrip("/") != value:
            yield f"{key} is {after.get(key, 'as VLC has it')}, not {value}"
    for key in sorted({*after, *before} - {*expected}):
        value = after.get(key, "")
        if value != before.get(key) and not _SAID_ANYWAY.fullmatch(f"{key}={value}"):
            yield f"{key} was changed to {value or 'what VLC has'}"


def playlist(machine: Machine, path: str) -> list[str] | None:
    """Return the files of a playlist, XSPF or M3U, from the root; `None` if there is no such file.

    Places on the network stay addresses.
    """
    text = machine.text(path)
    if text is None:
        return None
    if text.lstrip().startswith("<"):
        entries = _read_xspf(text)
    else:
        entries = [line.strip() for line in text.splitlines() if line.strip()[:1] not in ("", "#")]
    folder = PurePosixPath(machine.path(path)).parent
    return [_entry_path(folder, name) for name in entries]


def _read_xspf(text: str) -> list[str]:
    try:
        root = ET.fromstring(text)
    except ET.ParseError:
        return []
    return [_local_path((node.text or "").strip()) for node in root.iter(f"{_XSPF}location")]


def _local_path(address: str) -> str:
    """Return the path of a file from its address; other addresses are returned as they are."""
    try:
        parts = urlsplit(address)
    except ValueError:  # no address at all
        return address
    return unquote(parts.path) if parts.scheme in ("file", "") else address


def _entry_path(folder: PurePosixPath, name: str) -> str:
    name = _local_path(name) if name.startswith("file:") else name
    return name if _ADDRESS.match(name) else normpath(folder / name)


# The windows


def leave_dialogs(hand: Hand) -> None:
    """Close dialogs of VLC that an earlier try left open."""
    for _ in range(4):
        if hand.see("dialog", app=VLC) is None:
            return
        hand.press("escape")


def pick_file(hand: Hand, path: str) -> None:
    """Give a dialog for files, which is open, a path; it is confirmed.

    Args:
        hand: The hand.
        path: From the root, or relative to the home folder.
    """
    dialog = hand.find("dialog", _PICKER, VLC)
    hand.find("text", "File name:", VLC, "focused")
    hand.replace(hand.path(path) + "\n")
    hand.wait_until_gone("dialog", dialog.name, VLC)


def empty_playlist(hand: Hand) -> None:
    """Show the playlist, and take everything out of it."""
    leave_dialogs(hand)
    if hand.see("column-header", "Title", VLC) is None:
        hand.press("ctrl", "l")
        hand.find("column-header", "Title", VLC)
    entry = hand.see("tree-item", _FILE, VLC)
    if entry is not None:
        hand.click(entry)
        hand.press("ctrl", "a")
        hand.press("delete")
        hand.wait_until_gone("tree-item", _FILE, VLC)


def pause_at(hand: Hand, seconds: int) -> None:
    """Go to a time of the film, less than an hour, and stop there."""
    leave_dialogs(hand)
    if hand.see("frame", IDLE, VLC) is not None:
        hand.press("space")  # the film has come to its end
    hand.press("ctrl", "t")
    hand.find("dialog", "Go to Time", VLC)
    hand.find("spin-box", app=VLC, state="focused")
    minutes, remainder = divmod(seconds, 60)
    hand.type(f"00{minutes:02}{remainder:02}\n")
    hand.wait_until_gone("dialog", "Go to Time", VLC)
    hand.press("e")  # the next picture, and no further


def tick(hand: Hand, name: str) -> None:
    """Tick a box, unless it is ticked."""
    if "checked" not in hand.find("check-box", name, VLC).states:
        hand.click_on("check-box", name, VLC)
        hand.find("check-box", name, VLC, "checked")


def preferences(hand: Hand, page: str) -> None:
    """Open a page of the simple preferences: `preferences(hand, "Video")`."""
    leave_dialogs(hand)
    hand.press("ctrl", "p")
    hand.click_on("check-box", page, VLC)
    hand.find("label", re.compile(f"{page[:8]}.*Settings"), VLC)


def choose(hand: Hand, label: Name, option: str) -> None:
    """Choose an option of the drop-down list that stands beside a label."""
    label_node = hand.find("label", label, VLC)
    hand.click(hand.wait(f"list beside {label}", lambda node: _is_beside(node, label_node)))
    hand.type(f"{option}\n")
    hand.wait(
        f"{option} beside {label}",
        lambda node: node.name == option and _is_beside(node, label_node),
    )


def save_preferences(hand: Hand) -> None:
    """Save the preferences, which are open."""
    hand.button("Save", VLC)
    hand.wait_until_gone("dialog", app=VLC)


def _is_beside(node: TreeNode, label: TreeNode) -> bool:
    """Return whether a node is the drop-down list to the right of a label."""
    if node.role != "combo-box" or node.box is None or label.box is None:
        return False
    return VLC in node.app and node.box[1] == label.box[1] and node.box[0] >= label.box[2]
