from services.base import main
from services.inertial_sensor.service import build

if __name__ == "__main__":
    main(__file__, build)
