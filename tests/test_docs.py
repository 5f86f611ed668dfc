"""The documentation says what the programs do."""

import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGES = [DOCS.parent / "README.md", DOCS.parent / "CHANGELOG.md", *sorted(DOCS.glob("*.md"))]


def test_command_line_and_configuration_pages_are_what_the_programs_say(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    import help_pages

    sys.modules.pop("help_pages")
    assert help_pages.PAGE.read_text() == help_pages.page(), "run: make docs"
    assert help_pages.ROBOT.read_text() == help_pages.robot_configuration(), "run: make docs"
    assert help_pages.SCENE.read_text() == help_pages.scene(), "run: make docs"
    assert help_pages.TRAIN.read_text() == help_pages.training(), "run: make docs"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
