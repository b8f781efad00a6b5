"""The parts: their pins, packages and order numbers.

Pins are those of the manufacturers' data sheets. Prices are approximate, for one piece, in US
dollars, noted in ``PRICES_OF``; no shop was asked.
"""

from dataclasses import dataclass

PRICES_OF = "November 2026"

PASSIVE, INPUT, OUTPUT, POWER_IN, POWER_OUT, UNUSED = (
    "PASSIVE",
    "INPUT",
    "OUTPUT",
    "PWRIN",
    "PWROUT",
    "NOCONNECT",
)


@dataclass(frozen=True)
class Pin:
    """A pin: its number on the package, its name, and its function for the electrical rules."""

    number: str
    name: str
    function: str = PASSIVE


@dataclass(frozen=True)
class Kind:
    """A kind of part. ``footprint`` is the name in KiCad's libraries, empty for what is not
    soldered to the shield."""

    name: str
    prefix: str
    pins: tuple[Pin, ...]
    footprint: str


@dataclass(frozen=True)
class Order:
    """How a part is ordered: ``value`` is empty if the kind alone says it."""

    kind: str
    value: str
    maker: str
    number: str
    what: str
    alternatives: str
    price_usd: float


def _two(name: str, prefix: str, footprint: str) -> Kind:
    return Kind(name, prefix, (Pin("1", "1"), Pin("2", "2")), footprint)


def _op_amp(name: str) -> Kind:
    pins = (
        Pin("1", "NC1", UNUSED),
        Pin("2", "-IN", INPUT),
        Pin("3", "+IN", INPUT),
        Pin("4", "V-", POWER_IN),
        Pin("5", "NC5", UNUSED),
        Pin("6", "OUT", OUTPUT),
        Pin("7", "V+", POWER_IN),
        Pin("8", "NC8", UNUSED),
    )
    return Kind(name, "U", pins, "Package_SO:SOIC-8_3.9x4.9mm_P1.27mm")


def _multiplexer() -> Kind:
    pins = [Pin("1", "VDD", POWER_IN), Pin("2", "NC2", UNUSED), Pin("3", "NC3", UNUSED)]
    pins += [Pin(str(4 + k), f"S{16 - k}") for k in range(8)]
    pins += [Pin("12", "GND", POWER_IN), Pin("13", "NC13", UNUSED)]
    pins += [Pin(str(14 + k), f"A{3 - k}", INPUT) for k in range(4)]
    pins += [Pin("18", "EN", INPUT)]
    pins += [Pin(str(19 + k), f"S{1 + k}") for k in range(8)]
    pins += [Pin("27", "VSS", POWER_IN), Pin("28", "D")]
    return Kind("ADG1206", "U", tuple(pins), "Package_SO:TSSOP-28_4.4x9.7mm_P0.65mm")


def _connector(name: str, names: tuple[str, ...], function: str, footprint: str) -> Kind:
    pins = tuple(Pin(str(k + 1), pin, function) for k, pin in enumerate(names))
    return Kind(name, "J", pins, footprint)


_AD9833 = (
    Pin("1", "COMP"),
    Pin("2", "VDD", POWER_IN),
    Pin("3", "CAP"),
    Pin("4", "DGND", POWER_IN),
    Pin("5", "MCLK", INPUT),
    Pin("6", "SDATA", INPUT),
    Pin("7", "SCLK", INPUT),
    Pin("8", "FSYNC", INPUT),
    Pin("9", "AGND", POWER_IN),
    Pin("10", "VOUT", OUTPUT),
)
_AD8421 = (
    Pin("1", "-IN", INPUT),
    Pin("2", "RG1"),
    Pin("3", "RG2"),
    Pin("4", "+IN", INPUT),
    Pin("5", "-VS", POWER_IN),
    Pin("6", "REF", INPUT),
    Pin("7", "OUT", OUTPUT),
    Pin("8", "+VS", POWER_IN),
)
_OPA320 = (
    Pin("1", "OUT", OUTPUT),
    Pin("2", "V-", POWER_IN),
    Pin("3", "+IN", INPUT),
    Pin("4", "-IN", INPUT),
    Pin("5", "V+", POWER_IN),
)
_OPTOCOUPLER = (Pin("1", "A"), Pin("2", "K"), Pin("3", "E"), Pin("4", "C"))

