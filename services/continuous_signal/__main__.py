from services.base import main
from services.continuous_signal.service import build

if __name__ == "__main__":
    main(__file__, build)
