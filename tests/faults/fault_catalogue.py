"""Faults in the physics and the reconstruction, each of which some test must notice.

A fault is a piece of source text and what replaces it. The text must occur exactly once in its file, which
``test_fault_catalogue.py`` holds, so that a change of the code can't leave a fault behind that plants nothing.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One mistake that a person could make.

    Attributes
    ----------
    name : str
    file : str
        Below the repository's root.
    edits : tuple of pairs of str
        Text that is there, and what the mistaken author wrote.
    tests : tuple of str
        Files of tests that should notice, the likeliest first.
    """

    name: str
    file: str
    edits: tuple[tuple[str, str], ...]
    tests: tuple[str, ...]


def _fault(name: str, file: str, there: str, instead: str, *tests: str) -> Fault:
    return Fault(name, file, ((there, instead),), tuple(f"tests/{test}.py" for test in tests))


_READOUT = (
    "sensor/test_readout_variance",
    "sensor/test_capture",
    "sensor/test_readout_crosstalk",
    "sensor/test_device",
    "sensor/kernel/test_kernel_frames",
    "sensor/emva1288/test_estimators",
)
_LENS = ("sensor/test_optics", "sensor/test_diffraction", "sensor/test_hard_cases")
_LIGHT = ("render/test_photometry", "render/test_spectrum", "render/test_illuminants", "sensor/test_optics")
_SIMILARITY = ("isp/similarity/test_guide", "isp/test_planes", "isp/test_bilinear", "isp/test_interleaved")
_COLOUR = (
    "rodcone/test_colour_spaces",
    "isp/colour/test_gray_world",
    "isp/colour/test_colour_fit",
    "isp/test_pipeline",
    "studies/metrics/test_truth_metrics",
)

