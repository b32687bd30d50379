from services.base import main
from services.rec_replay.service import build

if __name__ == "__main__":
    main(__file__, build)
