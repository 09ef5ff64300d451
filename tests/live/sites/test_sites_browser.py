"""The sites in a real browser, headless Chromium."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from online_env.embedded.sites import HOSTS
from online_env.embedded.sites.hosts.forms import content as forms_content

from support.chromium import Browser, chromium

SIZE = {"width": 780, "height": 500}  # small, so that a page that is too wide is seen


@pytest.fixture
def browser(fresh: Any, tmp_path: Path) -> Iterator[Browser]:
    with chromium(tmp_path / "profile", rules=f"MAP *.test 127.0.0.1:{fresh.http}") as result:
        yield result


def test_a_browser_registers_reads_mail_and_loads_everything(fresh: Any, browser: Browser) -> None:
    browser.open("http://forms.test/register?course=pottery", **SIZE)
    assert browser.js("document.forms.length") == 1
    browser.js("""(() => { const f = document.forms[0].elements;
        f.name.value = 'Zoë'; f.email.value = 'zoe@mail.test'; f.country.value = 'Japan';
        f.birth_date.value = '1990-05-17';
        f.level.value = 'beginner'; f.interests[1].checked = true; f.notes.value = 'a\\nb';
        f.agree.checked = true;
        document.querySelector('form button').click(); })()""")
    browser.until(
        "location.pathname === '/registrations/1001' && document.readyState === 'complete'"
    )
    assert fresh.state.read("forms")["registrations"][0] == {
        "name": "Zoë",
        "email": "zoe@mail.test",
        "birth_date": "1990-05-17",
        "country": "Japan",
        "course": "pottery",
        "level": "beginner",
        "interests": [list(forms_content()["interests"])[1]],
        "notes": "a\nb",
        "number": 1001,
    }
    for host in HOSTS:
        browser.open(f"http://{host}/", **SIZE)
        assert browser.js("[...document.images].every(i => i.complete && i.naturalWidth > 0)"), host
        assert browser.js(
            "[...document.styleSheets].length === 2 && document.styleSheets[1].cssRules.length > 5"
        ), host
        assert browser.js("document.documentElement.scrollWidth <= innerWidth"), (
            f"{host} is wider than the window"
        )
        names = browser.js(
            "performance.getEntriesByType('resource').map(e => new URL(e.name).hostname)"
        )
        assert set(names) == {host}
