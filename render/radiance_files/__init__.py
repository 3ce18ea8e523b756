"""Files of spectral radiance or reflectance: OpenEXR, ISETCam's scenes, cubes and photographs."""
