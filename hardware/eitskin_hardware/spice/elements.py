"""Each kind of part as lines of a deck."""

from collections.abc import Callable
from dataclasses import dataclass

from eitskin_hardware.circuit.design import GROUNDS, Part

ON_OHM, OFF_OHM = 120.0, 1e12  # ADG1206 at +-15 V, data sheet
SOURCE_F, DRAIN_F = 1.5e-12, 13.5e-12  # off: 1.5 pF and 11 pF; on: 15 pF together
ESD_F = 3e-12  # ESD2CAN24
ESD_MODEL = "ESD 3 pF"
ADC_F, ADC_PIN_F, ADC_OHM = 4e-12, 5e-12, 1500.0  # STM32F767: sampling capacitor, pin, switch
SINE_V, SINE_BIAS_V, SINE_OHM = 0.306, 0.344, 200.0  # AD9833: 0.038 to 0.65 V behind 200 ohm
OPA828 = "gbw=45meg sr=150meg drop=1.3 ro=20"
TL071H = "gbw=5meg sr=20meg drop=1.2 ro=100"
OPA320 = "gbw=20meg sr=10meg drop=0.02 ro=20 a0=3meg"


def node(net: str) -> str:
    """Return the node of a net: the star point joins both grounds."""
    if net in GROUNDS:
        return "0"
    return net.lower().replace("+", "p_").replace("-", "m_")


@dataclass(frozen=True)
class Conditions:
    """The case that the deck is written for: every amplifier has ``offset_v``, and ``body`` adds
    the diodes from a multiplexer's pins to its supplies."""

    offset_v: float = 0.0
    body: bool = False
    frequency_hz: float = 50_000.0


def lines(part: Part, conditions: Conditions) -> list[str]:
    """Return the lines of a part: none for connectors and what is not an electrical part."""
    write = _WRITERS.get(part.kind.name)
    return write(part, conditions) if write else []


def _two(letter: str) -> Callable[[Part, Conditions], list[str]]:
    def write(part: Part, _: Conditions) -> list[str]:
        value = "1m" if part.value == "0" else part.value.replace("M", "meg")
        return [f"{letter}{part.ref} {_nodes(part, '1', '2')} {value}"]

    return write


def _nodes(part: Part, *pins: str) -> str:
    """The nodes at these pins; a pin that is not connected has one of its own."""
    return " ".join(
        node(part.net[pin]) if pin in part.net else f"{part.ref}_{pin}_open" for pin in pins
    )


def _op_amp(params: str) -> Callable[[Part, Conditions], list[str]]:
    def write(part: Part, conditions: Conditions) -> list[str]:
        pins = _nodes(part, "+IN", "-IN", "V+", "V-", "OUT")
        return [f"X{part.ref} {pins} EITOPAMP {params} vos={conditions.offset_v:g}"]

    return write


def _in_amp(part: Part, _: Conditions) -> list[str]:
    pins = _nodes(part, "-IN", "RG1", "RG2", "+IN", "-VS", "REF", "OUT", "+VS")
    return [f"X{part.ref} {pins} EITINAMP", f"RX{part.ref} {_nodes(part, 'RG1', 'RG2')} 1g"]


def _generator(part: Part, conditions: Conditions) -> list[str]:
    """The sine, if clock, bus and supply are connected as drawn."""
    wired = (
        all(
            part.net.get(pin) == net
            for pin, net in (("MCLK", "PA8"), ("SDATA", "PC12"), ("SCLK", "PC10"), ("FSYNC", "PD2"))
        )
        and part.net.get("VDD") == "+3V3"
    )
    amplitude = SINE_V if wired else 0.0
    return [
        f"V{part.ref} {part.ref}_v 0 dc {SINE_BIAS_V} ac {amplitude}"
        f" sin({SINE_BIAS_V} {amplitude} {conditions.frequency_hz:g})",
        f"R{part.ref} {part.ref}_v {_nodes(part, 'VOUT')} {SINE_OHM:g}",
    ]


def _multiplexer(part: Part, conditions: Conditions) -> list[str]:
    """A resistor for each switch, all open: the bench closes one. With ``body`` also the diodes
    from each pin to its supplies."""
    drain = _nodes(part, "D")
    made = [f"C{part.ref}_D {drain} 0 {DRAIN_F:g}"]
    for k in range(1, 17):
        electrode = _nodes(part, f"S{k}")
        made.append(f"R{part.ref}_{k} {electrode} {drain} {OFF_OHM:g}")
        made.append(f"C{part.ref}_{k} {electrode} 0 {SOURCE_F:g}")
    if conditions.body:
        up, down = _nodes(part, "VDD"), _nodes(part, "VSS")
        for pin in ("A0", "A1", "A2", "A3", "EN"):
            line = _nodes(part, pin)
            made += [f"D{part.ref}_{pin} {line} {up} eitbody", f"R{part.ref}_{pin} {line} 0 1g"]
        for pin in ("D", *(f"S{k}" for k in range(1, 17))):
            here = _nodes(part, pin)
            made += [f"DU{part.ref}_{pin} {here} {up} eitbody"]
            made += [f"DD{part.ref}_{pin} {down} {here} eitbody"]
    return made


def _nucleo(part: Part, _: Conditions) -> list[str]:
    """Its supplies, its pull-up at PC11, and the converter's input."""
    return [
        f"V{part.ref}_3V3 {_nodes(part, '3V3')} 0 3.3",
        f"V{part.ref}_AVDD {_nodes(part, 'AVDD')} 0 3.3",
        f"R{part.ref}_PC11 {_nodes(part, 'PC11', '3V3')} 40k",
        f"C{part.ref}_PA3 {_nodes(part, 'PA3')} 0 {ADC_PIN_F:g}",
        f"R{part.ref}_PA3 {_nodes(part, 'PA3')} 0 1g",
    ]


def _esd(part: Part, _: Conditions) -> list[str]:
    return [f"C{part.ref}_{k} {_nodes(part, f'IO{k}', 'GND')} {ESD_F:g}" for k in (1, 2)]


def _clamp(part: Part, _: Conditions) -> list[str]:
    low, high, middle = (_nodes(part, pin) for pin in ("A", "K", "AK"))
    return [
        f"D{part.ref}_1 {low} {middle} eitschottky",
        f"D{part.ref}_2 {middle} {high} eitschottky",
    ]


_WRITERS: dict[str, Callable[[Part, Conditions], list[str]]] = {
    **{kind: _two("R") for kind in ("R", "R 0.1 %")},
    **{kind: _two("C") for kind in ("C C0G", "C film", "C X7R", "C bulk")},
    "Zener": lambda part, _: [f"X{part.ref} {_nodes(part, 'K', 'A')} EITZENER"],
    "optocoupler": lambda part, _: [f"X{part.ref} {_nodes(part, 'A', 'K', 'E', 'C')} EITOPTO"],
    "OPA828": _op_amp(OPA828),
    "TL071H": _op_amp(TL071H),
    "OPA320": _op_amp(OPA320),
    "AD8421": _in_amp,
    "AD9833": _generator,
    "ADG1206": _multiplexer,
    "NUCLEO-F767ZI": _nucleo,
    "ESD2CAN24": _esd,
    "BAT54S": _clamp,
}
