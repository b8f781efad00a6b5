"""Everything that eitskin refuses, one class a kind, each with the exit code that the command line
returns.

An error's text is one line that says what was wrong, where, and what to do about it.
docs/reference/error-codes.md lists the codes.
"""

LONGEST, ENDING = 3000, 1000  # characters of a line, and of its end


class EitskinError(Exception):
    """Base of all errors that a user can cause or repair; ``exit_code`` is the command line's
    status. Its text stays one line, whatever names and values out of files it names."""

    exit_code = 1

    def __str__(self) -> str:
        text = super().__str__()
        if (
            len(text) > LONGEST
        ):  # somebody's very long word in the middle: what to do is said at the end
            text = f"{text[: LONGEST - ENDING - 5]} ... {text[-ENDING:]}"
        return (
            text
            if text.isprintable()
            else "".join(one if one.isprintable() else repr(one)[1:-1] for one in text)
        )


class UsageError(EitskinError):
    """An option or argument is out of range or contradicts another."""

    exit_code = 2


class FileError(EitskinError):
    """A file is missing, unreadable, or cannot be written."""

    exit_code = 3


class ConfigError(EitskinError):
    """A TOML description has an unknown key, a wrong type or a value out of range."""

    exit_code = 4


class GeometryError(EitskinError):
    """An outline or its electrodes cannot be: self-intersecting, overlapping, too small; or meshing
    failed."""

    exit_code = 5


class ModelError(EitskinError):
    """An .eitm model is truncated, corrupted, newer, foreign, or fails its self-test."""

    exit_code = 6


class ProtocolError(EitskinError):
    """A protocol table is invalid, or frames and model were made with different protocols."""

    exit_code = 7


class FrameError(EitskinError):
    """Boundary voltages cannot be used: wrong length, not finite, all zero, saturated."""

    exit_code = 8


class MissingExtraError(EitskinError):
    """An optional dependency is not installed; the text gives the pip command."""

    exit_code = 9


class VerificationError(EitskinError):
    """A self-check ran and its result is outside the stated bound."""

    exit_code = 10


class DeviceError(EitskinError):
    """A board or its link cannot be used: no port, no answer, another version, another model, a
    command refused."""

    exit_code = 12  # 11 is doctor's


class SinkError(EitskinError):
    """What touches are sent to cannot be opened: its port is taken, nobody answers there."""

    exit_code = 13


def missing_checkout(what: str, *folders: str) -> MissingExtraError:
    """The error for ``what`` that the wheel does not have, but ``folders`` of a checkout."""
    names = " ".join(f"./{folder}" for folder in folders)
    return MissingExtraError(
        f"{what} comes with eitskin's sources alone: run there  pip install {names}"
    )


def missing_extra(extra: str, package: str) -> MissingExtraError:
    """The error for an absent optional ``package`` that the extra named ``extra`` brings."""
    return MissingExtraError(
        f"this needs {package}, which is not installed: run  pip install 'eitskin[{extra}]'"
    )
