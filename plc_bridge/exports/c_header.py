"""The map as a C header for clients in C and related languages: places of registers and bits, and the name of every number."""

from collections.abc import Iterator, Mapping, Sequence

from plc_bridge.protocol.registers import MIRROR, VERSION_MAJOR, VERSION_MINOR, Register


def as_c_header(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return the header.

    Args:
        registers: The whole map.
        names: Names of the map's numbers, see `plc_names`.
    """
    lines = [
        f"/* Register map {VERSION_MAJOR}.{VERSION_MINOR}, made by `cell map --format h`. Places are zero-based addresses;",
        "   values wider than a word and strings are big-endian. */",
        "#ifndef CELL_MAP_H",
        "#define CELL_MAP_H",
        "",
        *_places(registers),
        "",
        f"#define CELL_MIRROR {MIRROR} /* input registers can be read as holding registers so much higher */",
        "",
        *(f"#define CELL_{name} {number}" for name, number in names.items()),
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _places(registers: Sequence[Register]) -> Iterator[str]:
    """Return a line for each register and bit, and the size of each block."""
    sizes: dict[str, int] = {}
    for register in registers:
        kind = register.table.upper()
        prefix = f"{kind}_" if register.table in ("coil", "discrete") else ""
        unit = f", in {register.scale:g} {register.unit}" if register.scale != 1.0 else ""
        yield f"#define CELL_{prefix}{register.name.upper()} {register.address} /* {register.type}{unit} */"
        block = kind + "S" if prefix else register.name.partition("_")[0].upper()
        sizes[block] = sizes.get(block, 0) + register.words
    for block, size in sizes.items():
        yield f"#define CELL_{block}_SIZE {size}"
