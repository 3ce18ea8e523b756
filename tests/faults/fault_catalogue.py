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
    return Fault(
        name,
        file,
        ((there, instead),),
        tuple(f"tests/{test}.py" if "/" in test else f"tests/test_{test}.py" for test in tests),
    )


_READOUT = ("sensor_noise", "sensor_capture", "sensor_crosstalk", "sensor_device", "sensor_lanes", "sensor_emva")
_LENS = ("sensor_optics", "sensor_diffraction", "sensor_hard_cases")
_LIGHT = ("render_photometry", "render_spectrum", "render_illuminants", "sensor_optics")
_SIMILARITY = ("isp/similarity/test_guide", "isp/test_planes", "isp_bayer", "isp/test_interleaved")
_COLOUR = ("isp_colour", "isp_colour_fit", "isp_pipeline", "studies_truth_metrics")

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
                "2 * pixel.full_well_e + 1e4)).astype(np.float64)\n",
                "2 * pixel.full_well_e + 1e4)).astype(np.float64) * device.photo_response\n",
            ),
        ),
        tuple(f"tests/test_{name}.py" for name in _READOUT),
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
        tuple(f"tests/test_{name}.py" for name in _READOUT),
    ),
    _fault(
        "conversion gain inverted",
        "sensor/readout.py",
        "collected_e / sensor.gain_e_per_dn",
        "collected_e * sensor.gain_e_per_dn",
        *_READOUT,
    ),
    _fault("black level missing", "sensor/readout.py", " + sensor.black_dn)", ")", *_READOUT),
    _fault("converter rounds down", "sensor/readout.py", "np.rint(collected_e", "np.floor(collected_e", *_READOUT),
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
        "normals(key, Term.READ",
        "normals(0, Term.READ",
        *_READOUT,
    ),
    _fault(
        "hot pixels without the exposure time",
        "sensor/readout.py",
        "hot_pixel_dark_current_e_per_s * exposure_s",
        "hot_pixel_dark_current_e_per_s",
        *_READOUT,
    ),
    _fault(
        "DSNU drawn with PRNU's numbers",
        "sensor/device.py",
        "normals(key, Term.DSNU, shape)",
        "normals(key, Term.PRNU, shape)",
        "sensor_device",
        *_READOUT,
    ),
    _fault(
        "quantisation noise of gain^2 / 2",
        "sensor/noise.py",
        "sensor.gain_e_per_dn**2 / 12",
        "sensor.gain_e_per_dn**2 / 2",
        *_READOUT,
    ),
    _fault(
        "PRNU not squared in the variance",
        "sensor/noise.py",
        "(pixel.prnu * signal) ** 2",
        "(pixel.prnu * signal)",
        *_READOUT,
    ),
    _fault(
        "crosstalk makes charge",
        "sensor/crosstalk.py",
        "(1 - 4 * crosstalk)",
        "(1 - 3 * crosstalk)",
        "sensor_crosstalk",
        *_READOUT,
    ),
    _fault(
        "black not subtracted from the raw image",
        "sensor/raw.py",
        "np.float64) - self.black_dn)",
        "np.float64))",
        "sensor_raw",
        *_READOUT,
    ),
    _fault(
        "saturation above the full well",
        "sensor/raw.py",
        "full_e - SATURATION_SIGMAS",
        "full_e + SATURATION_SIGMAS",
        "sensor_raw",
        "isp_pipeline",
    ),
    _fault(
        "kernel leaves PRNU out",
        "sensor/kernel.py",
        "dr.fma(finite_e, jit.Float(chip.photo_response), chip.dark_e)",
        "finite_e + chip.dark_e",
        "sensor_lanes",
        "sensor_kernel",
    ),
    _fault(
        "kernel's well does not clip",
        "sensor/kernel.py",
        "dr.minimum(collected_e, chip.full_well_e)",
        "collected_e",
        "sensor_lanes",
        "sensor_kernel",
    ),
    _fault(
        "Poisson series with a wrong term",
        "sensor/poisson.py",
        "dr.fma(square, 1 / 6, 1 / 3)",
        "dr.fma(square, 1 / 3, 1 / 3)",
        "sensor_poisson",
        "sensor_kernel",
    ),
    _fault("nine rounds of Philox", "sensor/random.py", "ROUNDS = 10", "ROUNDS = 9", "sensor_random"),
    _fault(
        "Box-Muller with half the variance",
        "sensor/random.py",
        "np.sqrt(-2.0 * np.log1p",
        "np.sqrt(-1.0 * np.log1p",
        "sensor_random",
        "sensor_device",
    ),
    _fault(
        "every row draws the same shot noise",
        "sensor/random.py",
        "counter=np.array([0, 0, row, int(term)]",
        "counter=np.array([0, 0, 0, int(term)]",
        "sensor_random",
        *_READOUT,
    ),
    _fault(
        "auto exposure forgets the share of the well",
        "sensor/exposure.py",
        "min(longest_s, well_share * sensor",
        "min(longest_s, sensor",
        "sensor_exposure",
    ),
    _fault(
        "mosaic one row off",
        "sensor/cfa.py",
        "np.tile(cells, repeats)",
        "np.tile(np.roll(cells, 1, 0), repeats)",
        "sensor_cfa",
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
        "sensor/diffraction.py",
        "(1 - lens.veiling_glare) * light +",
        "light +",
        "sensor_diffraction",
        *_LENS,
    ),
    _fault(
        "diffraction at half the f-number",
        "sensor/diffraction.py",
        "wavelength_nm * 1e-3 * lens.f_number",
        "wavelength_nm * 0.5e-3 * lens.f_number",
        "sensor_diffraction",
    ),
    _fault(
        "fill factor left out",
        "sensor/response.py",
        " * sensor.pixel.fill_factor",
        "",
        "sensor_response",
        "sensor_exposure",
        *_LENS,
    ),
    _fault("band width left out", "sensor/response.py", " * seen_nm * area_m2", " * area_m2", "sensor_response"),
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
        "uncovered = float(self.spp @ self.uncovered) / float(self.spp.sum())",
        "uncovered = 1.0",
        "render_transport",
    ),
    _fault(
        "variance scales as the light",
        "render/transport.py",
        "_combine(coefficients**2, self.variance)",
        "_combine(coefficients, self.variance)",
        "render_transport",
        "render_error_estimates",
    ),
    _fault(
        "lamps met and sampled, each in full",
        "render/dense.py",
        "weight = dr.rcp(1 + dr.square(b / a))",
        "weight = dr.rcp(1 + 0 * dr.square(b / a))",
        "render_engine",
        "render_hard_cases",
        "render_matte",
    ),
    _fault(
        "roulette without its weight",
        "render/dense.py",
        "factor = dr.select(plays, dr.rcp(survival), 1.0)",
        "factor = dr.select(plays, 1.0, 1.0)",
        "render_engine",
        "render_hard_cases",
        "render_matte",
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
        "overlap of patches forgotten",
        "isp/similarity/noise_distance.py",
        "variance + other - 2.0 * covariance[at]",
        "variance + other",
        *_SIMILARITY,
    ),
    _fault(
        "Anscombe without dark noise",
        "isp/planes.py",
        "return np.asarray(2.0 * np.sqrt(np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0)))",
        "return np.asarray(2.0 * np.sqrt(np.maximum(electrons + 0.375, 0.0)))",
        *_SIMILARITY,
    ),
    _fault("PRNU left out of the transform", "isp/planes.py", "0.0) + (prnu * seen) ** 2", "0.0)", *_SIMILARITY),
    _fault(
        "box in place of tent",
        "isp/planes.py",
        "return radius + 1.0 - np.abs(np.arange(-radius, radius + 1))",
        "return np.ones(2 * radius + 1)",
        *_SIMILARITY,
    ),
    _fault(
        "white balance inverted",
        "isp/colour.py",
        "np.where(certain, means[green] / np.where(certain, means, 1.0), calibrated)",
        "np.where(certain, np.where(certain, means, 1.0) / means[green], calibrated)",
        *_COLOUR,
    ),
    _fault(
        "Gray World over saturated pixels",
        "isp/balance.py",
        '    colours = ~saturated_nearby(raw, "RGB")\n',
        "    colours = np.ones(raw.shape, dtype=bool)\n",
        "isp_pipeline",
    ),
    _fault(
        "highlights not held",
        "isp/balance.py",
        "np.where(clipped[..., None], np.minimum(balanced, full_e(raw)), balanced)",
        "balanced",
        "isp_pipeline",
        "isp_processors",
    ),
    _fault("gamma 2.2", "isp/colour.py", "clipped ** (1 / 2.4)", "clipped ** (1 / 2.2)", *_COLOUR),
    _fault(
        "adaptation the wrong way",
        "isp/colour.py",
        "np.diag(_BRADFORD @ xyz_from_xy(_D65_XY) / source)",
        "np.diag(source / (_BRADFORD @ xyz_from_xy(_D65_XY)))",
        *_COLOUR,
    ),
    _fault(
        "substitution in the light",
        "isp/substitution.py",
        "return float(above < 0.0)",
        "return float(above > 0.0)",
        "isp_substitution",
    ),
    _fault(
        "colours fitted without their noise",
        "isp/colour_fit.py",
        "np.broadcast_to(noise, len(index)) + LEAST_NOISE",
        "",
        *_COLOUR,
    ),
    _fault(
        "inverse transform forgets dark noise",
        "isp/anscombe.py",
        "np.asarray(series - dark_noise_e**2)",
        "np.asarray(series)",
        "isp_anscombe",
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
        "_at_least(total - share, 0.0)",
        "_at_least(total, 0.0)",
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
        "studies/metrics.py",
        "-10 * np.log10",
        "-20 * np.log10",
        "studies_truth_metrics",
        "studies_metrics",
    ),
    _fault(
        "white among the lamps",
        "studies/truth.py",
        "weights = 1.0 - transport.coverage.astype(np.float64)",
        "weights, luminance = None, transport.relight().luminance()",
        "studies_truth_metrics",
        "studies_lit_scene",
    ),
    _fault(
        "known scale without the lens",
        "studies/truth.py",
        " * camera_equation(sensor.lens))",
        ")",
        "studies_truth_metrics",
        "studies_camera",
    ),
)

