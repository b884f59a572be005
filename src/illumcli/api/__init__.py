"""The commands as functions of Python: scenes and meshes in, arrays out; nothing is written unless asked."""
