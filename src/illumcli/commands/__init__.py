"""What each command does, without click.

All of them compute with numpy, which is imported here, ahead of the modules that use it. Imported from there,
so deep in the stack, its functions would cross the end of a block of the interpreter's stack at each call,
and blocks are allocated and freed as they are entered and left: 1,800 times in a small render, 2 % of it.
"""

import numpy as np  # noqa: F401
