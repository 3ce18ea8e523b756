"""The interleaved reconstruction in Dr.Jit, one source for processors and CUDA: see `isp.interleaved.kernel.run`."""