SENSOR = (
    Fault(
        "PRNU after the Poisson draw",
        "sensor/readout.py",
        (
            (
                "spread_charge(expected, pixel.crosstalk) * device.photo_response",
                "spread_charge(expected, pixel.crosstalk)",
            ),
            (
                "np.minimum(mean_e, _MOST_E)).astype(np.float64)\n",
                "np.minimum(mean_e, _MOST_E)).astype(np.float64) * device.photo_response\n",
            ),
        ),
        tuple(f"tests/{name}.py" for name in _READOUT),
    ),
    Fault(
        "PRNU on the dark current",
        "sensor/readout.py",
        (
            (
                "spread_charge(expected, pixel.crosstalk) * device.photo_response",
                "spread_charge(expected, pixel.crosstalk)",
            ),
            (
                "mean_e += pixel.dark_current_e_per_s * exposure_s  #",
                "mean_e = (mean_e + pixel.dark_current_e_per_s * exposure_s) * device.photo_response  #",
            ),
        ),
        tuple(f"tests/{name}.py" for name in _READOUT),
    ),
    _fault(
        "conversion gain inverted",
        "sensor/readout.py",
        "read_e / converter.gain_e_per_dn",
        "read_e * converter.gain_e_per_dn",
        *_READOUT,
    ),
    _fault("black level missing", "sensor/readout.py", " + converter.black_dn)", ")", *_READOUT),
    _fault("converter rounds down", "sensor/readout.py", "np.rint(read_e", "np.floor(read_e", *_READOUT),
    _fault(
        "well does not clip",
        "sensor/readout.py",
        "np.minimum(collected_e, pixel.full_well_e, out=collected_e)",
        "pass",
        *_READOUT,
    ),
    _fault(
        "read noise as variance",
        "sensor/readout.py",
        "pixel.read_noise_e * normals",
        "pixel.read_noise_e**2 * normals",
        *_READOUT,
    ),
    _fault(
        "read noise the same in every exposure",
        "sensor/readout.py",
        "normals(key, NoiseTerm.READ",
        "normals(0, NoiseTerm.READ",
        *_READOUT,
    ),
    _fault(
        "hot pixels without the exposure time",
        "sensor/readout.py",
        "+= pixel.hot_pixel_dark_current_e_per_s * exposure_s",
        "+= pixel.hot_pixel_dark_current_e_per_s",
        *_READOUT,
    ),
    _fault(
        "DSNU drawn with PRNU's numbers",
        "sensor/device.py",
        "draws(key, NoiseTerm.DSNU, shape, reading)",
        "draws(key, NoiseTerm.PRNU, shape, reading)",
        "sensor/test_device",
        *_READOUT,
    ),
    _fault(
        "quantisation noise of gain^2 / 2",
        "sensor/readout.py",
        "+ sensor.gain_e_per_dn**2 / 12",
        "+ sensor.gain_e_per_dn**2 / 2",
        *_READOUT,
    ),
    _fault(
        "PRNU not squared in the variance",
        "sensor/readout.py",
        "(pixel.prnu * signal) ** 2",
        "(pixel.prnu * signal)",
        *_READOUT,
    ),
    _fault(
        "crosstalk makes charge",
        "sensor/readout.py",
        "(1 - 4 * crosstalk)",
        "(1 - 3 * crosstalk)",
        "sensor/test_readout_crosstalk",
        *_READOUT,
    ),
    _fault(
        "black not subtracted from the raw image",
        "sensor/raw.py",
        "np.float64) - self.black_dn)",
        "np.float64))",
        "sensor/test_raw",
        *_READOUT,
    ),
    _fault(
        "saturation above the full well",
        "sensor/raw.py",
        "full_well_e - SATURATION_SIGMAS",
        "full_well_e + SATURATION_SIGMAS",
        "sensor/test_raw",
        "isp/test_pipeline",
    ),
    _fault(
        "kernel leaves PRNU out",
        "sensor/kernel/kernel.py",
        "dr.fma(light_e, jit.Float(upload(device.photo_response, copy_under=COPY_UNDER)), dark_e)",
        "light_e + dark_e",
        "sensor/kernel/test_kernel_frames",
        "sensor/kernel/test_kernel",
    ),
    _fault(
        "kernel's well does not clip",
        "sensor/kernel/kernel.py",
        "dr.minimum(collected_e, dr.opaque(jit.Float, pixel.full_well_e))",
        "collected_e",
        "sensor/kernel/test_kernel_frames",
        "sensor/kernel/test_kernel",
    ),
    _fault(
        "Poisson series with a wrong term",
        "sensor/kernel/poisson.py",
        "dr.fma(square, 1 / 6, 1 / 3)",
        "dr.fma(square, 1 / 3, 1 / 3)",
        "sensor/kernel/test_poisson",
        "sensor/kernel/test_kernel",
    ),
    _fault("nine rounds of Philox", "sensor/random.py", "ROUNDS = 10", "ROUNDS = 9", "sensor/test_random"),
    _fault(
        "Box-Muller with half the variance",
        "sensor/random.py",
        "np.sqrt(-2.0 * np.log1p",
        "np.sqrt(-1.0 * np.log1p",
        "sensor/test_random",
        "sensor/test_device",
    ),
    _fault(
        "every row draws the same shot noise",
        "sensor/random.py",
        "counter=np.array([0, 0, row, int(term)]",
        "counter=np.array([0, 0, 0, int(term)]",
        "sensor/test_random",
        *_READOUT,
    ),
    _fault(
        "auto exposure forgets the share of the well",
        "sensor/exposure.py",
        "min(longest_s, well_share * sensor",
        "min(longest_s, sensor",
        "sensor/test_exposure",
    ),
    _fault(
        "mosaic one row off",
        "sensor/cfa.py",
        "np.tile(cells, repeats)",
        "np.tile(np.roll(cells, 1, 0), repeats)",
        "sensor/test_cfa",
    ),
)

