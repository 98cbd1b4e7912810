"""What the tests of the viewer share: a server of the checkout, and pages of a browser.

The import stands in the fixtures, since a conftest.py cannot be skipped where Playwright is missing.
"""

import pytest


@pytest.fixture(scope="module")
def server():
    import web_pages

    with web_pages.serving(web_pages.ROOT) as url:
        yield url


@pytest.fixture
def new_page():
    import web_pages

    with web_pages.pages() as opened:
        yield opened


@pytest.fixture
def viewer(new_page):
    """viewer(**settings): the viewer with its example, drawn."""
    import web_pages

    return lambda **settings: web_pages.viewer(new_page(**settings))
