"""OpenImageIO, imported only when there is memory for it: without 46 MB it ends the process."""

from __future__ import annotations

from illumcli.memory import refuse_little

refuse_little(1 << 26)
import OpenImageIO as oiio  # noqa: E402

__all__ = ["oiio"]