KINDS = {
    kind.name: kind
    for kind in (
        _two("R", "R", "Resistor_SMD:R_0805_2012Metric"),
        _two("R 0.1 %", "R", "Resistor_SMD:R_0805_2012Metric"),
        _two("C C0G", "C", "Capacitor_SMD:C_0805_2012Metric"),
        _two("C film", "C", "Capacitor_SMD:C_1210_3225Metric"),
        _two("C X7R", "C", "Capacitor_SMD:C_0805_2012Metric"),
        _two("C bulk", "C", "Capacitor_SMD:CP_Elec_6.3x5.4"),
        _two("star point", "NT", "NetTie:NetTie-2_SMD_Pad2.0mm"),
        Kind("Zener", "D", (Pin("1", "K"), Pin("2", "A")), "Diode_SMD:D_SOD-123"),
        Kind("BAT54S", "D", (Pin("1", "A"), Pin("2", "K"), Pin("3", "AK")), "Package_TO_SOT_SMD:SOT-23"),
        Kind(
            "ESD2CAN24", "D", (Pin("1", "IO1"), Pin("2", "IO2"), Pin("3", "GND")), "Package_TO_SOT_SMD:SOT-23"
        ),
        Kind("optocoupler", "U", _OPTOCOUPLER, "Package_DIP:DIP-4_W7.62mm"),
        Kind("AD9833", "U", _AD9833, "Package_SO:MSOP-10_3x3mm_P0.5mm"),
        _op_amp("OPA828"),
        _op_amp("TL071H"),
        Kind("AD8421", "U", _AD8421, "Package_SO:SOIC-8_3.9x4.9mm_P1.27mm"),
        Kind("OPA320", "U", _OPA320, "Package_TO_SOT_SMD:SOT-23-5"),
        _multiplexer(),
        _connector(
            "supply inlet", ("+15V", "AGND", "-15V"), POWER_OUT, "TerminalBlock_Phoenix:TerminalBlock_Phoenix_MKDS-1,5-3_1x03_P5.00mm_Horizontal"
        ),
        _connector(
            "electrode connector",
            tuple(name for k in range(16) for name in (f"E{k}", f"AGND{k}")),
            PASSIVE,
            "Connector_IDC:IDC-Header_2x16_P2.54mm_Vertical",
        ),
    )
}  # fmt: skip


def _chip_resistor(value: str, code: str, tight: bool = False) -> Order:
    if tight:
        return Order(
            "R 0.1 %", value, "Susumu", f"RG2012P-{code}-B-T5", f"{value}Ω 0.1 % 25 ppm/K 0805",
            "Panasonic ERA-6A series; any 0.1 %, 25 ppm/K, 0805", 0.45,
        )  # fmt: skip
    return Order(
        "R", value, "Yageo", f"RC0805FR-07{code}L", f"{value}Ω 1 % 0805", "any 1 % 0805", 0.03
    )


