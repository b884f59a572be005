"""The pages of the site that are made from the code, the scenes and the folder `docs`."""
