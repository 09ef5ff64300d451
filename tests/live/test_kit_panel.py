"""Windows from the panel, and text files in Mousepad, on a real desktop."""

from typing import Any

from online_env.tasks import Hand, Machine
from online_env.tasks.kit import notes, panel


def test_an_application_is_started_once_and_then_brought_to_the_front(
    embedded_desktop: Any,
) -> None:
    machine = Machine(embedded_desktop)
    hand = Hand(embedded_desktop)
    machine.open("thunar")
    panel.bring_to_front(hand, "mousepad")
    assert hand.see("frame", app="mousepad") is not None
    panel.bring_to_front(hand, "thunar")
    hand.find("frame", app="thunar", state="active")
    panel.bring_to_front(hand, "thunar")  # a click on its button would minimise it
    hand.find("frame", app="thunar", state="active")
    panel.bring_to_front(hand, "mousepad")
    hand.find("frame", app="mousepad", state="active")
    frames = [node for node in hand.look() if node.role == "frame" and node.app == "mousepad"]
    assert len(frames) == 1
    machine.clear(["thunar", "mousepad"])


def test_a_file_is_written_and_written_again(embedded_desktop: Any) -> None:
    machine = Machine(embedded_desktop)
    hand = Hand(embedded_desktop)
    for text in ("Zwölf 12.50", "Total: $3"):
        notes.take_note(hand, "Documents/list.txt", text)
        assert (machine.text("Documents/list.txt") or "").strip() == text
    machine.run("rm", machine.path("Documents/list.txt"))
    machine.clear(["mousepad"])
