"""The two readers of .eitm files side by side."""

from eitskin.core.engine import CoreEngine
from eitskin.errors import ModelError
from eitskin.model.eitm import decode_model


def accepts(blob: bytes) -> tuple[bool, bool]:
    """Whether Python and C read ``blob``; whatever they raise but ModelError goes through and fails
    the test, and so does a refusal that is not one line or, of Python's, lacks the file's name."""
    answers = []
    for read in (lambda: decode_model(blob, "x.eitm"), lambda: CoreEngine(blob, prepared=False)):
        try:
            read()
            answers.append(True)
        except ModelError as error:
            assert "\n" not in str(error)
            assert answers or str(error).startswith("x.eitm: ")
            answers.append(False)
    return answers[0], answers[1]


def agreed(blob: bytes, what: object) -> bool:
    """Whether both read ``blob``; fails where they differ."""
    python, c = accepts(blob)
    assert python == c, f"{what}: Python {'reads' if python else 'refuses'} it, C does not"
    return python
