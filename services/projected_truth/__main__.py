from services.base import main
from services.projected_truth.service import build

if __name__ == "__main__":
    main(__file__, build)
