"""`hijack verify certificate.json --run RUN`: a certificate is computed again from its run."""

import importlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...building.build_report import Findings

# Statistics are those of `online_env`, which `pipelines` does not import but by name.
_CERTIFICATE = "online_env.report.certificate"


@dataclass
class CertificateFindings(Findings):
    """The fields of a certificate that its run does not give.

    Args:
        folder: the certificate.
        problems: a line for each field that differs.
        run: the run.
        is_foreign: whether it is of another harness, whose records this library cannot check.
    """

    run: str = ""
    is_foreign: bool = False

    def lines(self) -> list[str]:
        """Return the findings as lines of text."""
        state = "is what the records of" if self.ok else "is not what the records of"
        records = f"the records themselves are checked by: hijack verify {self.run}"
        if self.is_foreign:
            records = "the results themselves are as their harness wrote them, and are not checked"
        return [f"{self.folder}: {state} {self.run} give", *self.listed(), f"  {records}"]


def check_certificate(path: Path, runs: Sequence[Path]) -> CertificateFindings:
    """Compute a certificate again, and compare every field.

    Args:
        path: the certificate.
        runs: the folder of its run, or the results of another harness that it is about.

    Raises:
        HijackError: one of them cannot be read.
    """
    certificate: Any = importlib.import_module(_CERTIFICATE)
    run = certificate.read_certified_run(path, runs)
    names = " ".join(map(os.fspath, runs))
    is_foreign = run.config.get("kind") == certificate.RESULTS
    report = CertificateFindings(os.fspath(path), run=names, is_foreign=is_foreign)
    report.problems += certificate.certificate_problems(path, run)
    return report
