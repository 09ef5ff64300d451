"""Names and the fixed date of the local internet.

`.test` is reserved (RFC 6761): it can never exist outside.
"""

from datetime import date

HOSTS = (
    "search.test",
    "shop.test",
    "docs.test",
    "mail.test",
    "forms.test",
    "wiki.test",
    "news.test",
)

# Pages never show the real date, so that they are the same on every run. It was a Wednesday.
TODAY = date(2026, 3, 4)


def host_name(header: str) -> str:
    """Return the name in a Host header, without port, final dot or capitals.

    `"Shop.test.:80"` is `"shop.test"`.
    """
    return (
        header.rsplit(":", 1)[0].rstrip(".").lower()
        if header.count(":") == 1
        else header.rstrip(".").lower()
    )


def day(text: str) -> date:
    """Return the date at the start of `2026-03-04T09:12`."""
    return date.fromisoformat(text[:10])


def long_date(day: date) -> str:
    """`4 March 2026`."""
    return f"{day.day} {day:%B %Y}"


def short_date(day: date) -> str:
    """`4 Mar`."""
    return f"{day.day} {day:%b}"
