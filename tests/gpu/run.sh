#!/usr/bin/env bash
# On the machine that a bundle was unpacked on: `make gpu` without a network. Arguments are those of the command; the files
# of its parts and their logs are in gsvc_lab/benchmarks/cache/gpu, unless --work says otherwise.
set -euo pipefail
tree=$(realpath "$(dirname "$0")/../..")
PYTHON=${PYTHON:-python3}
export PYTHONPATH="$tree:$tree/conformance:$tree/site${PYTHONPATH:+:$PYTHONPATH}"

missing=()
for wheel in "$tree"/wheels/*.whl; do
    name=${wheel##*/}
    [ ! -e "$wheel" ] || "$PYTHON" -c "import importlib.metadata as m; m.version('${name%%-*}')" 2>/dev/null || missing+=("$wheel")
done
[ ${#missing[@]} = 0 ] ||
    "$PYTHON" -m pip install --quiet --disable-pip-version-check --no-index --no-deps --no-compile --target "$tree/site" "${missing[@]}"
mkdir -p "$tree/missing"
for library in "$tree"/lib/*; do
    [ ! -e "$library" ] || ldconfig -p | grep -q "${library##*/} " || ln -sf "$library" "$tree/missing/"
done
export LD_LIBRARY_PATH="$tree/missing${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
exec "$PYTHON" -m tests.gpu "$@"
