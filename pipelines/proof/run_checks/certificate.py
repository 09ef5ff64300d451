"""`hijack verify certificate.json --run RUN`: a certificate is computed again from its run."""

import importlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...building.build_report import Findings

# Statistics are those of `online_env`, which `pipelines` does not import but by name.
_CERTIFICATE = "online_env.report.certificate"
_READING = "online_env.results.reading"


@dataclass
class CertificateFindings(Findings):
    """The fields of a certificate that its run does not give.

    Args:
        folder: the certificate.
        problems: a line for each field that differs.
        run: the run.
    """

    run: str = ""

    def lines(self) -> list[str]:
        """Return the findings as lines of text."""
        state = "is what the records of" if self.ok else "is not what the records of"
        return [
            f"{self.folder}: {state} {self.run} give",
            *self.listed(),
            f"  the records themselves are checked by: hijack verify {self.run}",
        ]


def check_certificate(path: Path, run: Path) -> CertificateFindings:
    """Compute a certificate again, and compare every field.

    Args:
        path: the certificate.
        run: the folder of its run.

    Raises:
        HijackError: one of them cannot be read.
    """
    reading: Any = importlib.import_module(_READING)
    certificate: Any = importlib.import_module(_CERTIFICATE)
    report = CertificateFindings(os.fspath(path), run=os.fspath(run))
    report.problems += certificate.certificate_problems(path, reading.read(run))
    return report
