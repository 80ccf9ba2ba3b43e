"""The compiled controller: `from engram.engine import engine`.

`engine` is the extension module engram._engine of the CMake build: a submodule per robot (`engine.panda.rnea(q, v, a)`) and a
class per optimal control problem. It lives in build/; the environment variable ENGRAM_BUILD names another build folder.
"""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from engram.paths import BUILD, relative

MODULE = "engram._engine"


def load(build: Path) -> ModuleType:
    """The extension module of a build folder. Raises ImportError that names the mend."""
    folder = build / "codegen"
    found = sorted(folder.glob("_engine*.so"))
    if not found:
        raise ImportError(f"the compiled engine is not in {relative(folder)}: build it by `ninja -C {relative(build)} _engine`")
    spec = importlib.util.spec_from_file_location(MODULE, found[0])
    module = importlib.util.module_from_spec(spec)
    sys.modules[MODULE] = module
    spec.loader.exec_module(module)
    return module


engine = load(Path(os.environ.get("ENGRAM_BUILD", BUILD)).resolve())
