"""Shared by all tests: the settings for random inputs, the folder of the reference data, and a browser."""

import os
import shutil
from pathlib import Path

import pytest
from hypothesis import settings

# The tests run side by side. Threads of torch that wait for each other while other tests use their cores took four
# times as long. The environment reaches torch, which is imported later, and the programs that tests start.
os.environ["OMP_NUM_THREADS"] = "1"


def pytest_configure(config):
    """Random inputs are the same in each run. With the long tests, there are twice as many."""
    examples = 25 if "not long" in config.option.markexpr else 50
    settings.register_profile(
        "repeatable", deadline=None, max_examples=examples, derandomize=True, database=None, print_blob=False
    )
    settings.load_profile("repeatable")


CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session", autouse=True)
def state_folder(tmp_path_factory):
    """Programs keep their state here, and not in the home of the person who tests."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session")
def shared():
    """The folder of the reference data: $VM_SHARED, or `shared` beside the checkout."""
    path = Path(os.environ.get("VM_SHARED") or CHECKOUT.parent / "shared")
    if not path.is_dir():
        pytest.skip(f"needs the reference data, but there is no folder {path}; set VM_SHARED to its folder")
    return path


@pytest.fixture
def browser(tmp_path):
    """Chromium without a screen, driven by selenium."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, of the extra dev")
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("needs chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for each in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--window-size=1200,800",
    ):
        options.add_argument(each)
    options.add_argument(f"--user-data-dir={tmp_path / 'browser'}")
    found = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield found
    found.quit()
