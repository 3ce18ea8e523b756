"""All wavelength bands along one light path."""
