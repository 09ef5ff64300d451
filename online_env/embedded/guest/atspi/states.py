"""State and role numbers of AT-SPI 2.46 (atspi-constants.h)."""

STATES = (
    "invalid",
    "active",
    "armed",
    "busy",
    "checked",
    "collapsed",
    "defunct",
    "editable",
    "enabled",
    "expandable",
    "expanded",
    "focusable",
    "focused",
    "has_tooltip",
    "horizontal",
    "iconified",
    "modal",
    "multi_line",
    "multiselectable",
    "opaque",
    "pressed",
    "resizable",
    "selectable",
    "selected",
    "sensitive",
    "showing",
    "single_line",
    "stale",
    "transient",
    "vertical",
    "visible",
    "manages_descendants",
    "indeterminate",
    "required",
    "truncated",
    "animated",
    "invalid_entry",
    "supports_autocompletion",
    "selectable_text",
    "is_default",
    "visited",
    "checkable",
    "has_popup",
    "read_only",
)
ACTIVE, FOCUSED, SHOWING, VISIBLE, MANAGES_DESCENDANTS = (
    1 << STATES.index(name)
    for name in ("active", "focused", "showing", "visible", "manages_descendants")
)

DESKTOP_ICON_STATES = sum(
    1 << STATES.index(name) for name in ("enabled", "selectable", "sensitive", "showing", "visible")
)

INVALID = 0
INVALID_NAME = "invalid"
ALERT = 2
DIALOG = 16
FILE_CHOOSER = 19
FRAME = 23
ICON = 26
TOOL_TIP = 64
WINDOW = 69
MENU = 33
MENU_BAR = 34
POPUP_MENU = 41
ROOT_PANE = 46
SCROLL_PANE = 49
TABLE = 55
TERMINAL = 60
VIEWPORT = 68
EXTENDED = 70
PARAGRAPH = 73
ENTRY = 79
TEXT = 61
DOCUMENT_TEXT = 94
DOCUMENT_WEB = 95
TOP_LEVEL = frozenset({ALERT, DIALOG, FILE_CHOOSER, FRAME, TOOL_TIP, WINDOW, MENU, POPUP_MENU})
MENUS = frozenset({MENU, POPUP_MENU})
CLIPPING = frozenset({SCROLL_PANE, VIEWPORT, FRAME, DIALOG, WINDOW})
# What these hold can't be known from their names, so it is read also where another window covers
# them.
WRITTEN = frozenset({ENTRY, TEXT, TERMINAL, PARAGRAPH, DOCUMENT_TEXT})
