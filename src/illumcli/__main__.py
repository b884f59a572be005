"""``python -m illumcli`` is the ``illum`` command."""

from illumcli.cli import main

main()
