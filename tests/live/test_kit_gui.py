"""Thunar and the terminal, as the helpers of tasks use them on a real desktop."""

from collections.abc import Iterator

import pytest

from support import needs

pytest.importorskip("lxml", reason=needs.ONLINE)

from online_env.errors import DesktopTimeoutError
from online_env.tasks import Hand, Machine
from online_env.tasks.kit import shell, thunar


@pytest.fixture(scope="module")
def machine(embedded_machine: None) -> Iterator[Machine]:
    """A desktop."""
    from online_env.embedded.desktop import EmbeddedDesktop

    with EmbeddedDesktop.up() as desktop:
        yield Machine(desktop)


def test_thunar_makes_moves_and_renames(machine: Machine) -> None:
    for name in ("a.txt", "b.txt", "c.txt"):
        machine.write(f"Documents/in/{name}", name)
    machine.open("thunar", machine.path("Documents/in"))
    hand = Hand(machine.desktop)
    thunar.go(hand, "Documents/in")
    thunar.make_folder(hand, "sub")
    thunar.make_folder(hand, "sub")
    thunar.move(hand, ["a.txt", "b.txt"], "Documents/in/sub")
    thunar.rename(hand, "a.txt", "d.txt")
    thunar.up(hand, "in")
    assert thunar.present(hand, "a.txt", "c.txt", "sub") == ["c.txt", "sub"]
    assert machine.names("Documents/in/sub") == {"b.txt", "d.txt"}


def test_a_command_is_waited_for(machine: Machine) -> None:
    machine.open("terminal")
    hand = Hand(machine.desktop)
    assert "42" in shell.command(hand, "sleep 1; echo $((6 * 7))").splitlines()
    hand.type("half a line")
    assert "end" in shell.command(hand, "echo end").splitlines()
    with pytest.raises(DesktopTimeoutError, match="did not end"):
        shell.command(hand, "sleep 8", timeout=1)
