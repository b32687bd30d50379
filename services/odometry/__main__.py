import sys
from pathlib import Path

from services.base import run
from services.odometry.service import build

if __name__ == "__main__":
    sys.exit(run(Path(__file__).parent, build))
