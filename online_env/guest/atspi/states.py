"""State and role numbers of AT-SPI 2.46 (atspi-constants.h)."""

STATES = (
    "invalid", "active", "armed", "busy", "checked", "collapsed", "defunct", "editable", "enabled", "expandable",
    "expanded", "focusable", "focused", "has_tooltip", "horizontal", "iconified", "modal", "multi_line",
    "multiselectable", "opaque", "pressed", "resizable", "selectable", "selected", "sensitive", "showing",
    "single_line", "stale", "transient", "vertical", "visible", "manages_descendants", "indeterminate", "required",
    "truncated", "animated", "invalid_entry", "supports_autocompletion", "selectable_text", "is_default", "visited",
    "checkable", "has_popup", "read_only",
)  # fmt: skip
ACTIVE, FOCUSED, SHOWING, VISIBLE, MANAGES_DESCENDANTS = (
    1 << STATES.index(name) for name in ("active", "focused", "showing", "visible", "manages_descendants")
)

DESKTOP_ICON_STATES = sum(
    1 << STATES.index(name) for name in ("enabled", "selectable", "sensitive", "showing", "visible")
)

ALERT, DIALOG, FILE_CHOOSER, FRAME, ICON, TOOL_TIP, WINDOW = 2, 16, 19, 23, 26, 64, 69
MENU, POPUP_MENU, SCROLL_PANE, TABLE, TERMINAL, VIEWPORT, EXTENDED = 33, 41, 49, 55, 60, 68, 70
PARAGRAPH, ENTRY, TEXT, DOCUMENT_TEXT, DOCUMENT_WEB = 73, 79, 61, 94, 95
TOP_LEVEL = frozenset({ALERT, DIALOG, FILE_CHOOSER, FRAME, TOOL_TIP, WINDOW, MENU, POPUP_MENU})
MENUS = frozenset({MENU, POPUP_MENU})
CLIPPING = frozenset({SCROLL_PANE, VIEWPORT, FRAME, DIALOG, WINDOW})
# What these hold can't be known from their names, so it is read also where another window covers them.
WRITTEN = frozenset({ENTRY, TEXT, TERMINAL, PARAGRAPH, DOCUMENT_TEXT})