# What the program states of its own work.
RENDERS = (
    _fault(
        "samples told as asked",
        "render/limits.py",
        "                return held\n",
        "                return spp\n",
        "render_samples",
        "studies_stated_numbers",
    ),
    _fault(
        "passes of equal weight",
        "render/passes.py",
        "mean += delta * (weight / drawn)",
        "mean += delta / np.float32(sums.passes)",
        "render_samples",
        "render_engine",
    ),
    _fault(
        "an error believed after two passes",
        "render/limits.py",
        "passes >= PASSES and error",
        "passes >= 2 and error",
        "render_engine",
    ),
    _fault(
        "seconds of the earlier render forgotten",
        "render/engine.py",
        "start = time.perf_counter() - (earlier.seconds if earlier else 0.0)",
        "start = time.perf_counter()",
        "render_engine",
        "render_cache",
    ),
    _fault(
        "a level's error without the passes' scatter",
        "render/level.py",
        "variance = float(share @ off**2) / (self.spp.size - 1)",
        "variance = float(share @ off**2)",
        "render_transport",
    ),
    _fault(
        "lamps of the picture in its level",
        "render/dense.py",
        "emitted, dr.select(indirect, share, 0.0)",
        "emitted, share",
        "render_engine",
    ),
    _fault(
        "halves clipped at 0",
        "render/transport.py",
        "SpectralRadiance(_view(half),",
        "SpectralRadiance(_view(np.maximum(half, 0)),",
        "render_transport",
    ),
    _fault(
        "another band than rendered",
        "studies/prepare.py",
        "bands=record.bands,",
        "bands=record.bands + 1,",
        "studies_stated_numbers",
    ),
    _fault(
        "the longest exposure as the shortest",
        "studies/prepare.py",
        "min(job.study.longest_exposure_s, ",
        "max(job.study.longest_exposure_s, ",
        "studies_stated_numbers",
    ),
    _fault(
        "variance of the passes by their number",
        "render/passes.py",
        "1 / ((self.passes - 1) * self.drawn)",
        "1 / (self.passes * self.drawn)",
        "render_engine",
    ),
    _fault(
        "pooled over three pixels",
        "render/error_estimates.py",
        "0.0) * factor / 9)",
        "0.0) * factor / 3)",
        "render_error_estimates",
    ),
    _fault("the end told of another limit", "render/limits.py", 'return "noise"', 'return "samples"', "render_engine"),
    _fault(
        "samples of the demo's render as passes",
        "studies/results.py",
        '"passes": transport.passes,',
        '"passes": transport.spp,',
        "studies_stated_numbers",
    ),
    _fault(
        "the whole difference of the halves as error",
        "studies/budget.py",
        "((even - odd) ** 2 / 4)",
        "((even - odd) ** 2)",
        "studies_truth_metrics",
    ),
    _fault(
        "variant told as the scalar one",
        "studies/cell_run.py",
        "variant=cell.made_by.variant,",
        'variant="scalar_spectral",',
        "studies_provenance",
    ),
    _fault(
        "a version left out",
        "studies/provenance.py",
        '"scikit-image", "colour-science"',
        '"scikit-image"',
        "studies_provenance",
    ),
    _fault(
        "an interval of one side",
        "studies/confidence.py",
        "student.isf((1 - confidence) / 2,",
        "student.isf((1 - confidence),",
        "studies_confidence",
    ),
    _fault(
        "processor's seconds from the wall clock",
        "studies/bench_points.py",
        "wall, processor = time.perf_counter(), time.process_time()",
        "wall, processor = time.perf_counter(), time.process_time() * 0",
        "studies_bench",
    ),
    _fault(
        "a share of noise from amplitudes",
        "studies/bench_points.py",
        "(point.error_e / stage.noise_e) ** 2",
        "(point.error_e / stage.noise_e)",
        "studies_bench",
    ),
    _fault("white at another percentile", "studies/truth.py", "= 99.0, 0.9", "= 90.0, 0.9", "studies_truth_metrics"),
)