ORDERS = (
    Order("ADG1206", "", "Analog Devices", "ADG1206YRUZ", "multiplexer 16 to 1, ±15 V", "none with as little capacitance; ADG1406 and ADG406 have the same pins and several times as much", 9.5),
    Order("AD9833", "", "Analog Devices", "AD9833BRMZ", "sine generator", "AD9833 module, its oscillator taken off", 10.5),
    Order("OPA828", "", "Texas Instruments", "OPA828ID", "FET amplifier, 45 MHz", "OPA827AID, ADA4627-1BRZ", 6.5),
    Order("TL071H", "", "Texas Instruments", "TL071HIDR", "FET amplifier, servo", "TL071CDR, OPA1641AID", 0.7),
    Order("AD8421", "", "Analog Devices", "AD8421ARZ", "instrumentation amplifier", "AD8421BRZ", 9.0),
    Order("OPA320", "", "Texas Instruments", "OPA320AIDBVR", "amplifier, 3.3 V, rail to rail", "OPA365AIDBVR", 2.2),
    Order("BAT54S", "", "Nexperia", "BAT54S,215", "two Schottky diodes in series", "any BAT54S", 0.15),
    Order("ESD2CAN24", "", "Texas Instruments", "ESD2CAN24DBZRQ1", "two ESD diodes, 24 V, both directions, 3 pF", "two diodes a line below 5 pF, 24 V", 0.45),
    Order("optocoupler", "", "Lite-On", "LTV-817", "optocoupler, current transfer 50 % or more", "PC817, EL817", 0.3),
    Order("Zener", "24V", "Diodes Inc.", "BZT52C24-7-F", "Zener diode 24 V", "any 24 V, 0.3 W, SOD-123", 0.1),
    _chip_resistor("100", "100R"),
    _chip_resistor("1k", "1K"),
    _chip_resistor("1.15k", "1K15"),
    _chip_resistor("2.2k", "2K2"),
    _chip_resistor("2.26k", "2K26"),
    _chip_resistor("10k", "10K"),
    _chip_resistor("100k", "100K"),
    _chip_resistor("1M", "1M"),
    _chip_resistor("10M", "10M"),
    Order("R", "0", "Yageo", "RC0805JR-070RL", "0 Ω 0805", "a drop of solder", 0.03),
    _chip_resistor("1k", "102", tight=True),
    _chip_resistor("2k", "202", tight=True),
    _chip_resistor("4.87k", "4871", tight=True),
    _chip_resistor("10k", "103", tight=True),
    Order("C C0G", "470p", "Murata", "GRM2165C1H471JA01D", "470 pF 5 % C0G 50 V 0805", "any C0G 5 %, 50 V", 0.1),
    Order("C C0G", "1n", "Murata", "GRM2165C1H102JA01D", "1 nF 5 % C0G 50 V 0805", "any C0G 5 %, 50 V", 0.1),
    Order("C C0G", "10n", "Murata", "GRM2195C1H103JA01D", "10 nF 5 % C0G 50 V 0805", "any C0G or film, 50 V", 0.2),
    Order("C film", "100n", "Panasonic", "ECP-U1C104MA5", "100 nF film 16 V 1210", "C0G of 100 nF, 25 V", 1.0),
    Order("C X7R", "10n", "Murata", "GRM216R71H103KA01D", "10 nF X7R 50 V 0805", "any X7R, 25 V", 0.1),
    Order("C X7R", "100n", "Murata", "GRM21BR71H104KA01L", "100 nF X7R 50 V 0805", "any X7R, 50 V", 0.1),
    Order("C X7R", "1u", "Murata", "GRM21BR71E105KA99L", "1 µF X7R 25 V 0805", "any X7R, 25 V", 0.15),
    Order("C bulk", "47u", "Panasonic", "EEE-FK1V470P", "47 µF 35 V electrolytic", "any 47 µF, 25 V or more", 0.5),
    Order("supply inlet", "", "Phoenix Contact", "1729131", "screw terminal, 3 poles, 5.0 or 5.08 mm", "any", 1.2),
    Order("electrode connector", "", "Amphenol", "T821132A1S100CEU", "box header 2 x 16, 2.54 mm", "any 2 x 16 box header", 1.0),
    Order("NUCLEO-F767ZI", "", "ST", "NUCLEO-F767ZI", "processor board (MB1137)", "none: the firmware is for this one", 28.0),
)  # fmt: skip

# Bought once, without a place in the circuit.
EXTRAS = (
    Order("", "", "Mean Well", "NSD05-12D15", "isolated converter to ±15 V, 5 W, from 9 to 36 V", "a laboratory supply; medical grade if people touch the skin", 20.0),
    Order("", "", "", "", "pin headers for CN11 and CN12, two rows, 2.54 mm", "any", 4.0),
    Order("", "", "", "", "ribbon cable 32 wires, 0.3 m, with a 2 x 16 socket; split it into single wires below 10 cm", "any", 5.0),
    Order("", "", "", "", "bare circuit board of the shield, two or four layers", "perforated board and adapters for TSSOP and MSOP", 20.0),
)  # fmt: skip
