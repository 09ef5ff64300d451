"""Open a page that a command serves, as a browser does: redirects with their cookies."""

import urllib.request
from http.client import HTTPResponse


def open_page(address: str, timeout: float = 120.0) -> HTTPResponse:
    """Open an address, which may hold a token that becomes a cookie."""
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    return browser.open(address, timeout=timeout)
