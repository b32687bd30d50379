from services.base import main
from services.range_finder.service import build

if __name__ == "__main__":
    main(__file__, build)
