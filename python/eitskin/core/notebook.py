"""The display of touches in notebooks."""

from collections.abc import Sequence

from eitskin.core.diagnostics_table import Touch


def places_text(touches: Sequence[Touch]) -> str:
    """Return "#1 (-40.0, 10.0), #2 ..." or "none"."""
    return ", ".join(f"#{t.id} ({t.x_mm:.1f}, {t.y_mm:.1f})" for t in touches) or "none"


def touches_html(caption: str, touches: Sequence[Touch]) -> str:
    """Return an HTML table with a row per touch."""
    names = ("id", "x mm", "y mm", "radius mm", "strength S mm²/m", "force N", "confidence")
    rows = [
        (
            str(t.id),
            f"{t.x_mm:.1f}",
            f"{t.y_mm:.1f}",
            f"{t.radius_mm:.1f}",
            f"{t.strength_s_per_m_mm2:.2f}",
            f"{t.force_n:.2f}" if t.force_n else "–",
            "–" if t.confidence is None else f"{t.confidence:.2f}",
        )
        for t in touches
    ]
    head = "".join(f"<th>{name}</th>" for name in names)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><caption>{caption}</caption><tr>{head}</tr>{body}</table>"