SCENES_FROM_OUTSIDE = (
    _fault(
        "reflectance read as a plain property",
        "render/matte.py",
        'props.get_texture("reflectance")',
        'props["reflectance"]',
        "render_reflectance_nodes",
    ),
    _fault(
        "held ends are zero",
        "render/scene.py",
        "np.interp(far, nm, table.values)",
        "np.interp(far, nm, table.values, left=0.0, right=0.0)",
        "render_scene_range",
    ),
    _fault(
        "a surface's table may end one side within the bands",
        "render/scene_range.py",
        "if shortest_nm < low - _SLACK_NM or longest_nm > high + _SLACK_NM:",
        "if shortest_nm < low - _SLACK_NM and longest_nm > high + _SLACK_NM:",
        "render_scene_range",
    ),
    _fault(
        "no warning of a light that ends within the bands",
        "render/transport.py",
        "if power > 0:",
        "if power > 1e30:",
        "render_scene_range",
        "studies_render_command",
    ),
    _fault(
        "folders of a trusted scene forgotten",
        "render/scene_file.py",
        "[Path(str(place)) for place in mi.file_resolver()] if trust else [file.parent]",
        "[file.parent]",
        "render_scene_file",
    ),
    _fault(
        "any share of stored photons may be negative",
        "render/iset.py",
        "MOST_NEGATIVE = 0.01",
        "MOST_NEGATIVE = 1.0",
        "render_iset",
    ),
)

