"""The desktop as a person uses it: its shortcuts, what opens a file, fonts, notifications, and no
noise."""

import pytest

from support.waiting import until

FILES = """
cd /tmp
python3 -c 'from PIL import Image; Image.new("RGB", (64, 48)).save("shown.png")'
python3 -c 'from PIL import Image; Image.new("RGB", (64, 48)).save("shown.pdf")'
zip -q shown.zip shown.png
printf '\\001\\002\\003' > shown.bin
"""


@pytest.fixture(scope="module")
def files(embedded_desktop):
    """A desktop with a picture, a document, an archive and a file of no known type in /tmp."""
    result = embedded_desktop.execute(FILES)
    assert result.ok, result.error
    return embedded_desktop


def windows(desktop) -> str:
    return desktop.execute("wmctrl -lx").output


@pytest.mark.parametrize(
    ("name", "window"), [("png", "ristretto"), ("pdf", "evince"), ("zip", "xarchiver")]
)
def test_a_file_opens_in_its_application(files, name, window):
    result = files.execute(f"xdg-open /tmp/shown.{name}")
    assert result.ok, result.error
    until(lambda: window in windows(files).lower())
    files.execute(f"wmctrl -xc {window}")


def test_what_cannot_be_opened_is_told(files):
    unknown = files.execute("xdg-open /tmp/shown.bin")
    assert not unknown.ok
    assert "no application here opens '/tmp/shown.bin'" in unknown.error
    missing = files.execute("xdg-open /tmp/nothing.png", timeout=20)
    assert missing.returncode == 2
    assert "'/tmp/nothing.png' does not exist" in missing.error


@pytest.mark.parametrize("keys", [("win", "d"), ("ctrl", "alt", "d")])
def test_a_shortcut_shows_the_desktop_and_the_windows_again(files, keys):
    def mode() -> str:
        return files.execute("wmctrl -m").output.rpartition("mode: ")[2].strip()

    for expected in ("ON", "OFF"):
        assert files.run(f"pyautogui.hotkey(*{keys})").ok
        until(lambda: mode() == expected)  # noqa: B023 - looked at before the next turn


@pytest.mark.parametrize(
    ("keys", "window"),
    [(("alt", "f2"), "xfce4-appfinder"), (("printscreen",), "xfce4-screenshooter")],
)
def test_a_shortcut_opens_a_window(files, keys, window):
    assert files.run(f"pyautogui.hotkey(*{keys})").ok
    until(lambda: window in windows(files).lower())
    files.run("pyautogui.press('esc')")


@pytest.mark.parametrize("language", ["zh", "ja", "ko"])
def test_letters_have_a_font(files, language):
    assert files.execute(f"fc-list :lang={language}").output.strip()


def test_emoji_have_a_font(files):
    assert "Emoji" in files.execute("fc-match emoji").output


def test_a_notification_is_shown(files):
    assert files.execute("notify-send News 'It has come'").ok
    until(lambda: "notifyd" in files.execute("ps -e -o comm=").output)


def test_applications_say_nothing_on_standard_error(files):
    started = files.execute(
        "(mousepad >/tmp/said 2>&1 &) ; sleep 3; cat /tmp/said; wmctrl -xc mousepad"
    )
    assert started.output == ""


def test_browser_says_nothing_on_standard_error(files, browser_machine):
    command = (
        "(google-chrome about:blank >/tmp/said 2>&1 &) ; sleep 5; cat /tmp/said; wmctrl -xc"
        " chromium"
    )
    assert files.execute(command).output == ""
