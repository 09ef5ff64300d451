"""The paper's own names of corruptions and parameters, read on request only (`paper_compat`)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..corruption import Corruption
from ..params import Parameter, parameters

# Spellings from the algorithm boxes and from typesetting, in addition to the keys of the table
# (`paper=` of each parameter).
_ALSO: Mapping[str, Mapping[str, str]] = {
    "marks": {"size": "mark_size", "type": "mark_type"},
    "subtitle": {"text": "subtitle_text", "size": "font_size", "font": "font_path"},
    "multi_apps": {"app": "another_app"},
    "accidental_touch": {"w\\/o_app": "without_app", "wo_app": "without_app"},
    "network_error": {"ip": "local_ip", "local_ip": "local_ip"},
}

# What the paper's `overlap` means for our `avoid_elements`. Its table explains both as "whether can
# overlap buttons", but Algorithm 1 searches the largest space free of elements when a pop-up's
# overlap is True, while Algorithm 3 checks a mark's place only when overlap is False. The
# algorithms are what ran.
_OVERLAP_AVOIDS: Mapping[str, bool] = {"pop_ups": True, "marks": False}


@dataclass(frozen=True)
class PaperKey:
    """Our parameter for one of the paper's keys, and whether its flag is inverted."""

    name: str
    opposite: bool = False

    def translate(self, where: str, value: object) -> object:
        """Translate a value of the paper into ours.

        A flag that is neither true nor false is a `ParameterTypeError`.
        """
        if self.name == "avoid_elements":
            return Parameter("bool", "").check(where, value) != self.opposite
        if self.name == "local_ip" and value == "-":  # the paper's table prints - for "none"
            return None
        return value


def paper_keys(cls: type[Corruption]) -> dict[str, PaperKey]:
    """Return the paper's keys of a corruption whose name or meaning differs from ours."""
    keys: dict[str, PaperKey] = {}
    for name, (parameter, _) in parameters(cls).items():
        if parameter.paper is not None:
            keys[parameter.paper] = PaperKey(name)
    for paper, name in _ALSO.get(cls.name, {}).items():
        keys[paper] = PaperKey(name)
    if cls.name in _OVERLAP_AVOIDS:
        keys["overlap"] = PaperKey("avoid_elements", opposite=not _OVERLAP_AVOIDS[cls.name])
    return keys


def paper_name(name: str, known: Iterable[str]) -> str | None:
    """Return the name in `known` that the paper prints as `name`, or `None`.

    `"Pop UPs"` is `"pop_ups"`.
    """
    letters = _letters(name)
    if not letters:
        return None
    return next((candidate for candidate in known if _letters(candidate) == letters), None)


def _letters(name: str) -> str:
    return "".join(character for character in name.lower() if character.isalnum())