LENS = (
    _fault(
        "camera equation without pi",
        "sensor/optics.py",
        "return pi * lens.transmittance",
        "return lens.transmittance",
        *_LENS,
    ),
    _fault(
        "camera equation with 2 N^2",
        "sensor/optics.py",
        "(1 + 4 * lens.f_number**2",
        "(1 + 2 * lens.f_number**2",
        *_LENS,
    ),
    _fault("magnification left out", "sensor/optics.py", "* (1 + lens.magnification) ** 2)", ")", *_LENS),
    _fault("cos^3", "sensor/optics.py", "columns**2) ** -2)", "columns**2) ** -1.5)", *_LENS),
    _fault(
        "cos^4 of the full angle",
        "sensor/optics.py",
        "radians(lens.horizontal_view_deg / 2)",
        "radians(lens.horizontal_view_deg)",
        *_LENS,
    ),
    _fault(
        "veiling glare adds light",
        "sensor/optics.py",
        "(1 - lens.veiling_glare) * light +",
        "light +",
        "sensor/test_diffraction",
        *_LENS,
    ),
    _fault(
        "diffraction at half the f-number",
        "sensor/diffraction.py",
        "wavelength_nm * 1e-3 * lens.f_number",
        "wavelength_nm * 0.5e-3 * lens.f_number",
        "sensor/test_diffraction",
    ),
    _fault(
        "fill factor left out",
        "sensor/response.py",
        " * sensor.pixel.fill_factor",
        "",
        "sensor/test_response",
        "sensor/test_exposure",
        *_LENS,
    ),
    _fault("band width left out", "sensor/response.py", " * seen_nm * area_m2", " * area_m2", "sensor/test_response"),
)

LIGHT = (
    _fault("h in place of h c", "render/photometry.py", "/ (PLANCK_J_S * LIGHT_M_S)", "/ PLANCK_J_S", *_LIGHT),
    _fault(
        "680 lm/W", "render/photometry.py", "LUMINOUS_EFFICACY_LM_W = 683.0", "LUMINOUS_EFFICACY_LM_W = 680.0", *_LIGHT
    ),
    _fault(
        "V is x",
        "render/photometry.py",
        "colour_matching_functions()[1].band_average",
        "colour_matching_functions()[0].band_average",
        *_LIGHT,
    ),
    _fault(
        "spectra as steps",
        "render/spectrum.py",
        "(self.values[1:] + self.values[:-1]) / 2\n",
        "self.values[:-1]\n",
        *_LIGHT,
    ),
    _fault(
        "Planck's law with the fourth power", "render/spectrum.py", "(560.0 / nm) ** 5", "(560.0 / nm) ** 4", *_LIGHT
    ),
    _fault(
        "lines of half their power",
        "render/spectrum.py",
        "np.atleast_1d(powers) * (2 / LINE_BASE_NM)",
        "np.atleast_1d(powers) * (1 / LINE_BASE_NM)",
        *_LIGHT,
    ),
    _fault(
        "level counts the lamps seen",
        "render/level.py",
        "self.radiance / self.uncovered",
        "self.radiance / 1.0",
        "render/test_transport",
    ),
    _fault(
        "variance scales as the light",
        "render/transport.py",
        "combine(coefficients**2, self.variance)",
        "combine(coefficients, self.variance)",
        "render/test_transport",
        "render/test_error_estimates",
    ),
    _fault(
        "lamps met and sampled, each in full",
        "render/integrator/dense.py",
        "weight = dr.rcp(1 + dr.square(b / a))",
        "weight = dr.rcp(1 + 0 * dr.square(b / a))",
        "render/test_engine",
        "render/test_hard_cases",
        "render/integrator/test_matte",
    ),
    _fault(
        "roulette without its weight",
        "render/integrator/dense.py",
        "factor = dr.select(plays, dr.rcp(survival), 1.0)",
        "factor = dr.select(plays, 1.0, 1.0)",
        "render/test_engine",
        "render/test_hard_cases",
        "render/integrator/test_matte",
    ),
)

