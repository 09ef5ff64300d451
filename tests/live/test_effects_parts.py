"""Parts of the effects that need no desktop: the registry, the rules, what a tree offers, how the
network is read."""

import json
import re
import socket
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

from hypothesis import given
from hypothesis import strategies as st

import hijack_data as hj
from hijack_data.corruptions.multi_apps import APPS
from hijack_data.errors import ParameterError, UnknownNameError
from hijack_data.plan import Effect
from hijack_data.rng import Stream
from online_env.desktops.protocol import CAPABILITIES, RunResult
from online_env.effects import (
    EffectError,
    LiveEffect,
    Probe,
    Undone,
    base,
    find,
    firewall_rules,
    kinds,
    perform,
    register,
    resume,
)
from online_env.effects.accidental_touch import _is_part_of_panel, _is_reachable
from online_env.effects.apps import COMMANDS
from online_env.effects.elements import Element, draw_element, live_elements
from online_env.effects.guest import Guest, isolated
from online_env.effects.launchers import launches_application
from online_env.effects.multi_apps import _misplaced
from online_env.embedded.guest import inside
from online_env.embedded.guest.accessibility_tree import NAMESPACES
from online_env.embedded.guest.inside import locktool, nettool, xtool
from online_env.errors import DesktopError, MissingCapabilityError


def desktop(answer=None, capabilities=CAPABILITIES):
    """A desktop that gives one answer to every command."""
    calls = []

    def execute(argv, timeout=60):
        calls.append(argv)
        return answer

    return SimpleNamespace(execute=execute, capabilities=capabilities, calls=calls)


@pytest.fixture
def own_kind(monkeypatch):
    monkeypatch.setattr(base.EFFECTS, "entries", dict(base.EFFECTS.entries))


def test_every_effect_that_a_corruption_plans_can_be_performed():
    scene = hj.Scene(size=(1080, 1920), boxes=[[10, 10, 50, 50]])
    plans = [
        hj.make_corruption(name).plan(scene, seed=1, step=step)
        for name in hj.corruption_names()
        for step in (-1, 0, 3)
    ]
    planned_kinds = {effect.kind for plan in plans for effect in plan.effects}
    assert planned_kinds == {"launch_app", "touch", "minimise", "firewall", "lock"} <= set(kinds())
    assert all(find(kind).needs <= CAPABILITIES for kind in planned_kinds)


def test_unknown_kind_gets_a_suggestion():
    with pytest.raises(UnknownNameError, match="did you mean 'firewall'"):
        perform(Effect("firewal"), desktop())


def test_plug_in_effect(own_kind):
    @register
    class Beep(LiveEffect):
        """Beeps."""

        kind = "beep"

        def apply(self, guest, params):
            return {"times": params["times"]}

        def probe(self, guest, record):
            return Probe(record["times"] > 0, {"times": record["times"]})

        def undo(self, guest, record):
            return Undone(True)

    result = perform(Effect("beep", {"times": 2}), desktop())
    assert result.probe() == Probe(True, {"times": 2})
    assert result.undo().ok
    again = resume(json.loads(json.dumps(result.record)), desktop())
    assert again.probe().ok
    assert [len(again.record["probes"]), len(again.record["undone"])] == [2, 1]
    assert len(result.record["probes"]) == 1, "the record that was read must not change"


@pytest.mark.parametrize(
    "host", ["10.0.0.1 accept\nRULES\ntouch /tmp/owned\n#", "fe80::1%$(id)", "", 7, None]
)
def test_a_guest_that_was_taken_over_writes_nothing_into_the_rules_that_root_sets(host):
    scripts = []

    def root(script):
        scripts.append(script)
        return RunResult("success", "", "", 0)

    entries = {"interfaces": ["eth0"], "hosts": ["192.0.2.1", host], "reached": []}
    guest = SimpleNamespace(capabilities=CAPABILITIES, network_root=root, tool=lambda *_: entries)
    with pytest.raises(EffectError, match="the guest names a controlling host that is no address"):
        perform(Effect("firewall"), guest)
    assert scripts == ["nft list tables"]
    entries["hosts"].pop()
    assert perform(Effect("firewall"), guest).record["did"]["hosts"] == ["192.0.2.1"]