_ACCOUNTS = ("studies_clock", "studies_cell_run", "studies_provenance")
ACCOUNTING = (
    _fault(
        "a cell's Monte Carlo share over saturated pixels too",
        "studies/cell_run.py",
        "inside = expected_e < cell.sensor.pixel.full_well_e",
        "inside = expected_e < np.inf",
        "studies_cell_run",
    ),
    _fault(
        "render seconds counted once a cell",
        "studies/sweep.py",
        'return {"captures": row.capture_s,',
        'return {"renders": row.render_s, "captures": row.capture_s,',
        "studies_clock",
    ),
    _fault("threads told as 1", "studies/cell_run.py", "threads=threads(),", "threads=1,", "studies_provenance"),
    _fault(
        "engine of captures 'cuda'",
        "studies/cell_run.py",
        "readout_engine=raw.engine,",
        'readout_engine="cuda",',
        "studies_provenance",
    ),
    _fault(
        "engine of the demo's captures 'cuda'",
        "studies/demo.py",
        '"engines": {"capture": shot.raw.engine,',
        '"engines": {"capture": "cuda",',
        "studies_clock",
    ),
    _fault(
        "capture and develop seconds swapped",
        "studies/cell_run.py",
        '{"capture_s": capture_s, "develop_s": develop_s,',
        '{"capture_s": develop_s, "develop_s": capture_s,',
        *_ACCOUNTS,
    ),
    _fault(
        "capture and develop seconds of a photograph swapped",
        "studies/camera.py",
        "picture, capture_s, develop_s, measure_s",
        "picture, develop_s, capture_s, measure_s",
        "studies_clock",
    ),
    _fault(
        "first calls within the seconds",
        "studies/clock.py",
        "    _CALLED.add(kind)\n    start = time.perf_counter()\n",
        "    _CALLED.add(kind)\n",
        "studies_clock",
    ),
    _fault(
        "another kernel's first call within the seconds",
        "studies/cell_run.py",
        "bool(saturated.any()), bool(saturated.all())",
        "True, True",
        "studies_clock",
    ),
    _fault("stages without the rest", "studies/clock.py", " - sum(seconds.values())}", " * 0}", "studies_clock"),
    _fault("seconds of all workers as one's", "studies/sweep.py", "value / workers for", "value for", "studies_clock"),
    _fault(
        "the first scene's cells alone as wanted",
        "studies/sweep.py",
        "if cells else [None] * count for cells in found",
        "if cells else [] for cells in found",
        "studies_stored",
    ),
    _fault(
        "versions of the process that asks for the report",
        "studies/report_facts.py",
        "{**told(made_by(row)), ",
        '{**told(made_by(row)), "numpy": "2", ',
        "studies_provenance",
    ),
    _fault(
        "keys without versions",
        "studies/cells.py",
        "exposure_s, colours, made_by])",
        "exposure_s, colours])",
        "studies_cells",
        "studies_provenance",
    ),
    _fault("no digest of arrays", "studies/stored.py", "digest_file(path) == path.stem", "size > 0", "studies_stored"),
    _fault("no digest of rows", "studies/ledger.py", "digest(values[:-1]) == values[-1]", "True", "studies_stored"),
)