ISP = (
    _fault(
        "alpha inverted",
        "isp/reference.py",
        "alpha[at] * np.sqrt(distance[i][at]) + (1.0 - alpha[at])",
        "(1.0 - alpha[at]) * np.sqrt(distance[i][at]) + alpha[at]",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "neighbourhood one short",
        "isp/reference.py",
        "range(-settings.reach, settings.reach + 1)",
        "range(-settings.reach, settings.reach)",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "wrong normaliser",
        "isp/reference.py",
        "sums.value / sums.weight,",
        "sums.value / np.sqrt(sums.square),",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "spatial weight without its 2",
        "isp/reference.py",
        "/ (2.0 * settings.sigma_d**2)",
        "/ settings.sigma_d**2",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "similarity not squared",
        "isp/reference.py",
        "trust[at] * beta_s**2",
        "trust[at] * beta_s",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "noise added to the distance",
        "isp/reference.py",
        "np.maximum(total - noise",
        "np.maximum(total + noise",
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "patches repeat the border",
        "isp/reference.py",
        '(half, half)), mode="reflect")',
        '(half, half)), mode="edge")',
        "isp/test_interleaved",
        "isp/kernel/test_kernel",
    ),
    _fault(
        "alpha not normalised at the border",
        "isp/similarity/guide.py",
        "np.minimum(line + half, line[-1]) - np.maximum(line - half, 0) + 1 for",
        "np.full(line.size, window) for",
        *_SIMILARITY,
    ),
    _fault(
        "similarity always trusted",
        "isp/similarity/guide.py",
        "    result /= signal_e\n",
        "    result[...] = 1.0\n",
        *_SIMILARITY,
    ),
    _fault(
        "noise taken for interpolation error",
        "isp/similarity/interpolation.py",
        "change -= 2.0",
        "change -= 0.0",
        "isp/similarity/test_interpolation",
        *_SIMILARITY,
    ),
    _fault(
        "distances trusted between samples that differ",
        "isp/similarity/interpolation.py",
        "    result += NOISE_OVER_INTERPOLATION\n",
        "    result[...] = NOISE_OVER_INTERPOLATION\n",
        "isp/similarity/test_interpolation",
        *_SIMILARITY,
    ),
    _fault(
        "lamps spread over the dark",
        "isp/similarity/brightest.py",
        "        bound *= z\n",
        "        bound *= 1e3 * z\n",
        "isp/similarity/test_brightest",
        *_SIMILARITY,
    ),
    _fault(
        "overlap of patches forgotten",
        "isp/similarity/noise_distance.py",
        "variance + other - 2.0 * covariance[at]",
        "variance + other",
        *_SIMILARITY,
    ),
    _fault(
        "Anscombe without dark noise",
        "isp/anscombe.py",
        "return np.asarray(2.0 * np.sqrt(np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0)))",
        "return np.asarray(2.0 * np.sqrt(np.maximum(electrons + 0.375, 0.0)))",
        *_SIMILARITY,
    ),
    _fault("PRNU left out of the transform", "isp/anscombe.py", "0.0) + (prnu * seen) ** 2", "0.0)", *_SIMILARITY),
    _fault(
        "box in place of tent",
        "isp/planes.py",
        "return radius + 1.0 - np.abs(np.arange(-radius, radius + 1))",
        "return np.ones(2 * radius + 1)",
        *_SIMILARITY,
    ),
    _fault(
        "white balance inverted",
        "isp/colour/white_balance.py",
        "means[green] / np.where(certain, means, 1.0)",
        "np.where(certain, means, 1.0) / means[green]",
        *_COLOUR,
    ),
    _fault(
        "Gray World over saturated pixels",
        "isp/colour/white_balance.py",
        "        usable = ~saturated_nearby(raw, colours)\n",
        "        usable = np.ones(raw.shape, dtype=bool)\n",
        "isp/test_pipeline",
    ),
    _fault(
        "highlights not held",
        "isp/colour/highlights.py",
        "np.minimum(rows_at(balanced, clipped), raw.full_well_e)",
        "rows_at(balanced, clipped)",
        "isp/test_pipeline",
        "isp/processors/test_catalogue",
    ),
    _fault("gamma 2.2", "rodcone/colour_spaces.py", "clipped ** (1 / 2.4)", "clipped ** (1 / 2.2)", *_COLOUR),
    _fault(
        "adaptation the wrong way",
        "rodcone/colour_spaces.py",
        "np.diag(_BRADFORD @ xyz_from_xy(D65_XY) / source)",
        "np.diag(source / (_BRADFORD @ xyz_from_xy(D65_XY)))",
        *_COLOUR,
    ),
    _fault(
        "substitution in the light",
        "isp/substitution.py",
        "return float(above < 0.0)",
        "return float(above > 0.0)",
        "isp/test_substitution",
    ),
    _fault(
        "colours fitted without their noise",
        "isp/colour/colour_fit.py",
        "np.broadcast_to(noise, len(index)) + LEAST_NOISE",
        "",
        *_COLOUR,
    ),
    _fault(
        "inverse transform forgets dark noise",
        "isp/anscombe.py",
        "(0.125 + dark_noise_e**2) + series",
        "0.125 + series",
        "isp/test_anscombe",
    ),
)

