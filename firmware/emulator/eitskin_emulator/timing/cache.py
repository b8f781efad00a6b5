"""A cache of the STM32F767: 16 KB, 4 ways, lines of 32 bytes (RM0410 1.2; ``cache.c``)."""

LINE_BITS, SETS, WAYS = 5, 128, 4


class Cache:
    """A cache that knows which lines it holds, without their contents."""

    def __init__(self, random_replacement: bool) -> None:
        self._random = random_replacement
        self._sets: list[list[int]] = [[] for _ in range(SETS)]  # the latest used is last
        self._changed: set[int] = set()
        self._next = 1
        self.misses = 0

    def use(self, line: int, store: bool = False) -> tuple[bool, bool]:
        """Return whether ``line`` (address >> 5) was there, and whether a changed one had to go for
        it."""
        ways = self._sets[line & (SETS - 1)]
        if store:
            self._changed.add(line)
        if line in ways:
            if not self._random and ways[-1] != line:
                ways.remove(line)
                ways.append(line)
            return True, False
        self.misses += 1
        pushed = False
        if len(ways) == WAYS:
            gone = ways.pop(self._draw() if self._random else 0)
            pushed = gone in self._changed
            self._changed.discard(gone)
        ways.append(line)
        return False, pushed

    def _draw(self) -> int:
        """A way, from a generator that always begins alike."""
        self._next = (self._next * 1103515245 + 12345) & 0x7FFFFFFF
        return self._next >> 16 & (WAYS - 1)
