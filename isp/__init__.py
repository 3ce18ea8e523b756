"""Development of raw data to a picture: the interleaved camera of Parmar & Wandell 2009, piecewise linear estimation,
and the processors with which both are compared.
"""
