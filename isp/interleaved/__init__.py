"""The camera of Parmar & Wandell, "Interleaved imaging" (Proc. SPIE 7250, 2009), and this project's additions to it.

| the paper | here |
|---|---|
| eq. (1), every channel at every pixel | `reconstruction.reconstruct`; step by step `numpy_form.reference_with_noise` |
| eqs. (2) to (5), weights and distances | `numpy_form.sum_weights` |
| eq. (6), where W is saturated | `saturation.saturated_fraction`, mixed in `numpy_form` |
| 3.1, the interleaved camera | `pipeline.picture_interleaved_paper`, with this project's guide `picture_interleaved` |
| 3.1.3, W in place of luminance | `isp.substitution` |
| 3.2, the conventional camera | `pipeline.picture_bayer` |

Four modules aren't in the paper: `panchromatic` reads every sample as W, and this one plane guides all channels;
`brightest` limits how bright a sample may be to count; `thin` gives planes the light of which they have no sample;
`edges` sharpens. `kernel` computes the same formulas in Dr.Jit, and is tested against `numpy_form` and the NumPy forms
of the others.
"""