@pytest.mark.parametrize(
    ("box", "covers"),
    [
        ([0, 0, 1920, 1080], True),
        ([-5, -5, 1925, 1085], True),
        ([-5, 400, 1925, 450], False),  # a strip that is wider than the screen
        ([0, 0, 1925, 40], False),
        ([-1, 1, 1920, 1080], False),
    ],
)
def test_a_window_covers_the_screen_in_both_directions_or_not_at_all(box, covers):
    assert locktool.covers(box, 1920, 1080) is covers


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (RunResult("success", "", "", 0), "geany could not be started: "),
        (RunResult("success", "", "sh: Cannot fork", 2), "geany could not be started: .*fork"),
        (RunResult("error", "", "timed out"), "shell script did not run in the guest: timed out"),
    ],
)
def test_an_application_that_could_not_be_started_ends_no_session(answer, problem):
    state = {"windows": [], "active": 0, "area": [0, 0, 100, 100]}
    ran = []

    def execute(argv, timeout=60):
        ran.append(argv[2])
        if "command -v" in argv[2]:
            return RunResult("success", "setsid geany", "", 0)
        return answer

    guest = SimpleNamespace(capabilities=CAPABILITIES, execute=execute, tool=lambda *_: state)
    with pytest.raises(DesktopError, match=problem):
        perform(Effect("launch_app", {"app": "vscode"}), guest)
    assert not [script for script in ran if "pkill" in script]


@pytest.mark.parametrize("kind", ["launch_app", "lock"])
def test_a_guest_that_cannot_be_asked_does_not_count_as_one_that_lacks_something(kind):
    busy = desktop(RunResult("error", "", "Command timed out after 60 seconds"))
    busy.tool = lambda *_: {"windows": [], "active": 0, "area": [0, 0, 100, 100]}
    with pytest.raises(DesktopError, match="did not run in the guest: Command timed") as result:
        perform(Effect(kind, {"app": "vscode"}), busy)
    assert not isinstance(result.value, MissingCapabilityError)


def test_incomplete_and_taken_kinds_are_refused(own_kind):
    class Half(LiveEffect):
        kind = "half"

        def apply(self, guest, params):
            return {}

    class Whole(Half):
        kind = "lock"
        probe = undo = lambda self, guest, record: None

    with pytest.raises(ParameterError, match="probe, undo is missing"):
        register(Half)
    with pytest.raises(ParameterError, match=r"'lock' is taken by online_env.effects.verification"):
        register(Whole)
    Whole.kind = ""
    with pytest.raises(ParameterError, match="kind is not set"):
        register(Whole)


@pytest.mark.parametrize("kind", ["launch_app", "touch", "minimise", "firewall", "lock"])
def test_missing_capability_is_named_before_anything_is_done(kind):
    lacking = desktop(capabilities=frozenset({"files"}))
    with pytest.raises(
        MissingCapabilityError,
        match=rf"{kind}.* needs .*{sorted(find(kind).needs)[0]}.*available: files",
    ):
        perform(Effect(kind, {"app": "vscode"}), lacking)
    assert lacking.calls == []


@pytest.mark.parametrize(
    "broken", [{}, {"effect": "lock"}, {"effect": "lock", "params": 3, "did": {}}, {"did": 1}]
)
def test_damaged_records_are_refused(broken):
    with pytest.raises(EffectError, match="not the record of an applied effect"):
        resume(broken, desktop())


def test_tools_that_fail_in_the_guest_say_why():
    no_xlib = RunResult("success", "", "ModuleNotFoundError: No module named 'Xlib'", 1)
    with pytest.raises(MissingCapabilityError, match="python3-xlib"):
        perform(Effect("minimise"), desktop(no_xlib))
    with pytest.raises(MissingCapabilityError, match="no python3"):
        perform(
            Effect("minimise"),
            desktop(RunResult("error", "", "'python3' does not start: No such file")),
        )
    with pytest.raises(DesktopError, match="Can't connect to display"):
        perform(
            Effect("minimise"), desktop(RunResult("success", "", "Can't connect to display", 1))
        )
    with pytest.raises(DesktopError, match="not JSON"):
        perform(Effect("minimise"), desktop(RunResult("success", "hello", "", 0)))


