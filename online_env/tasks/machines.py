"""Machines that a user names, on which the tasks of a family are played (`hijack bench --vm`)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

PASSWORD = "client_password"  # an option that no record shows


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

    def each(self) -> "tuple[MachineSettings, ...]":
        """Return settings of every single machine; addresses first, as they answer at once."""
        addresses = [name for name in self.vm if is_address(name)]
        providers = [name for name in self.vm if not is_address(name)] * self.count
        return tuple(replace(self, vm=(name,), count=1) for name in [*addresses, *providers])

    def to_data(self) -> dict[str, Any]:
        """Return JSON data for the configuration of a run."""
        data: dict[str, Any] = {"vm": list(self.vm), "machines": self.count}
        options = {key: value for key, value in self.options.items() if key != PASSWORD}
        if options:
            data["vm_options"] = options
        if self.reset_command:
            data["reset_command"] = self.reset_command
        return data


def is_address(name: str) -> bool:
    """Return whether a machine is named by its address, and not by the provider that starts it."""
    return "/" in name or ":" in name
