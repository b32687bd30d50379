from tests.services.map_folders import cube_at, cube_obj, write_map

__all__ = ["cube_at", "cube_obj", "write_map"]
