"""Labels: how the entries of a sample are written, and how they follow the pixels.

>>> from hijack_data.labels import Labels
>>> import hijack_data as hj
>>> half = hj.Resolution(scale=0.5).plan(hj.Scene(size=(1080, 1920)), seed=1)
>>> Labels({"bbox": "xywh", "click": "point"}).follow(half, {"bbox": [100, 200, 30, 40], "click": (110, 220)})
{'bbox': [50, 100, 15, 20], 'click': (55, 110)}
"""  # noqa: E501

from .base import Format, Location, Move
from .chat import ChatLabels
from .formats import ALIASES, FORMATS, chat, find_format
from .label_declarations import Declared, Labels

__all__ = [
    "ALIASES",
    "FORMATS",
    "ChatLabels",
    "Declared",
    "Format",
    "Labels",
    "Location",
    "Move",
    "chat",
    "find_format",
]
