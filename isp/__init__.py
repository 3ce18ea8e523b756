"""From raw data to a picture: interleaved reconstruction (Parmar & Wandell 2009) and the Bayer reference."""
