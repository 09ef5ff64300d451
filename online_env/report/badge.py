"""A badge: the retention of an agent with its interval, as an SVG file for a README."""

from xml.sax.saxutils import escape

from . import formatting
from .document import ReportDocument
from .model import AgentSummary, ReportError
from .named_scores import REFERENCE_AGENTS

LABEL = "robustness"
CHARACTER_PX = 7  # the width that texts are stretched to, whatever font there is
PADDING_PX = 6
HEIGHT_PX = 20
# The least lower end of the interval for each colour.
COLOURS = ((0.9, "#2f7d3b"), (0.7, "#8a6d00"), (0.0, "#b03a2e"))
UNKNOWN_COLOUR = "#5f6368"


def as_badge(document: ReportDocument) -> str:
    """Return the badge of the only agent of a report; yardsticks are left out beside it.

    The colour follows the lower end of the interval: at least 90 %, at least 70 %, or less.

    Raises:
        ReportError: The report has several agents, or no episodes with and without a corruption.
    """
    summaries = document.report.summaries
    agents = [row for row in summaries if row.agent not in REFERENCE_AGENTS] or list(summaries)
    if len(agents) != 1:
        names = ", ".join(row.agent for row in agents)
        raise ReportError(f"a badge is of one agent, and the run has {names}; run one alone")
    (row,) = agents
    if row.retention is None:
        raise ReportError(
            f"a badge needs the retention of {row.agent}: play it clean and corrupted, and solve a"
            " task clean"
        )
    return _draw(LABEL, _value(row), _colour(row.retention_low))


def _value(row: AgentSummary) -> str:
    interval = formatting.retention_interval(row.retention_low, row.retention_high)
    return f"keeps {formatting.percent(row.retention)} % {interval}".rstrip()


def _colour(low: float | None) -> str:
    if low is None:
        return UNKNOWN_COLOUR
    return next(colour for least, colour in COLOURS if low >= least)


def _draw(label: str, value: str, colour: str) -> str:
    texts = (label, value)
    lengths = [CHARACTER_PX * len(text) for text in texts]
    left, right = (length + 2 * PADDING_PX for length in lengths)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="{HEIGHT_PX}"'
        f' role="img" aria-label="{escape(f"{label}: {value}")}">',
        f"<title>{escape(f'{label}: {value}')}</title>",
        f'<rect width="{left + right}" height="{HEIGHT_PX}" rx="3" fill="{colour}"/>',
        f'<path d="M3 0H{left}V{HEIGHT_PX}H3a3 3 0 0 1-3-3V3a3 3 0 0 1 3-3z" fill="#3c4043"/>',
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">',
    ]
    for text, length, start in zip(texts, lengths, (0, left), strict=True):
        parts.append(
            f'<text x="{start + PADDING_PX}" y="14" textLength="{length}">{escape(text)}</text>'
        )
    return "\n".join([*parts, "</g>", "</svg>"])
