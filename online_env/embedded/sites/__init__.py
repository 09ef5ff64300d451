"""The local internet of a desktop: seven small web sites and their DNS, in one process.

`python -m online_env.embedded.sites --address A --state DIR` serves them; `SiteState(DIR)` shows a
task what was done there. The pages are our own, the same on every run, and ask for nothing from
outside. See docs/local_internet.md.

Nothing here loads NumPy before something goes wrong: 0.3 s that every desktop would wait for.
"""

from .hosts_and_dates import HOSTS, TODAY
from .state import SiteState

__all__ = ["HOSTS", "TODAY", "SiteState"]
