"""Files of errors in which a test sets some to one value."""

import json
import tomllib
from pathlib import Path

NOTHING = {"normal": {"sigma": 0.0}, "uniform": {"low": 0.0, "high": 0.0}, "factor": {"spread": 1.0}}
NOTHING |= {
    "lognormal": {"sigma": 0.0},
    "chance": {"probability": 0.0},
    "quantiles": {"shares": [0.5], "values": [1.0]},
    "range": {"low": 1.0, "high": 1.0},
}


def errors(folder, *, alone=True, **figures):
    """Write a file in which these errors have one value and, if `alone`, no other is drawn; return the key that names it."""
    lines = []
    for group, drawn_errors in tomllib.loads(Path("config/reality.toml").read_text(encoding="utf-8")).items():
        for name, error in drawn_errors.items():
            value = figures.get(f"{group}_{name}")
            drawn = NOTHING[error["distribution"]] if alone else {}
            if value is not None:
                error, drawn = error | {"distribution": "uniform"}, {"low": value, "high": value}
                error.pop("sigma", None)
            lines.append(f"[{group}.{name}]")
            lines += [f"{key} = {json.dumps(entry, ensure_ascii=False)}" for key, entry in (error | drawn).items()]
    path = folder / "reality.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return f'reality.file="{path}"'
