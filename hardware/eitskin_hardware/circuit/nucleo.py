"""The pins of the NUCLEO-F767ZI and what each is joined to: the circuit, the table of
docs/guide/hardware.md and the drawing of the wiring are made from it.

Connectors and pins after ST's UM1974, tables 18 and 25: the Zio connectors CN7 to CN10 take plugs,
the morpho ones CN11 and CN12 are holes in the board, with every pin of the processor.
"""

from dataclasses import dataclass

MULTIPLEXERS = ("I+", "I-", "V+", "V-")

# Supplies and grounds that the shield uses (UM1974, table 18)
LOGIC_SUPPLY, GROUND = "CN8-7", "CN8-11"
ANALOG_SUPPLY, ANALOG_GROUND = "CN10-1", "CN10-3"


@dataclass(frozen=True)
class Wire:
    """One wire: a pin of the processor, where the board has it, what the firmware does with it, and
    its other end.

    ``zio`` is empty if only the morpho connector has the pin; both are empty if the board itself
    uses it."""

    pin: str
    zio: str
    morpho: str
    function: str
    to: str


_PORT_E = (
    ("CN10-33", "CN12-64"), ("", "CN11-61"), ("CN9-14", "CN11-46"), ("CN9-22", "CN11-47"),
    ("CN9-16", "CN11-48"), ("CN9-18", "CN11-50"), ("CN9-20", "CN11-62"), ("CN10-20", "CN12-44"),
    ("CN10-18", "CN12-40"), ("CN10-4", "CN12-52"), ("CN10-24", "CN12-47"), ("CN10-6", "CN12-56"),
    ("CN10-26", "CN12-49"), ("CN10-10", "CN12-55"), ("CN10-28", "CN12-51"), ("CN10-30", "CN12-53"),
)  # fmt: skip
_PORT_F = (
    ("CN7-20", "CN12-59"),
    ("CN10-2", "CN12-57"),
    ("CN10-8", "CN12-50"),
    ("CN10-12", "CN12-60"),
)


def _wires() -> tuple[Wire, ...]:
    wires = [
        Wire("PA8", "", "CN12-23", "MCO1, 8 MHz", "AD9833 MCLK"),
        Wire("PC10", "CN8-6", "CN11-1", "SPI3 SCK", "AD9833 SCLK"),
        Wire("PC12", "CN8-10", "CN11-3", "SPI3 MOSI", "AD9833 SDATA"),
        Wire("PD2", "CN8-12", "CN11-4", "output", "AD9833 FSYNC"),
    ]
    for number, name in enumerate(MULTIPLEXERS):
        for address in range(4):
            pin = 4 * number + address
            zio, morpho = _PORT_E[pin]
            wires.append(Wire(f"PE{pin}", zio, morpho, "output", f"ADG1206 {name} A{address}"))
        zio, morpho = _PORT_F[number]
        wires.append(Wire(f"PF{12 + number}", zio, morpho, "output", f"ADG1206 {name} EN"))
    wires += [
        Wire("PA3", "CN9-1", "CN12-37", "ADC1 input 3", "output of the receiver"),
        Wire("PC0", "CN9-3", "CN11-38", "ADC2 input 10", "sense resistor, where fitted"),
        Wire("PC11", "CN8-8", "CN11-2", "input, pulled up", "supply good"),
        Wire("PC13", "", "", "input", "B1, blue: the owner's button"),
        Wire("PD8", "", "", "USART3 TX, 1 Mbaud", "ST-LINK, on the board"),
        Wire("PD9", "", "", "USART3 RX, 1 Mbaud", "ST-LINK, on the board"),
        Wire("PB0", "", "", "output", "LD1, green: alive"),
        Wire("PB7", "", "", "output", "LD2, blue: a touch"),
        Wire("PB14", "", "", "output", "LD3, red: a fault"),
    ]
    return tuple(wires)


WIRES = _wires()
