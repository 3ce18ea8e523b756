"""The interleaved reconstruction in Dr.Jit, one source for CPUs and CUDA; it begins in `isp.interleaved.kernel.run`."""
