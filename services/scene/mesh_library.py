"""trimesh, loaded without scipy, which OBJ files do not need and which takes longer to load than all else together."""

import sys
from types import ModuleType
from typing import cast

_SCIPY = "scipy"

if _SCIPY in sys.modules:
    import trimesh
else:
    sys.modules[_SCIPY] = cast(ModuleType, None)  # trimesh does without what cannot be imported
    try:
        import trimesh
    finally:
        del sys.modules[_SCIPY]

__all__ = ["trimesh"]
