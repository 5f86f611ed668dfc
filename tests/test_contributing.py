"""The forms for issues are what the code host reads."""

from pathlib import Path

import yaml

FORMS = Path(__file__).parents[1] / ".github" / "ISSUE_TEMPLATE"


def test_the_forms_for_issues_ask_for_what_is_needed():
    forms = {path.stem: yaml.safe_load(path.read_text()) for path in FORMS.glob("*.yml") if path.stem != "config"}
    assert set(forms) == {"problem", "robot", "idea"}
    for form in forms.values():
        assert form.keys() == {"name", "description", "labels", "body"}
        assert all(each["type"] in ("input", "textarea") and each["attributes"]["label"] for each in form["body"])
        names = [each["id"] for each in form["body"]]
        assert len(set(names)) == len(names)
        assert any(each.get("validations", {}).get("required") for each in form["body"])
    assert yaml.safe_load((FORMS / "config.yml").read_text()) == {"blank_issues_enabled": True}
