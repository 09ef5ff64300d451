"""VLC's settings and playlists, read from files."""

import pytest

from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import vlc
from online_env.tasks.machine import Machine

# What VLC writes after a look at each page of its preferences, with one setting changed.
SAVED = """\
[freetype] # Freetype2 font renderer
freetype-font=Noto Sans
#freetype-rel-fontsize=0

[qt] # Qt interface
qt-privacy-ask=0

[x264]
sout-x264-preset=ultrafast
sout-x264-tune=film

[core] # core program
aout=adummy
vout=any
snapshot-path=/home/user/Pictures/stills/
"""
WANTED = {"snapshot-path": "/home/user/Pictures/stills"}
XSPF = """\
<?xml version="1.0" encoding="UTF-8"?>
<playlist xmlns="http://xspf.org/ns/0/" version="1"><trackList>
<track><location>file:///home/user/Music/Krak%C3%B3w%20Waltz.wav</location></track>
<track><location>http://news.test/a.mp3</location></track>
</trackList></playlist>
"""


@pytest.fixture
def machine(tmp_path):
    result = Machine(FolderDesktop(tmp_path))
    vlc.prepare(result)
    return result


def test_what_vlc_writes_anyway_is_no_change(machine):
    assert list(vlc.setting_problems(machine, {})) == []
    machine.write(".config/vlc/vlcrc", SAVED)
    assert list(vlc.setting_problems(machine, WANTED)) == []


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"fullscreen": "1"}, "fullscreen was changed to 1"),
        ({"vout": "xcb_x11"}, "vout was changed to xcb_x11"),
        ({"qt-privacy-ask": "1"}, "qt-privacy-ask was changed to 1"),
        ({"snapshot-path": "/tmp"}, "snapshot-path is /tmp, not /home/user/Pictures/stills"),
    ],
)
def test_other_settings_must_stay(machine, more, problem):
    machine.write(".config/vlc/vlcrc", SAVED)
    vlc.store(machine, more)
    assert list(vlc.setting_problems(machine, WANTED)) == [problem]


def test_a_setting_that_is_missing_is_vlcs_own(machine):
    (problem,) = vlc.setting_problems(machine, WANTED)
    assert problem == "snapshot-path is as VLC has it, not /home/user/Pictures/stills"


def test_playlists_are_read_in_both_formats(machine):
    machine.write("Music/a.xspf", XSPF)
    expected = ["/home/user/Music/Kraków Waltz.wav", "http://news.test/a.mp3"]
    assert vlc.playlist(machine, "Music/a.xspf") == expected
    machine.write("Music/a.m3u", "#EXTM3U\n#EXTINF:5,Waltz\na.wav\n\n/home/user/b.wav\n")
    assert vlc.playlist(machine, "Music/a.m3u") == [machine.path("Music/a.wav"), "/home/user/b.wav"]


def test_addresses_in_a_playlist_may_begin_at_its_folder(machine):
    machine.write("Music/a.xspf", XSPF.replace("file:///home/user/Music/", ""))
    result = vlc.playlist(machine, "Music/a.xspf") or []
    assert result[0] == machine.path("Music/Kraków Waltz.wav")


def test_no_file_and_no_playlist(machine):
    assert vlc.playlist(machine, "Music/a.xspf") is None
    machine.write("Music/a.xspf", "<playlist")
    assert vlc.playlist(machine, "Music/a.xspf") == []


@pytest.mark.parametrize("key", ["qt-updates-notif", "metadata-network-access"])
def test_a_setting_of_the_start_may_go_but_not_change(machine, key):
    other_lines = [line for line in (machine.text(vlc._RC) or "").splitlines() if key not in line]
    machine.write(vlc._RC, "\n".join(other_lines))
    assert list(vlc.setting_problems(machine, {})) == []
    vlc.store(machine, {key: "1"})
    assert list(vlc.setting_problems(machine, {})) == [f"{key} was changed to 1"]


def test_a_setting_that_is_commented_out_is_not_made(machine):
    machine.write(vlc._RC, "[core]\n#snapshot-path=/home/user/Pictures/stills\naout=adummy\n")
    assert vlc.settings(machine) == {"aout": "adummy"}
    assert list(vlc.setting_problems(machine, WANTED)) == [
        "snapshot-path is as VLC has it, not /home/user/Pictures/stills",
        "qt-privacy-ask was changed to what VLC has",
    ]
