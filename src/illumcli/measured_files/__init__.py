"""Files of measurements, one module per format: what they hold, without evaluating it."""
