"""Numbers, times and names as the report writes them."""

from functools import partial

from studies.metrics import metric as figures
from studies.pages import report_text as text

WRITTEN = {
    partial(text.lead_text, figures.PSNR): {0.04: "0.0", -0.04: "0.0", 0.06: "+0.1", -11.94: "−11.9"},
    text.significant: {0.0999: "0.0999", 80: "80", 1234.0: "1 230", 99.96: "100", 0: "0", None: "—", -2: "−2"},
    text.duration_text: {0.066: "66 ms", 0.00012: "0.12 ms", 41.23: "41.2 s", 0.0: "0 s"},
    text.level_text: {"0.036cd/m2": "0.036 cd/m²", "500lux": "500 lux"},
    text.substitution_text: {
        None: "not applicable",
        True: "on",
        0.25: "on for 25 % of the seeds",
        0.75: "on for 75 % of the seeds",
        0.0: "off",
    },
    text.with_signs: {"10 photons per um^2, 5 cd/m2, cos^4": "10 photons per µm², 5 cd/m², cos⁴"},
    text.plain_name: {"quiet.toml": "quiet", "low_noise": "low_noise", "low_noise.toml": "low_noise.toml"},
    text.camera_name: {
        "ple_bayer": "Bayer (PLE)",
        "bayer_menon": "bayer_menon",
        "two_by_two.py:develop": "two by two",
        "two_by_two.py:without_noise": "two by two (without noise)",
        "demosaicnet-0.0.14-py3-none-any.whl:bayer_net": "demosaicnet (bayer net)",
    },
    text.exposure_name: {
        text.way_name("auto"): "automatic",
        text.way_name("auto:W"): "automatic for W",
        text.way_name("auto:information", 3): "automatic by information, 3 frames",
        text.way_name("2ms", 4): "2 ms, 4 frames",
        text.way_name("auto", 2): "automatic, 2 frames",
    },
}


def test_numbers_times_and_names_are_written_as_prose_does() -> None:
    for write, cases in WRITTEN.items():
        for value, words in cases.items():
            written = write(value).replace("\N{NO-BREAK SPACE}", " ").replace("\N{NARROW NO-BREAK SPACE}", " ")
            assert written == words, (write, value)
