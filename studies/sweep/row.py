"""One row of a sweep's results: a cell, its figures, and the versions and engines that made them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """Content of the results database for one cell. A repeated run changes only the columns on time and machine.

    Attributes
    ----------
    key : str
        Key of the `Cell`.
    scene ... seed
        Place of the cell in its study; scene and sensor files by their names.
    luminance_cd_m2, illuminance_lux, exposure_s : float
        The level in both units (lux where the scene states a plane), and the time of one frame.
    gain_factor, iso : float
        Gain with which the frame was read, and the camera's speed at that gain, None for a mosaic without green.
    spp : float
        Mean samples per pixel of the render. For an edge the render's pixels are finer than the sensor's.
    bands : int
        Number of bands of the render.
    render : str
        Further facts of the render, as JSON: `studies.sweep.cells.render_text`.
    lens : str
        Terms of the modelled lens, as JSON.
    budget_share : float or None
        Share of the noise variance that a plan predicts for its approximations.
    psnr_db, ssim, delta_e_median, delta_e_p95 : float
        As in `studies.metrics.appearance.Quality`.
    s_cielab_median, s_cielab_p95, flip_mean, pu21_psnr_db : float
        As in `studies.metrics.appearance.Appearance`.
    mtf50_cy_per_px, chart_delta_e_mean, patch_snr_db : float or None
        As in `studies.metrics.target_figures.TargetFigures`.
    mc_share : float
        Monte Carlo variance over the sensor's own noise variance, both as means over the pixels below saturation.
    snr_db : float or None
        SNR of green [dB], where the processor measures it.
    substitution : int or None
        1 where W replaced the luminance, else 0; None where the processor doesn't do that.
    saturated : float
        Share of saturated pixels.
    balance_delta_e : float or None
        CIEDE2000 between a neutral grey of 18 % and a noise-free frame of it under the scene's light that is developed
        with the exposure's white balance. It is 0 as shot; for Gray World it says how far its balance is off. None for
        a processor that states no balance.
    balance, mean_electrons : str
        Balance and mean electrons by channel, as JSON.
    variant, readout_engine, development_engine, versions : str
        As in `studies.sweep.provenance.Provenance`; the engines are those that the raw image and the picture name.
    picture, truth : str
        Files of the developed and the noise-free picture below the folder of pictures.
    render_s : float
        Seconds of the render that the cell shares with others.
    capture_s, develop_s, measure_s : float or None
        Seconds of the cell's own steps; None for a step that was the first of its kind in the process.
    first_s : float
        Seconds of those first steps, which compile and load.
    threads : int
        Threads of Dr.Jit's kernels in the process.
    finished : str
        UTC.
    host, machine : str
        The computer's name; and its processor, operating system and Python. On another machine the same cell may differ
        in the last bits of its figures.
    worker : int
        Number that the host's operating system gives to the thread that ran the cell.
    """

    key: str
    scene: str
    spectrum: str
    level: str
    exposure: str
    sensor: str
    white_balance: str
    frames: int
    gain: str
    processor: str
    seed: int
    luminance_cd_m2: float
    illuminance_lux: float | None
    exposure_s: float
    gain_factor: float
    iso: float | None
    spp: float
    bands: int
    render: str
    lens: str
    budget_share: float | None
    psnr_db: float
    ssim: float
    delta_e_median: float
    delta_e_p95: float
    s_cielab_median: float
    s_cielab_p95: float
    flip_mean: float
    pu21_psnr_db: float
    mtf50_cy_per_px: float | None
    chart_delta_e_mean: float | None
    patch_snr_db: float | None
    mc_share: float
    snr_db: float | None
    substitution: int | None
    saturated: float
    balance_delta_e: float | None
    balance: str
    mean_electrons: str
    variant: str
    readout_engine: str
    development_engine: str
    versions: str
    picture: str
    truth: str
    render_s: float
    capture_s: float | None
    develop_s: float | None
    measure_s: float | None
    first_s: float
    threads: int
    finished: str
    host: str
    machine: str
    worker: int


AXES = ("scene", "spectrum", "level", "exposure", "sensor", "white_balance", "frames", "gain", "processor")
