"""Kernels of Fresnel zones and the edges that cross them."""
