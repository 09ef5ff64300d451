"""The `hijack` command. A subcommand is imported when it is called; `hijack --help` imports none.

Exit codes: 0 done, 1 finished but something failed or is invalid, 2 bad usage or configuration,
3 the disk is full or fails.
"""

import errno
import importlib
import importlib.util
import io
import platform
import sys
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import click
from click.shell_completion import CompletionItem

from .. import extras
from ..errors import HijackError, PluginWarning, StorageError, suggest
from ..printable import printable as printable
from ..shadowed import find_shadow
from .help_pages import page_for
from .options import WholeSummaries
from .summaries import SECTIONS, SUMMARIES
from .terminal import echo

DISK_FULL = 3  # exit code
# Where each command is defined. The commands of the other packages are listed here as text, not as
# imports.
COMMANDS = {
    "list": "hijack_data.cli.list_commands:list_command",
    "show": "hijack_data.cli.list_commands:show",
    "demo": "hijack_data.cli.demo_command:demo",
    "apply": "hijack_data.cli.picture_commands:apply_command",
    "gallery": "hijack_data.cli.picture_commands:gallery",
    "new": "hijack_data.cli.new_command:new",
    "check": "hijack_data.cli.check_commands:check",
    "doctor": "hijack_data.cli.check_commands:doctor",
    "inspect": "pipelines.dataset_commands:inspect",
    "build": "pipelines.dataset_commands:build",
    "verify": "pipelines.dataset_commands:verify",
    "sign": "pipelines.dataset_commands:sign",
    "stats": "pipelines.dataset_commands:stats",
    "export": "pipelines.dataset_commands:export",
    "view": "pipelines.viewer.view_command:view",
    "train": "pipelines.train.train_command:train",
    "desktop": "online_env.desktop_commands:desktop",
    "browser": "online_env.browser.browser_command:browser",
    "bench": "online_env.bench.bench_command:bench",
    "serve": "online_env.serving.serve_command:serve",
    "mcp": "online_env.mcp.mcp_command:mcp",
    "score": "online_env.scoring.score_command:score",
    "search": "online_env.search.search_command:search",
    "mine": "online_env.search.search_command:mine",
    "report": "online_env.report.report_command:report",
    "compare": "online_env.report.report_command:compare_command",
    "gate": "online_env.report.report_command:gate",
    "certify": "online_env.report.certify_command:certify_command",
    "leaderboard": "online_env.report.report_command:leaderboard_command",
    "tasks": "online_env.task_commands:tasks",
    "osworld": "online_env.osworld.osworld_commands:osworld",
}
# Commands that need the processes, users and sockets of a POSIX system.
NEEDS_POSIX = ("desktop", "browser", "bench", "serve", "mcp", "osworld")


class LazyGroup(WholeSummaries):
    """A group whose commands are imported on first use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command and return it, or `None` if there is none of that name.

        Raises:
            HijackError: another package on the path shadows one of ours, or the command cannot run
                on this system.
        """
        if cmd_name not in COMMANDS:
            return None
        if cmd_name in NEEDS_POSIX and importlib.util.find_spec("fcntl") is None:
            raise HijackError(
                f"hijack {cmd_name} cannot run on {platform.system()}, which lacks POSIX locks and"
                " users: use Linux, or WSL on Windows"
            )
        module, _, attribute = COMMANDS[cmd_name].partition(":")
        problem = find_shadow(module.partition(".")[0])
        if problem:
            raise HijackError(problem)
        return getattr(importlib.import_module(module), attribute)

    def summary(self, ctx: click.Context, name: str) -> str:
        """Return a command's line in `summaries`, or else the first sentence of its help."""
        if name in SUMMARIES:
            return SUMMARIES[name]
        return super().summary(ctx, name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by section, each with its whole summary."""
        sections = {title: list(lines) for title, lines in SECTIONS.items()}
        unlisted = [name for name in COMMANDS if name not in SUMMARIES]
        if unlisted:
            sections["Others"] = unlisted
        wide = max(map(len, COMMANDS))
        for title, names in sections.items():
            with formatter.section(title):
                rows = [(name.ljust(wide), self.summary(ctx, name)) for name in names]
                formatter.write_dl(rows)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete the names of commands, and the options that come before the command."""
        completions = [
            CompletionItem(name, help=self.summary(ctx, name))
            for name in COMMANDS
            if name.startswith(incomplete)
        ]
        return completions + click.Command.shell_complete(self, ctx, incomplete)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command.

        Raises:
            UsageError: there is no such command; the message suggests the closest one.
        """
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            raise click.UsageError(f"no command {args[0]!r}{suggest(args[0], COMMANDS)}", ctx)
        return super().resolve_command(ctx, args)


def _show_version(context: click.Context, _option: click.Parameter, is_requested: bool) -> None:
    if is_requested and not context.resilient_parsing:
        importlib.import_module("hijack_data.cli.version_text").show_version(context)


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.option(
    "-V",
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_version,
    help="Show the version, with the environment for bug reports.",
)
@click.option(
    "--load",
    "files",
    multiple=True,
    metavar="FILE.py",
    help="Load a file of corruptions, effects ...; may be repeated.  [also: AGENTHIJACK_LOAD]",
)
def hijack(files: tuple[str, ...]) -> None:
    """Does your computer-use agent still work when the desktop misbehaves?"""
    for file in files:
        importlib.import_module("hijack_data.loading").load_file(file)


def main(argv: list[str] | None = None) -> None:
    """Entry point: turn the library's errors into one clear message and exit code 2 or 3.

    Raises:
        ModuleNotFoundError: a module is missing that no extra installs.
        OSError: the system failed in a way that no message of the library explains.
    """
    code: object = 0
    _escape_unprintable()
    try:
        with _plugin_warnings():
            code = hijack.main(args=argv, prog_name="hijack", standalone_mode=False)
    except StorageError as error:
        fail(str(error), DISK_FULL)
    except HijackError as error:
        fail(str(error))
    except ModuleNotFoundError as error:
        extra = extras.find_extra(error.name or "")
        if extra is None:
            raise
        fail(str(extras.missing(f"this command needs {error.name}", extra)))
    except click.Abort:
        echo("hijack: stopped", err=True)
        sys.exit(130)
    except click.exceptions.NoArgsIsHelpError as error:
        echo(error.format_message())
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "hijack"
        fail(f"{error.format_message().rstrip('.')}; see {command} --help")
    except click.ClickException as error:
        fail(error.format_message())
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        sys.stdout = io.StringIO()  # what is left in the old one is not tried again
        fail(f"the output cannot be written ({error.strerror}); free some space", DISK_FULL)
    sys.exit(code if isinstance(code, int) else 0)


def _escape_unprintable() -> None:
    """Print characters that the terminal cannot show as Python escapes.

    Texts of agents, models and recordings are printed too, and must never end a run with an
    encoding error.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def _plugin_warnings() -> Generator[None]:
    """Print warnings about plug-ins as messages, so that no filter makes errors of them."""
    with warnings.catch_warnings():
        show_other = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *arguments: Any) -> None:
            if issubclass(category, PluginWarning):
                echo(f"hijack: warning: {message}", err=True)
            else:
                show_other(message, category, *arguments)

        warnings.showwarning = show
        warnings.simplefilter("always", PluginWarning)
        yield


def fail(message: str, code: int = 2) -> None:
    """Print an error and a link to the page that explains it, if any; end with an exit code."""
    for line in message.splitlines() or ["failed"]:
        echo(f"hijack: error: {line}", err=True)
    page = page_for(message)
    if page:
        echo(f"hijack: explained in {page}", err=True)
    sys.exit(code)
