"""The reconstructors of one model by each engine, as one."""

from collections.abc import Callable, Iterable
from typing import Any

from eitskin.model.model import Model
from eitskin.solve.reconstructor import ENGINES, Reconstructor


class AllEngines(dict[str, Reconstructor]):
    """Passes each call to every engine, and returns the results by engine:
    ``all_engines.tare(untouched)`` has the reference that each of them learned."""

    def __init__(
        self,
        model: Model,
        blob: bytes | None = None,
        engines: Iterable[str] = ENGINES,
        **options: object,
    ) -> None:
        super().__init__({name: Reconstructor(model, engine=name, blob=blob) for name in engines})
        self.set_options(**options)

    def __getattr__(self, name: str) -> Callable[..., dict[str, Any]]:
        return lambda *given, **named: {
            engine: getattr(one, name)(*given, **named) for engine, one in self.items()
        }