_KERNEL = ("isp/test_interleaved", "isp/kernel/test_kernel")

KERNEL = (
    _fault(
        "kernel's alpha inverted",
        "isp/kernel/accumulate.py",
        "zip(own, white, alpha, strict=True)",
        "zip(white, own, alpha, strict=True)",
        *_KERNEL,
    ),
    _fault(
        "kernel mixes without the cross term",
        "isp/kernel/accumulate.py",
        "(2.0 / ROOT_SCALE)",
        "(0.0 / ROOT_SCALE)",
        *_KERNEL,
    ),
    _fault(
        "kernel forgets what noise alone makes",
        "isp/kernel/accumulate.py",
        "larger(total - share, 0.0)",
        "larger(total, 0.0)",
        *_KERNEL,
    ),
    _fault(
        "kernel's neighbourhood one short",
        "isp/kernel/schedule.py",
        "np.arange(-reach, reach + 1)",
        "np.arange(-reach, reach)",
        *_KERNEL,
    ),
    _fault(
        "kernel's spatial weight in base e",
        "isp/kernel/schedule.py",
        "log_spatial = -np.log2(np.e) * (row**2",
        "log_spatial = -(row**2",
        *_KERNEL,
    ),
    _fault(
        "kernel counts samples outside the frame",
        "isp/kernel/accumulate.py",
        "OUTSIDE = 1e13",
        "OUTSIDE = 0.0",
        *_KERNEL,
    ),
    _fault(
        "kernel counts samples outside the frame where similarity isn't trusted",
        "isp/kernel/layout.py",
        "np.maximum(inverse_variance, np.float32(LEAST_INVERSE_VARIANCE), out=inverse_variance)",
        "np.maximum(inverse_variance, np.float32(0.0), out=inverse_variance)",
        *_KERNEL,
    ),
    _fault("2^x with a wrong coefficient", "isp/kernel/accumulate.py", "0.22606716", "0.22906716", *_KERNEL),
)

STUDIES = (
    _fault(
        "PSNR of amplitudes",
        "studies/metrics/quality.py",
        "-10 * np.log10",
        "-20 * np.log10",
        "studies/metrics/test_truth_metrics",
        "studies/metrics/test_quality",
    ),
    _fault(
        "white among the lamps",
        "studies/metrics/truth.py",
        "white_of(transport.scattered_luminance(luminance_cd_m2=luminance_cd_m2), transport.coverage.mean)",
        "white_of(transport.relight().luminance(), 0 * transport.coverage.mean)",
        "studies/metrics/test_truth_metrics",
        "studies/study/test_lit_scene",
    ),
    _fault(
        "known scale without the lens",
        "studies/metrics/truth.py",
        " * camera_equation(sensor.lens))",
        ")",
        "studies/metrics/test_truth_metrics",
        "studies/photograph/test_camera",
    ),
)