# What must be refused or told, taken as it comes.
NONSENSE = (
    _fault(
        "saturated = (dn >= white)",
        "sensor/raw.py",
        "return self.electrons >= self.saturation_e",
        "return self.dn >= self.white_dn",
        "sensor_raw",
    ),
    _fault(
        "black level rounded down",
        "sensor/config.py",
        "ceil(least - 1e-9)",
        "int(least)",
        "sensor_config",
    ),
    _fault(
        "raw image of NaN",
        "sensor/raw.py",
        'kind == "f" and not np.isfinite(samples).all()',
        'kind == "f" and np.isinf(samples).any()',
        "sensor_raw",
    ),
    _fault("raw image of complex numbers", "sensor/raw.py", 'not in "uif"', 'not in "uifc"', "sensor_raw"),
    _fault(
        "PSNR of a picture that isn't finite",
        "studies/metrics.py",
        "    require_finite(picture=picture, truth=truth)\n    mean_square",
        "    mean_square",
        "studies_metrics",
    ),
    _fault(
        "micrometres taken for nanometres",
        "render/spectrum.py",
        "SHORTEST_NM, LONGEST_NM = 100.0",
        "SHORTEST_NM, LONGEST_NM = 0.1",
        "render_spectrum",
    ),
    _fault("bands that overlap", "render/spectrum.py", "MOST_OVERLAP = 0.01", "MOST_OVERLAP = 1.01", "render_spectrum"),
    _fault(
        "lost share of energy instead of photons",
        "sensor/window.py",
        " * photons_per_joule(nm) * step",
        " * step",
        "sensor_window",
    ),
    _fault("window left open, untold", "sensor/window.py", "LEAST_TOLD = 5e-3", "LEAST_TOLD = 0.5", "sensor_window"),
    _fault("channel without light", "sensor/window.py", "MOST_LOST = 0.5", "MOST_LOST = 1.0", "sensor_window"),
    _fault(
        "white frame untold",
        "studies/shot.py",
        "MOST_SATURATED = 0.5",
        "MOST_SATURATED = 0.99",
        "studies_capture_develop",
    ),
    _fault("seeds = 3 is the seed 3", "studies/study_file.py", "list(range(seeds))", "[seeds]", "studies_study_file"),
    _fault(
        "address-space limit taken as all free",
        "studies/memory.py",
        "most - _pages(0), True)",
        "most, True)",
        "studies_memory",
    ),
    _fault(
        "control group's use taken as free",
        "studies/memory.py",
        "most - used + float(cached)",
        "float(most)",
        "studies_memory",
    ),
    _fault(
        "need of one light group whatever there are",
        "studies/memory.py",
        "_TRANSPORT_ARRAYS * groups",
        "_TRANSPORT_ARRAYS",
        "studies_memory",
    ),
)

FAULTS = (*SENSOR, *LENS, *LIGHT, *ISP, *KERNEL, *STUDIES, *RENDERS, *SCENES_FROM_OUTSIDE, *ACCOUNTING, *NONSENSE)
