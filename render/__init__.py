"""Light before any camera: spectra, scenes, the rendering engine, relighting, photometry."""