def test_namespace_that_is_gone(tmp_path):
    missing_desktop = SimpleNamespace(namespace=tmp_path / "none")
    with pytest.raises(DesktopError, match="is gone"):
        Guest(missing_desktop, "", None).root("true")


LOOK = """import json, os, sys
print(json.dumps([sys.flags.isolated, sys.executable, os.getcwd(), sorted(os.environ), sys.argv[1:], json.__file__]))
"""


def test_tools_run_apart_from_all_that_is_the_users(tmp_path):
    """Variables, PATH, the working directory and the home all lead to something of the user's."""
    packages = (
        tmp_path
        / ".local/lib"
        / f"python{sys.version_info[0]}.{sys.version_info[1]}"
        / "site-packages"
    )
    packages.mkdir(parents=True)
    for parent in (tmp_path, packages):
        for name in ("json", "sitecustomize", "usercustomize"):
            (parent / f"{name}.py").write_text("print('forged'); raise SystemExit(0)")
    for name in ("python3", "env"):
        (tmp_path / name).write_text("#!/bin/sh\necho forged\n")
        (tmp_path / name).chmod(0o755)
    names = ("PATH", "HOME", "PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "LD_LIBRARY_PATH")
    hostile = dict.fromkeys(names, str(tmp_path))
    hostile["DISPLAY"] = ":7"
    command = isolated(LOOK, "state", "{}")
    process = subprocess.run(
        command, env=hostile, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    alone, program, folder, variables, options, module = json.loads(process.stdout)
    assert (alone, folder, options) == (1, "/", ["state", "{}"])
    assert program.startswith("/usr/bin/")
    assert {"DISPLAY", "HOME", "PATH", "XAUTHORITY"} <= set(variables)
    assert not [name for name in variables if name.startswith(("PYTHON", "LD_"))]
    assert not module.startswith(str(tmp_path))


def test_tools_need_nothing_of_ours():
    for path in Path(inside.__file__).parent.glob("*.py"):
        ours = r"^from \.(?!ewmh )|^(from|import) (online_env|hijack_data)"
        assert not re.search(ours, path.read_text(), re.MULTILINE), path
        text = inside.source(path.stem)
        assert len(text) < 100_000, "it must fit into one argument of a command"


def test_every_application_of_the_list_has_a_command():
    assert tuple(COMMANDS) == APPS
    assert all(
        command.argv and command.classes for commands in COMMANDS.values() for command in commands
    )


# rules


def in_namespace(script):
    """Run a shell script in a network namespace of its own, with two interfaces."""
    needs.network_namespaces()
    # Without IPv6, or its router solicitations would be counted at some moment too.
    setup = """export PATH=$PATH:/usr/sbin:/sbin
    echo 1 > /proc/sys/net/ipv6/conf/default/disable_ipv6
    ip link add eth0 type veth peer name far; for device in lo eth0 far; do ip link set $device up; done
    ip addr add 192.0.2.2/24 dev eth0; ip route add default via 192.0.2.1
    """
    return subprocess.run(
        ["unshare", "-n", "sh", "-c", setup + script], capture_output=True, text=True, check=False
    )


@needs.needs_apps("nft", "iptables")
@pytest.mark.parametrize("tool", ["nft", "iptables"])
def test_rules_count_what_they_drop_and_go_without_a_trace(tool):
    shut, free = getattr(firewall_rules, f"{tool}_close"), getattr(firewall_rules, f"{tool}_open")()
    count = getattr(firewall_rules, f"{tool}_count")()
    listing = "nft list ruleset" if tool == "nft" else "iptables-save | grep -v '^#'"
    ping = 'python3 -c \'import socket; socket.socket(2, 2).sendto(b"x", ("{}", 9))\''
    foreign = "nft add table inet other; iptables -N OTHER; iptables -A OUTPUT -j OTHER"
    close = f"{{ {shut(['eth0'], ['192.0.2.1', '2001:db8::1'])}\n}} || exit"
    script = f"""{foreign}
    {close} 7
    {close} 8
    {ping.format("192.0.2.1")}; {ping.format("127.0.0.1")}; {ping.format("198.51.100.7")}
    echo @; {count}; echo @; {{ {free}
    }} || exit 9
    {{ {free}
    }} || exit 10
    {listing}"""
    result = in_namespace(script)
    assert result.returncode == 0, result.stderr
    _, counter_text, remaining_text = result.stdout.split("@")
    assert firewall_rules.dropped(counter_text) == 1, (
        "only what is for neither loopback nor the host is dropped"
    )
    assert "agenthijack" not in remaining_text.lower()
    assert "other" in remaining_text.lower(), "rules of others must stay"


@given(st.lists(st.integers(0, 10**6), max_size=4))
def test_dropped_reads_both_tools(counts):
    nft = "".join(
        f'  oifname {{ "eth0" }} counter packets {n} bytes {60 * n} drop\n' for n in counts
    )
    iptables = "".join(
        f"  {n:8}  {60 * n} DROP  0  --  *  eth0  0.0.0.0/0  0.0.0.0/0\n" for n in counts
    )
    assert firewall_rules.dropped(nft + "counter packets 5 bytes 9 accept\n") == sum(counts)
    assert firewall_rules.dropped(
        "Chain AGENTHIJACK_OUT (1 references)\n 9 9 ACCEPT 0\n" + iptables
    ) == sum(counts)


# the network as a guest sees it


def test_default_routes_and_controllers_are_found(monkeypatch):
    zero = "0" * 32
    v6 = f"{zero} 00 {zero} 00 fe80{'0' * 28} 00000064 0 0 {{}} {{}}"
    peer6 = "0000000000000000FFFF00000500C70A"
    files = {
        "/proc/net/route": [
            "head",
            "eth0 00000000 01004D0A 0003 0 0 0 00000000",
            "eth0 00004D0A 0 0001 0 0 0 00FFFFFF",
            "bad 00000000 0 0203 0 0 0 00000000",
        ],
        "/proc/net/ipv6_route": [v6.format("00000003", "wlan0"), v6.format("00200200", "lo")],
        "/etc/resolv.conf": ["# x", "nameserver 127.0.0.53", "search a", "nameserver 10.0.0.1"],
        "/proc/net/tcp": [
            "head",
            "0: 00000000:1388 00000000:0000 0A",
            "1: 0600C70A:1388 0600C70A:ED5A 01",
            "2: 0600C70A:9999 0101A8C0:0050 01",
            "3: 0100007F:1388 0100007F:1111 01",
        ],
        "/proc/net/tcp6": ["head", f"0: {zero}:1388 {peer6}:AAAA 01"],
    }
    monkeypatch.setattr(nettool, "_lines", lambda path: files.get(path, []))
    assert nettool.interfaces() == ["eth0", "wlan0"]
    assert nettool.hosts() == ["10.199.0.5", "10.199.0.6"]
    assert nettool.name_servers() == ["127.0.0.53", "10.0.0.1"]


def test_reach_tells_what_answers():
    with (
        socket.create_server(("127.0.0.1", 0)) as open_port,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as names,
    ):
        names.bind(("127.0.0.1", 0))
        port = open_port.getsockname()[1]
        answering = threading.Thread(target=lambda: open_port.accept()[0].close(), daemon=True)
        answering.start()
        reached = nettool.reach([{"kind": "tcp", "host": "127.0.0.1", "port": port}], 20)["reached"]
        answering.join()  # while it accepts, the port is open, whoever closes it
        assert (reached[0]["ok"], reached[0]["address"]) == (True, "127.0.0.1")
    closed_port = nettool.reach([{"kind": "tcp", "host": "127.0.0.1", "port": port}], 20)[
        "reached"
    ][0]
    assert not closed_port["ok"]
    assert "refused" in closed_port["error"]
    assert nettool.reach([], 1) == {"reached": []}


# what a tree offers


def tree(*apps):
    spaces = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in NAMESPACES.items())
    return f"<desktop-frame {spaces}>{''.join(apps)}</desktop-frame>"


def node(role, name, x, extra='st:enabled="true"'):
    position = f'cp:screencoord="({x}, 5)" cp:size="(20, 10)"'
    return f'<{role} name="{name}" st:showing="true" st:visible="true" {position} {extra}/>'


def test_elements_keep_what_acts():
    acts = 'st:enabled="true" act:click_desc=""'
    disabled = 'act:click_desc=""'
    links = (
        node("push-button", "Go", 10, acts)
        + node("link", "dead", 40)
        + node("link", "off", 70, disabled)
    )
    browser = f'<application name="Google Chrome">{links}</application>'
    silent = f'<application name="mousepad">{node("text", "body", 100)}</application>'
    panel = (
        f'<application name="xfce4-panel">{node("push-button", "Menu", 130, acts)}</application>'
    )
    result = live_elements(tree(browser, silent, panel), (100, 200))
    names = [(element.app, element.name) for element in result]
    assert names == [("Google Chrome", "Go"), ("mousepad", "body"), ("xfce4-panel", "Menu")]
    assert result[0].centre == (20, 10)


def test_windows_that_cannot_be_read_are_an_error_and_not_none(monkeypatch):
    """python-xlib of 2014 lacks what newer Pythons took away, and that must not look empty."""
    screen: Any = SimpleNamespace(root=None, numbers=lambda window, name: [7])
    monkeypatch.setattr(xtool, "describe", lambda screen, number: None)
    monkeypatch.setattr(xtool, "LIST_TIMEOUT_S", 0.05)
    with pytest.raises(RuntimeError, match="cannot be read"):
        xtool.listed(screen)
    screen.numbers = lambda window, name: []
    assert xtool.listed(screen) == []


def window(
    name: str, kind: str, frame: list[int], states: list[str] | None = None
) -> dict[str, Any]:
    """Return a window as `xtool state` describes it."""
    entries = {"id": id(frame), "class": f"{name}.{name.title()}", "type": kind, "frame": frame}
    return {**entries, "mapped": True, "states": states or [], "for": 0}


PANEL = window("xfce4-panel", "dock", [0, 80, 200, 100])
DESKTOP = window("xfdesktop", "desktop", [0, 0, 200, 100])
BROWSER = window("chromium", "normal", [0, 0, 200, 80])
PREFERENCES = window("xfce4-panel", "dialog", [50, 10, 150, 70])


def element_at(app: str, at: tuple[int, int], name: str = "it", role: str = "push-button"):
    x, y = at
    return Element(app, role, name, (x - 2, y - 2, x + 2, y + 2))


@pytest.mark.parametrize(
    ("app", "at", "windows", "reachable", "of_panel"),
    [
        ("Google Chrome", (20, 20), [DESKTOP, BROWSER, PANEL], True, False),
        ("Google Chrome", (20, 20), [DESKTOP, PANEL], False, False),  # it is minimised
        ("mousepad", (20, 20), [], True, False),  # no window manager
        ("xfce4-panel", (20, 90), [DESKTOP, BROWSER, PANEL], True, True),
        ("xfdesktop", (20, 20), [DESKTOP, PANEL], True, True),
        ("xfce4-panel", (20, 90), [], True, True),
        # A menu of the panel is no managed window: what is behind it is at its place.
        ("xfce4-panel", (20, 20), [DESKTOP, BROWSER, PANEL], True, True),
        # A dialog of the panel is a window like any other: a task may be about it.
        ("xfce4-panel", (60, 20), [DESKTOP, PANEL, PREFERENCES], True, False),
    ],
)
def test_what_a_touch_reaches(app, at, windows, reachable, of_panel):
    state = {"windows": windows}
    assert _is_reachable(element_at(app, at), state) == reachable
    assert _is_part_of_panel(element_at(app, at), state) == of_panel


@pytest.mark.parametrize(
    ("app", "role", "name", "launches"),
    [
        ("xfce4-panel", "push-button", "Text Editor", True),
        ("xfce4-panel", "menu-item", "Run Program...", True),
        ("gnome-shell", "push-button", "Firefox Web Browser", True),
        ("xfdesktop", "icon", "notes.txt", True),
        ("gjs", "push-button", "Home", True),
        ("mate-panel", "push-button", "", True),  # nothing shows that it launches nothing
        ("xfce4-panel", "toggle-button", "Applications", False),
        ("xfce4-panel", "toggle-button", "Wed 04 Mar   10:05", False),
        ("wrapper-2.0", "push-button", "Notifications", False),
        ("xfce4-panel", "menu", "Settings", False),
        ("xfce4-panel", "menu-item", "Properties", False),
        ("xfdesktop", "menu-item", "Arrange Desktop Icons", False),
        ("xfce4-panel", "toggle-button", "Terminal", False),  # the button of a window
        ("gnome-shell", "toggle-button", "Text Editor", True),  # no window has this title
    ],
)
def test_a_launcher_bears_the_name_of_an_application(app, role, name, launches):
    applications = {"text editor", "run program...", "firefox web browser", "terminal", "settings"}
    element = element_at(app, (20, 20), name, role)
    assert launches_application(element, applications, {"terminal"}) == launches


@pytest.mark.parametrize(
    ("frame", "box", "names"),
    [
        ([60, 32, 150, 92], [38, 9, 172, 115], []),  # GTK 4 counts from the corner of its window
        ([0, 0, 90, 60], [-22, -23, 112, 83], ["Go"]),  # its window is in that corner
    ],
)
def test_elements_whose_places_are_not_those_of_the_screen_are_left_out(frame, box, names):
    position = 'cp:screencoord="(0, 0)" cp:size="(90, 60)"'
    files = f'<frame name="Documents" {position}>{node("push-button", "Go", 10)}</frame>'
    xml = tree(f'<application name="org.gnome.Nautilus">{files}</application>')
    windows = [{**window("org.gnome.Nautilus", "normal", frame), "box": box, "title": "Documents"}]
    assert [element.name for element in live_elements(xml, (100, 200), windows)] == names
    assert [element.name for element in live_elements(xml, (100, 200))] == ["Go"]


@pytest.mark.parametrize("bad", ["", "<a", "no xml", "<a><b></a>"])
def test_trees_that_are_none_are_refused(bad):
    with pytest.raises(DesktopError, match="cannot be read"):
        live_elements(bad, (10, 10))


def test_draw_prefers_the_plan_then_the_stream():
    xml = tree(
        "<application"
        f' name="a">{"".join(node("link", str(i), 25 * i) for i in range(6))}</application>'
    )
    result = live_elements(xml, (100, 200))
    assert draw_element(result, [(0, 0, 3, 3), (52, 6, 72, 16)], Stream(1, "t")).name == "2"
    assert draw_element([], [(52, 6, 72, 16)], Stream(1, "t")) is None
    names = {draw_element(result, [], Stream(seed, "t")).name for seed in range(40)}
    assert names == {str(i) for i in range(6)}


def test_misplaced_allows_for_what_cannot_be_smaller():
    window = {
        "title": "w",
        "frame": [960, 0, 1920, 1043],
        "box": [961, 24, 1919, 1042],
        "least": [0, 0],
    }
    requests = [960, 0, 1920, 1043]
    assert _misplaced(window, requests) == []
    assert _misplaced({**window, "frame": [900, 0, 1860, 1043]}, requests)
    wide = {**window, "frame": [960, 0, 2100, 1043], "box": [961, 24, 2099, 1042]}
    assert _misplaced(wide, requests)
    assert not _misplaced({**wide, "least": [1138, 0]}, requests)
    assert _misplaced(None, requests) == ["the window beside it is gone"]


def test_a_window_behind_its_modal_dialog_is_not_touched():
    def window(number, frame, **more):
        return {
            "id": number,
            "mapped": True,
            "frame": frame,
            "type": "normal",
            "for": 0,
            "states": [],
            **more,
        }

    main, beside = window(1, [0, 0, 100, 100]), window(2, [200, 0, 300, 100])
    dialog = window(3, [40, 40, 60, 60], type="dialog", **{"for": 1}, states=["modal"])
    places = {"main": (10, 10, 20, 20), "dialog": (45, 45, 55, 55), "beside": (210, 10, 220, 20)}

    def seen(*windows):
        state = {"windows": list(windows)}
        return {
            name
            for name, box in places.items()
            if _is_reachable(Element("app", "push-button", name, box), state)
        }

    assert seen(main, beside, dialog) == {"dialog", "beside"}
    assert seen(main, beside, {**dialog, "states": []}) == {"main", "dialog", "beside"}
