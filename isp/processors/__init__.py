"""Every way to make a picture from a raw file."""
