#!/usr/bin/env bash
# Packs what a machine with a GPU and without a network needs for `make gpu`: this checkout's code and vectors, splats and
# a stream to measure on, the CPU's digests, wheels, and loaders of drivers.
#
#     tests/gpu/bundle.sh gsvc-gpu.tar.xz            there: tar xf gsvc-gpu.tar.xz && gsvc-gpu/tests/gpu/run.sh --out FOLDER
#
# The other machine has to have: Python (PYTHON_VERSION, else 3.12) with NumPy, Numba, SciPy, scikit-image and pillow, and for
# the adapters CuPy, PyTorch and the CUDA toolkit, which are too large to pack (the wheel of CuPy alone has 66 MiB). Further
# wheels, such as one of the authors' rasteriser, are packed from the folder WHEELS. With BARE=1 code and vectors alone.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$(realpath -m "${1:?usage: tests/gpu/bundle.sh FILE.tar.xz}")
PYTHON=${PYTHON:-.venv/bin/python}
MAX_BYTES=$((60 << 20))
# Vulkan's loader, and what NVIDIA's driver for it wants to find.
LOADERS="libvulkan.so.1 libEGL.so.1 libGLdispatch.so.0 libOpenGL.so.0 libGL.so.1 libGLX.so.0
    libX11.so.6 libXext.so.6 libxcb.so.1 libXau.so.6 libXdmcp.so.6 libbsd.so.0 libmd.so.0"
PACKAGES="pyopencl pytools siphash24 platformdirs typing_extensions wgpu rendercanvas cffi pycparser"

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
tree=$folder/gsvc-gpu
mkdir "$tree"
git ls-files -z gsvc_base gsvc_ref gsvc_tools gsvc_lab conformance vectors spec spec.md docs/gpu.md docs/reports/README.md \
    tests/gpu pyproject.toml LICENSE | tar --create --null --files-from - | tar --extract --directory "$tree"
"$PYTHON" - "$tree" <<'END'
# Names and entry points of the packages, as an installation would have them.
import sys, tomllib
from pathlib import Path
for name in ("pyproject.toml", "conformance/pyproject.toml"):
    project = tomllib.loads(Path(name).read_text())["project"]
    folder = Path(sys.argv[1], project["name"].replace("-", "_") + "-0.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0\n")
    groups = project.get("entry-points", {}).items()
    lines = [line for group, entries in groups for line in (f"[{group}]", *(f"{k} = {v}" for k, v in entries.items()))]
    (folder / "entry_points.txt").write_text("\n".join(lines) + "\n")
END
git describe --always --dirty --exclude='*' --abbrev=8 >"$tree/COMMIT"

if [ -z "${BARE:-}" ]; then
    "$PYTHON" -m tests.gpu.golden
    mkdir "$tree/gsvc_lab/benchmarks/cache" "$tree/wheels" "$tree/lib"
    cp $("$PYTHON" -m tests.gpu.golden --list) "$tree/gsvc_lab/benchmarks/cache"
    "$PYTHON" -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: --implementation cp \
        --python-version "${PYTHON_VERSION:-3.12}" --platform manylinux_2_28_x86_64 --platform manylinux_2_17_x86_64 \
        --platform manylinux2014_x86_64 --dest "$tree/wheels" $PACKAGES
    [ -z "${WHEELS:-}" ] || cp "$WHEELS"/*.whl "$tree/wheels"
    for library in $LOADERS; do
        there=$(ldconfig -p | awk -v name="$library" '$1 == name && /x86-64/ {print $NF; exit}')
        [ -z "$there" ] || cp --dereference "$there" "$tree/lib/$library"
    done
fi

tar --create --xz --file "$target" --directory "$folder" gsvc-gpu
size=$(stat --format %s "$target")
echo "$target: $((size >> 10)) KiB"
[ "$size" -lt $MAX_BYTES ] || { echo "it is larger than 60 MiB; leave out what WHEELS has" >&2; exit 1; }
