"""Cameras that exist: measured responses, published noise, and preset files made of them."""
