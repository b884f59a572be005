"""Files of measured BRDFs, one module per format: what they hold, without evaluating it."""
