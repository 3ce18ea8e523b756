"""Raw images as files: DNG, TIFF, raws of real cameras."""
