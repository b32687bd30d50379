from services.base import RealTimeClock, main
from services.clock.service import build

if __name__ == "__main__":
    main(__file__, build, clock=RealTimeClock())
