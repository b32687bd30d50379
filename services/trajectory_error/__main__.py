from services.base import main
from services.trajectory_error.service import build

if __name__ == "__main__":
    main(__file__, build)
