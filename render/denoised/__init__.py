"""Denoised light and the measurement of its error."""
