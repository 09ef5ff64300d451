"""Machines that a user names, on which the tasks of a family are played (`hijack bench --vm`)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

NOT_RECORDED = ("client_password", "path_to_vm")
PASSWORD = "password"  # of the user of OSWorld's images, and of embedded desktops
PASSWORDS = {"aws": "osworld-public-evaluation"}  # of the images that have another one


@dataclass(frozen=True, kw_only=True)
class MachineSettings:
    """The machines of a run.

    Args:
        vm: Addresses of machines that run already, and names of providers that start machines.
        count: How many machines each provider starts.
        options: Arguments for the providers, by name.
        reset_command: The shell command that makes a running machine pristine; "" for none.
    """

    vm: tuple[str, ...] = ()
    count: int = 1
    options: Mapping[str, str | bool] = field(default_factory=dict[str, "str | bool"])
    reset_command: str = ""

    @property
    def password(self) -> str:
        """The password of the guest's user, on the only machine or the first one."""
        default = PASSWORDS.get(next(iter(self.vm), ""), PASSWORD)
        return str(self.options.get("client_password", default))

    def single_machines(self) -> "tuple[MachineSettings, ...]":
        """Return settings of every single machine; addresses first, as they answer at once."""
        addresses = [name for name in self.vm if is_address(name)]
        providers = [name for name in self.vm if not is_address(name)] * self.count
        return tuple(replace(self, vm=(name,), count=1) for name in [*addresses, *providers])

    def to_data(self) -> dict[str, Any]:
        """Return what decides results, as JSON data for the configuration of a run.

        Which machines there are does not: `--resume` may go on with others, and every record names
        its own. Commands and passwords are not written down at all.
        """
        options = {key: value for key, value in self.options.items() if key not in NOT_RECORDED}
        return {"vm_options": options} if options else {}


def is_address(name: str) -> bool:
    """Return whether a machine is named by its address, and not by the provider that starts it."""
    return "/" in name or ":" in name