# What the program states of its own work.
RENDERS = (
    _fault(
        "samples told as asked",
        "render/engine.py",
        "counts=2 * means.count * means.rates,",
        "counts=(limits.spp or 2 * means.count) * means.rates,",
        "render/test_samples",
        "studies/test_stated_numbers",
    ),
    _fault(
        "parts of equal weight",
        "render/runs.py",
        "weight = np.float32(chunk / (means.count + chunk))",
        "weight = np.float32(1 if means.count == 0 else 0.5)",
        "render/test_samples",
        "render/test_engine",
    ),
    _fault(
        "an error believed at once", "render/limits.py", "LEAST_POINTS = 8", "LEAST_POINTS = 1", "render/test_engine"
    ),
    _fault(
        "seconds of the earlier render forgotten",
        "render/engine.py",
        "start = time.perf_counter() - (earlier.seconds if earlier else 0.0)",
        "start = time.perf_counter()",
        "render/test_engine",
        "render/test_cache",
    ),
    _fault(
        "a level's error without that of its area",
        "render/level.py",
        "off = np.append(weights.ravel(), -value)",
        "off = np.append(weights.ravel(), 0.0)",
        "render/test_transport",
    ),
    _fault(
        "lamps of the picture in its level",
        "render/integrator/dense.py",
        "emitted, dr.select(unseen, share, 0.0)",
        "emitted, share",
        "render/test_engine",
    ),
    _fault(
        "halves clipped at 0",
        "render/transport.py",
        "SpectralRadiance(np.moveaxis(half, 0, -1),",
        "SpectralRadiance(np.moveaxis(np.maximum(half, 0), 0, -1),",
        "render/test_transport",
    ),
    _fault(
        "another band than rendered",
        "studies/study/lit_scene.py",
        "bands=transport.wavelength_nm.size,",
        "bands=transport.wavelength_nm.size + 1,",
        "studies/test_stated_numbers",
    ),
    _fault(
        "the longest exposure as the shortest",
        "studies/sweep/frames.py",
        "(min(longest_s, unit_s / luminance_cd_m2) ",
        "(max(longest_s, unit_s / luminance_cd_m2) ",
        "studies/test_stated_numbers",
    ),
    _fault(
        "the whole difference of a render's halves as its error",
        "render/error_estimates.py",
        "pooled_by_sample(np.square(difference), rates)",
        "pooled_by_sample(np.square(2 * difference), rates)",
        "render/test_engine",
        "render/test_error_estimates",
    ),
    _fault(
        "pooled over three pixels",
        "render/error_estimates.py",
        "planes.dtype.type(9)",
        "planes.dtype.type(3)",
        "render/test_error_estimates",
    ),
    _fault(
        "the end told of another limit", "render/limits.py", 'return "noise"', 'return "samples"', "render/test_engine"
    ),
    _fault(
        "the whole difference of the halves as error",
        "studies/sweep/frames.py",
        "[(one - other) / 2]",
        "[one - other]",
        "studies/sweep/test_run_sweep",
    ),
    _fault(
        "variant told as the scalar one",
        "studies/sweep/run_cell.py",
        "variant=cell.made_by.variant,",
        'variant="scalar_spectral",',
        "studies/sweep/test_provenance",
    ),
    _fault(
        "a version left out",
        "studies/sweep/provenance.py",
        '"scikit-image", "colour-science"',
        '"scikit-image"',
        "studies/sweep/test_provenance",
    ),
    _fault(
        "an interval of one side",
        "studies/metrics/confidence.py",
        "student.isf((1 - confidence) / 2,",
        "student.isf((1 - confidence),",
        "studies/metrics/test_confidence",
    ),
    _fault(
        "processor's seconds from the wall clock",
        "studies/speed/points.py",
        "wall, processor = time.perf_counter(), time.process_time()",
        "wall, processor = time.perf_counter(), time.process_time() * 0",
        "studies/commands/test_bench",
    ),
    _fault(
        "a share of noise from amplitudes",
        "studies/speed/points.py",
        "(point.error_e / stage.noise_e) ** 2",
        "(point.error_e / stage.noise_e)",
        "studies/commands/test_bench",
    ),
    _fault(
        "white at another percentile",
        "rodcone/colour_spaces.py",
        "= 99.0, 0.9",
        "= 90.0, 0.9",
        "studies/metrics/test_truth_metrics",
    ),
)

