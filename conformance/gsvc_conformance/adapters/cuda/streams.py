"""Whole streams."""
from typing import Any
from gsvc_conformance import spec
from gsvc_conformance.adapters.cuda.main_profile import body_functions
def _operations():
    names: dict[str, Any] = {}
    names.update(spec.namespace(functions=body_functions(names)))
    return names
OPERATIONS = _operations()
