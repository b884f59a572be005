"""Several pieces of work: one that fails is told, the others are done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from illumcli.errors import IllumError, known

Tell = Callable[[str], None]


class Batch:
    """What became of `count` pieces of work, which are `what`; `tell` is given the text of each failure.

    With `keep_going` the pieces after one that failed are due as those before it are, else those before it
    alone. What a lone piece raises goes on its way.
    """

    def __init__(self, what: str, count: int, keep_going: bool, tell: Tell) -> None:
        self.failures: dict[int, IllumError] = {}
        self._what, self._count = what, count
        self._keep_going, self._tell = keep_going, tell

    def due(self) -> Iterator[int]:
        """The numbers of the pieces that are still to be done."""
        for number in range(self._count):
            if self.failures and not self._keep_going and number > min(self.failures):
                return
            if number not in self.failures:
                yield number

    @contextmanager
    def piece(self, number: int, label: str = "") -> Iterator[None]:
        """What goes wrong within is a failure of this piece, told after its label."""
        try:
            yield
        except Exception as error:
            failure = known(error)
            if failure is None or self._count == 1:
                raise
            self.failures[number] = failure
            self._tell(f"{label}: {failure}" if label else str(failure))

    def finish(self, *also: str) -> None:
        """Raise how many pieces failed and what is `also` to be told, with the exit code of the first."""
        if self.failures:
            failed = f"{len(self.failures)} of {self._count} {self._what} failed"
            whole = IllumError("\n".join([failed, *also]))
            whole.exit_code = self.failures[min(self.failures)].exit_code
            raise whole
