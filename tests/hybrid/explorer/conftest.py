"""Pages that are closed after the test."""

import pytest

from tests.hybrid.explorer.pages import page_of


@pytest.fixture
def opened():
    pages = []

    def make(*arguments, **options):
        pages.append(page_of(*arguments, **options))
        return pages[-1]

    yield make
    for page in pages:
        page.close()
