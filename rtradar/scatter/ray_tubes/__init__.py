"""Shooting and bouncing rays: tubes of rays, their bounces and their footprints."""
