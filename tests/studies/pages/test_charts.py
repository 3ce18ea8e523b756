"""The plot of SNR over light: names as they are, and it stands in the report."""

import pytest
from report_sample import sample_pictures, sample_report

from sensor.presets import preset
from studies.pages.charts import snr_svg
from studies.pages.report import render_report


@pytest.mark.thorough
def test_the_plot_stands_in_the_report():
    report = sample_report()
    page = render_report(report, sample_pictures(report))
    assert page.count("data:image/svg+xml;base64") == 1


def test_a_sensors_name_is_no_formula():
    assert "a$^b$.toml W" in snr_svg({"a$^b$.toml": preset("low_noise")}, "D65", 0.033, 10.0)