SCENES_FROM_OUTSIDE = (
    _fault(
        "reflectance read as a plain property",
        "render/integrator/matte.py",
        'props.get_texture("reflectance")',
        'props["reflectance"]',
        "render/integrator/test_reflectance_nodes",
    ),
    _fault(
        "held ends are zero",
        "render/scene.py",
        "np.interp(far, nm, table.values)",
        "np.interp(far, nm, table.values, left=0.0, right=0.0)",
        "render/test_scene_range",
    ),
    _fault(
        "a surface's table may end one side within the bands",
        "render/scene_range.py",
        "if shortest_nm < low - _SLACK_NM or longest_nm > high + _SLACK_NM:",
        "if shortest_nm < low - _SLACK_NM and longest_nm > high + _SLACK_NM:",
        "render/test_scene_range",
    ),
    _fault(
        "no warning of a light that ends within the bands",
        "render/transport.py",
        "if power > 0:",
        "if power > 1e30:",
        "render/test_scene_range",
        "studies/commands/test_render",
    ),
    _fault(
        "folders of a trusted scene forgotten",
        "render/user_scene/scene_file.py",
        "[Path(str(place)) for place in mi.file_resolver()] if trust else [file.parent]",
        "[file.parent]",
        "render/user_scene/test_scene_file",
    ),
    _fault(
        "any share of stored photons may be negative",
        "render/radiance_files/iset.py",
        "MOST_NEGATIVE = 0.01",
        "MOST_NEGATIVE = 1.0",
        "render/radiance_files/test_iset",
    ),
)

_ACCOUNTS = ("studies/photograph/test_clock", "studies/sweep/test_run_cell", "studies/sweep/test_provenance")
ACCOUNTING = (
    _fault(
        "a cell's Monte Carlo share over saturated pixels too",
        "studies/budget/budget.py",
        "inside = expected_e < sensor.pixel.full_well_e\n    if not inside.any():\n        return 0.0\n    monte",
        "inside = expected_e < np.inf\n    if not inside.any():\n        return 0.0\n    monte",
        "studies/sweep/test_run_cell",
    ),
    _fault(
        "render seconds counted once a cell",
        "studies/sweep/run_sweep.py",
        'return {"captures": row.capture_s,',
        'return {"renders": row.render_s, "captures": row.capture_s,',
        "studies/photograph/test_clock",
    ),
    _fault(
        "threads told as 1",
        "studies/sweep/run_cell.py",
        "threads=threads(),",
        "threads=1,",
        "studies/sweep/test_provenance",
    ),
    _fault(
        "engine of captures 'cuda'",
        "studies/sweep/run_cell.py",
        "readout_engine=raw.engine,",
        'readout_engine="cuda",',
        "studies/sweep/test_provenance",
        "studies/photograph/test_clock",
    ),
    _fault(
        "capture and develop seconds swapped",
        "studies/sweep/run_cell.py",
        "capture_s=capture_s,\n        develop_s=develop_s,",
        "capture_s=develop_s,\n        develop_s=capture_s,",
        *_ACCOUNTS,
    ),
    _fault(
        "first calls within the seconds",
        "studies/photograph/clock.py",
        "    _CALLED.add(kind)\n    start = time.perf_counter()\n",
        "    _CALLED.add(kind)\n",
        "studies/photograph/test_clock",
    ),
    _fault(
        "another kernel's first call within the seconds",
        "studies/sweep/run_cell.py",
        "bool(saturated.any()), bool(saturated.all())",
        "True, True",
        "studies/photograph/test_clock",
    ),
    _fault(
        "stages without the rest",
        "studies/photograph/clock.py",
        " - sum(seconds.values())}",
        " * 0}",
        "studies/photograph/test_clock",
    ),
    _fault(
        "seconds of all workers as one's",
        "studies/sweep/run_sweep.py",
        "value / workers for",
        "value for",
        "studies/photograph/test_clock",
    ),
    _fault(
        "the first scene's cells alone as wanted",
        "studies/sweep/run_sweep.py",
        "if cells else [None] * count for cells in found",
        "if cells else [] for cells in found",
        "studies/sweep/test_stored",
    ),
    _fault(
        "versions of the process that asks for the report",
        "studies/pages/report_facts.py",
        "{**in_words(made_by(row)), ",
        '{**in_words(made_by(row)), "numpy": "2", ',
        "studies/sweep/test_provenance",
    ),
    _fault(
        "keys without versions",
        "studies/sweep/cells.py",
        "exposure_s, made_by])",
        "exposure_s])",
        "studies/sweep/test_cells",
        "studies/sweep/test_provenance",
    ),
    _fault(
        "no digest of arrays",
        "studies/sweep/stored.py",
        "digest_file(path) == path.stem",
        "size > 0",
        "studies/sweep/test_stored",
    ),
    _fault(
        "no digest of rows",
        "studies/sweep/database.py",
        "digest(values[:-1]) == values[-1]",
        "True",
        "studies/sweep/test_stored",
    ),
)

