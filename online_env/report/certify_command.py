"""`hijack certify`.

Exit codes: 0 done, 1 the bound is below `--retention`, 2 bad usage or a run that cannot be
certified, 3 the disk is full or fails.
"""

import json
from pathlib import Path

import click

from hijack_data.cli.options import FiniteRange
from hijack_data.cli.terminal import echo
from hijack_data.errors import ParameterError
from hijack_data.file_io import make_folder, write_atomic
from hijack_data.runs.own_files import refuse_own_file

from ..choices import CONFIDENCE
from .sources import READING, SOURCES, SourceOptions, source_options


@click.command("certify")
@SOURCES
@click.option(
    "-o",
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.json",
    help="The certificate to write.  [default: print it]",
)
@click.option("--agent", default="", metavar="NAME", help="Which one, if the run has several.")
@click.option(
    "--weights",
    metavar="A=W,B=W",
    help="Conditions of the distribution with their weights.  [default: all, equally]",
)
@click.option(
    "--distribution",
    default="",
    metavar="WORDS",
    help="Of results of others: what their conditions did; the certificate says so.",
)
@click.option(
    "--confidence",
    type=FiniteRange(0.5, 1),
    default=CONFIDENCE,
    show_default=True,
    metavar="X",
    help="The level of the one-sided bound.",
)
@click.option(
    "--missing-as-lost",
    is_flag=True,
    help="Count cases without a score as solved clean and lost corrupted.",
)
@click.option(
    "--retention",
    type=FiniteRange(0, 1),
    metavar="R",
    help="Exit with 1 if the certified retention is below R.",
)
@source_options(*READING)
def certify_command(
    sources: tuple[Path, ...],
    out: Path | None,
    agent: str,
    weights: str | None,
    distribution: str,
    confidence: float,
    missing_as_lost: bool,
    retention: float | None,
    options: SourceOptions,
) -> None:
    """Certify how much of its clean success an agent keeps: hijack certify RUNS -o FILE.json."""
    from ..results import reading
    from ..results.outcomes import PairingError
    from .certificate import CertificateError, certify

    try:
        run = options.read(sources, reading.read)
    except PairingError as error:
        raise CertificateError(
            f"{error.difference}; a certificate counts every task: play those that are missing, or"
            " add them without a score and give --missing-as-lost"
        ) from None
    certificate = certify(
        run,
        agent=agent,
        weights=None if weights is None else _parse_weights(weights),
        confidence=confidence,
        missing_as_lost=missing_as_lost,
        declaration=distribution,
    )
    text = json.dumps(certificate.to_data(), indent=1, ensure_ascii=False) + "\n"
    if out is None:
        echo(text, nl=False)
    else:
        refuse_own_file(out, "--out")
        make_folder(out.parent, out)
        write_atomic(out, text)
        echo(f"{out}: {certificate.statement}; method: {certificate.method}")
    is_too_low = retention is not None and certificate.retention_at_least < retention
    if is_too_low:
        echo(
            f"hijack: {certificate.retention_at_least:g} is below --retention {retention:g}",
            err=True,
        )
    raise SystemExit(int(is_too_low))


def _parse_weights(text: str) -> dict[str, float]:
    """Return the weights in `marks=2,pop_ups=1`, by condition.

    Raises:
        ParameterError: it has another form.
    """
    weights: dict[str, float] = {}
    for part in filter(None, text.split(",")):
        label, _, number = part.rpartition("=")
        try:
            weight = float(number)
        except ValueError:
            weight = 0.0
        if not label or not weight > 0 or label in weights:
            raise ParameterError(
                f"--weights: {part!r} must be CONDITION=W with W above 0, each condition once, such"
                " as marks=2,pop_ups=1"
            )
        weights[label] = weight
    return weights
