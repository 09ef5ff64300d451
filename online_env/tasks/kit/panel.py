"""The panel at the bottom of the screen: start applications, and go from window to window."""

from ..hand import Hand

PANEL = "xfce4-panel"
STARTERS = {
    "chrom": "Web Browser",
    "mousepad": "Text Editor",
    "thunar": "File Manager",
    "xfce4-terminal": "Terminal",
}


def bring_to_front(hand: Hand, app: str) -> None:
    """Bring a window of an application to the front, and start the application if it has none.

    Args:
        hand: The pointer.
        app: A key of `STARTERS`: a part of the application's name in the accessibility tree.
    """
    nodes = hand.look()
    titles = {node.name for node in nodes if node.role == "frame" and app in node.app.lower()}
    buttons = [node for node in nodes if node.app == PANEL and node.role == "toggle-button"]
    own_buttons = [node for node in buttons if node.name in titles and node.box]
    if any("checked" in node.states for node in own_buttons):
        return
    if own_buttons:
        hand.click(own_buttons[0])
    else:
        hand.click_on("push-button", STARTERS[app], app=PANEL)
    hand.find("frame", app=app)
