"""The plot of SNR over light: names as they are, and it stands in the report."""

from sensor.presets import preset
from studies.pages.plots import snr_svg


def test_a_sensors_name_is_no_formula():
    assert "a$^b$.toml W" in snr_svg({"a$^b$.toml": preset("low_noise")}, "D65", 0.033, 10.0)
