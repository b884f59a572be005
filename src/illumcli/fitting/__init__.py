"""Fit the parameters of illumination models to measured BRDFs."""
