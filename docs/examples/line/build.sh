#!/bin/sh
# Compile the line: build.sh FOLDER-OF-MATIEC [FOLDER-FOR-WHAT-IS-BUILT]. It needs cell, a C compiler, pkg-config, libmodbus.
set -e
matiec=$(cd "$1" && pwd) out=${2:-build}
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$out"
cell map --format st >"$out/line.st"
cat "$here/line.st" "$here/plc.st" >>"$out/line.st"
"$matiec/iec2c" -I "$matiec/lib" -T "$out" "$out/line.st"
cc -w -std=gnu11 -I "$out" -I "$matiec/lib/C" -o "$out/plc" "$here/plc.c" "$out/Plc.c" "$out/Cpu.c" \
    $(pkg-config --cflags --libs libmodbus)
