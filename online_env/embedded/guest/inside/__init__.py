"""Programs that effects and the recorder run inside a guest: what they do and see there.

Our own guest server runs them in its own process, which no file of the user's reaches. On a plain
OSWorld guest they are run by the system's Python, isolated from the user's (`effects/guest.py`).
They need Python 3.10 or newer and, except for `nettool`, python-xlib; they import nothing of ours
but one another.
"""

from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parent
_SHARED = {"locktool": ("ewmh",), "xlook": ("ewmh",), "xtool": ("ewmh",)}
# Makes modules of texts, in a package of their own, so that their relative imports work.
_LOADER = """\
import sys, types
package = types.ModuleType("guest_tools")
package.__path__ = []
sys.modules["guest_tools"] = package
for name, text in {texts!r}.items():
    module = types.ModuleType("guest_tools." + name)
    module.__package__ = "guest_tools"
    sys.modules[module.__name__] = module
    exec(compile(text, "<" + name + ">", "exec"), module.__dict__)
module.main(sys.argv[1], sys.argv[2])
"""


@cache
def source(name: str) -> str:
    """Return a tool as one program text for a guest that has none of our files.

    Args:
        name: of the tool, such as `xtool`.

    Returns:
        The text; `python3 -I -c TEXT OPERATION JSON` carries out an operation and prints JSON.
    """
    names = (*_SHARED.get(name, ()), name)
    texts = {module: (_FOLDER / f"{module}.py").read_text(encoding="utf-8") for module in names}
    return _LOADER.format(texts=texts)
