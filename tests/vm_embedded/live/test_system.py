"""Temperatures from files as Linux has them."""

from vm_embedded.live.system import read_temperatures


def zone(folder, number, name, temperature):
    (folder / f"thermal_zone{number}").mkdir()
    (folder / f"thermal_zone{number}" / "type").write_text(f"{name}\n")
    if temperature is not None:
        (folder / f"thermal_zone{number}" / "temp").write_text(temperature)


def test_the_hottest_zone_of_each_kind_counts_and_sensors_that_fail_do_not(tmp_path):
    zone(tmp_path, 0, "cpu-thermal", "48312\n")
    zone(tmp_path, 1, "cpu-thermal", "51000\n")
    zone(tmp_path, 2, "acpitz", "-273200\n")
    zone(tmp_path, 3, "iwlwifi", None)
    zone(tmp_path, 4, "gpu", "broken")
    assert read_temperatures(tmp_path) == {"cpu-thermal": 51.0}


def test_a_machine_without_sensors_has_none(tmp_path):
    assert read_temperatures(tmp_path / "nowhere") == {}
