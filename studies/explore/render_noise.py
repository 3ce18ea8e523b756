"""What the render's noise adds to the sensor's."""

import numpy as np
from numpy.typing import NDArray

from sensor.optics import form_image
from sensor.response import behind_filters, channel_electrons
from studies.explore.chain import Exposed
from studies.explore.controls import Controls, Lamp
from studies.explore.equipment import alone
from studies.explore.memo import Memo
from studies.study.render_noise import monte_carlo_share


def noise_share(exposed: Exposed, controls: Controls, memo: Memo) -> float:
    """Monte Carlo variance of the raw electrons over the sensor's own, as a sweep's `mc_share` of unbiased light.

    One draw of the error, half the difference of the render's halves, goes through lens and filters as the light does.
    """
    errors_e = []
    for name in exposed.frames:
        lamp = controls.lamps.get(name, Lamp())
        camera = (controls.sensor, controls.mosaic, tuple(sorted(controls.lens.items())))
        errors_e.append(memo.of("error", (name, lamp.spectrum, lamp.table, camera), _error_e, exposed, name))
    powers = [exposed.transport.groups[name].power for name in exposed.frames]
    error_e = behind_filters(np.tensordot(powers, errors_e, axes=1), exposed.sensor) * exposed.scale
    share = monte_carlo_share(error_e * exposed.exposure_s, exposed.expected_e, exposed.sensor, exposed.exposure_s)
    return controls.frames * share


def _error_e(exposed: Exposed, name: str) -> NDArray[np.float64]:
    """Error of one light group at power 1, behind the lens and the filters, in 1 s, (h, w, channel) [e-]."""
    even, odd = (
        channel_electrons(form_image(half, exposed.sensor), exposed.sensor, 1.0)
        for half in alone(exposed.transport, name).relight_halves()
    )
    return (even - odd) / 2