# What must be refused or told, taken as it comes.
NONSENSE = (
    _fault(
        "saturated = (dn >= white)",
        "sensor/raw.py",
        "return self.electrons >= self.saturation_e",
        "return self.dn >= self.white_dn",
        "sensor/test_raw",
    ),
    _fault("black level rounded down", "sensor/config.py", "ceil(least - 1e-9)", "int(least)", "sensor/test_config"),
    _fault(
        "raw image of NaN",
        "sensor/raw.py",
        'kind == "f" and not np.isfinite(samples).all()',
        'kind == "f" and np.isinf(samples).any()',
        "sensor/test_raw",
    ),
    _fault("raw image of complex numbers", "sensor/raw.py", 'not in "uif"', 'not in "uifc"', "sensor/test_raw"),
    _fault(
        "PSNR of a picture that isn't finite",
        "studies/metrics/quality.py",
        "    require_finite(picture=picture, truth=truth)\n    mean_square",
        "    mean_square",
        "studies/metrics/test_quality",
    ),
    _fault(
        "micrometres taken for nanometres",
        "render/spectrum.py",
        "SHORTEST_NM, LONGEST_NM = 100.0",
        "SHORTEST_NM, LONGEST_NM = 0.1",
        "render/test_spectrum",
    ),
    _fault(
        "bands that overlap", "render/spectrum.py", "MOST_OVERLAP = 0.01", "MOST_OVERLAP = 1.01", "render/test_spectrum"
    ),
    _fault(
        "lost share of energy instead of photons",
        "sensor/response.py",
        " * photons_per_joule(nm) * step",
        " * step",
        "sensor/test_response_window",
    ),
    _fault(
        "window left open, untold",
        "sensor/response.py",
        "LEAST_WARNED = 5e-3",
        "LEAST_WARNED = 0.5",
        "sensor/test_response_window",
    ),
    _fault(
        "channel without light",
        "sensor/response.py",
        "MOST_LOST = 0.5",
        "MOST_LOST = 1.0",
        "sensor/test_response_window",
    ),
    _fault(
        "white frame untold",
        "studies/photograph/shot.py",
        "MOST_SATURATED = 0.5",
        "MOST_SATURATED = 0.99",
        "studies/commands/test_capture_develop",
    ),
    _fault(
        "seeds = 3 is the seed 3",
        "studies/study/study_file.py",
        "list(range(seeds))",
        "[seeds]",
        "studies/study/test_study_file",
    ),
    _fault(
        "address-space limit taken as all free",
        "rodcone/memory.py",
        "most - _pages(0), True)",
        "most, True)",
        "rodcone/test_memory",
    ),
    _fault(
        "control group's use taken as free",
        "rodcone/memory.py",
        "most - used + float(cached)",
        "float(most)",
        "rodcone/test_memory",
    ),
    _fault(
        "need of one light group whatever there are",
        "rodcone/memory.py",
        "* denoised) * groups",
        "* denoised)",
        "rodcone/test_memory",
    ),
)

FAULTS = (*SENSOR, *LENS, *LIGHT, *ISP, *KERNEL, *STUDIES, *RENDERS, *SCENES_FROM_OUTSIDE, *ACCOUNTING, *NONSENSE)
