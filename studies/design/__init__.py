"""Which mosaic for which light: a sensor's expected error under a prior over patches, in closed form."""
